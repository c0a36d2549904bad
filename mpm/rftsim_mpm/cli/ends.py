"""How commands end: errors in one line, and signals."""

import contextlib
import io
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from rftsim_mpm.errors import MpmError

REFUSED, STOPPED, TERMINATED = 2, 130, 143
"""Exit codes of inputs that cannot be, of Ctrl-C and of SIGTERM."""
ERRORS: Final = (MpmError, ValueError, OSError, OverflowError, MemoryError, RecursionError)
"""Errors that an input causes, and not a mistake of ours."""
RULE: Final = re.compile("─{3,}")
"""The lines that divide the parts of a parser's error."""


def said(error: BaseException) -> str:
    """The words of an error in one line, or its kind where it has none."""
    return " ".join(str(error).split()) or type(error).__name__


def parsed(parse: Callable[[], Any]) -> Any:
    """The command that a parser of arguments reads, whose errors, boxes of many lines, are said in one.

    Raises:
        MpmError: The arguments are none of a command.
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
        raise MpmError("; ".join(dict.fromkeys([parts[0].rstrip("."), parts[-1]]))) from None


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
