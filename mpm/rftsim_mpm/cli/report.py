"""Progress and printing, which all commands have in common."""

import contextlib
import json
from collections.abc import Callable, Iterator
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextlib.contextmanager
def progress(title: str, *, quiet: bool) -> Iterator[Callable[[float], None]]:
    """Show a bar on standard error with the time left; the block reports the share that is done, from 0 to 1."""
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    bar = Progress(
        *columns, TextColumn("left"), TimeRemainingColumn(), console=Console(stderr=True), transient=True, disable=quiet
    )
    task = bar.add_task(title, total=1.0)

    def show(share: float) -> None:
        if not bar.live.is_started:  # not before there is something to show: what cannot run says so on one line
            bar.start()
        bar.update(task, completed=share)

    try:
        yield show
    finally:
        if bar.live.is_started:
            bar.stop()


def print_json(value: Any) -> None:
    """Print a value as JSON, and nothing else, on standard output."""
    print(json.dumps(value, indent=2))
