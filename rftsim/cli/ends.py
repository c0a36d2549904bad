"""How commands end: errors in one line, and signals."""

import contextlib
import io
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

import mujoco

from rftsim.errors import RftsimError

REFUSED, STOPPED, UNREAD, TERMINATED = 2, 130, 141, 143
"""Exit codes of inputs that cannot be, of Ctrl-C, of a reader that has gone, and of SIGTERM."""
ERRORS: Final = (
    RftsimError,
    ValueError,
    OSError,
    OverflowError,
    MemoryError,
    RecursionError,
    mujoco.FatalError,
)
"""Errors that an input causes, and not a mistake of ours."""
RULE: Final = re.compile("─{3,}")
"""The lines that divide the parts of a parser's error."""


def said(error: BaseException) -> str:
    """The words of an error in one line, or its kind where it has none."""
    return " ".join(str(error).split()) or type(error).__name__


def parsed(parse: Callable[[], Any]) -> Any:
    """The command that a parser of arguments reads, whose errors, boxes of many lines, are said in one.

    Raises:
        RftsimError: The arguments are none of a command.
    """
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return parse()
    except SystemExit as end:
        if end.code in (0, None):  # --help
            raise
        text = re.sub(r"\x1b\[[0-9;]*m|[╭╮╰╯│]", "", box.getvalue()).partition("\n")[2]
        parts = [" ".join(part.split()) for part in RULE.split(text) if part.strip()]
        parts = parts or ["these arguments are no command"]
        raise RftsimError("; ".join(dict.fromkeys([parts[0].rstrip("."), parts[-1]]))) from None


@contextlib.contextmanager
def unlogged() -> Iterator[None]:
    """Let MuJoCo neither print warnings nor write MUJOCO_LOG.TXT: its data count them, and are read."""
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as an exception does, so that nothing half done is left; not in another thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(TERMINATED))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def piped() -> Iterator[None]:
    """Let the block end quietly where nobody reads standard output any more, as in `| head`."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        if not _is_unread():
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where the interpreter flushes it at its end
        sys.exit(UNREAD)


def _is_unread() -> bool:
    """Whether standard output is a pipe whose reader has gone."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))
