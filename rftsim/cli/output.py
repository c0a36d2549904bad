"""Everything that several commands print: JSON, tables, bars of progress, and lines about doubts and files."""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table


def print_json(value: Any) -> None:
    """Print a value as JSON, and nothing else, on standard output."""
    print(json.dumps(value, indent=2))


def print_line(console: Console, line: str) -> None:
    """Print a line as it is, without breaking it or colouring its numbers."""
    console.print(line, highlight=False, soft_wrap=True)


def print_doubts(console: Console, doubts: Iterable[str]) -> None:
    """Print doubts about a result, each on a line of its own."""
    for doubt in doubts:
        print_line(console, f"[yellow]warning:[/yellow] {escape(doubt)}")


def print_written(console: Console, *paths: Path | None) -> None:
    """Say of each file that it was written; None stands for one that was not asked for."""
    for path in paths:
        if path is not None:
            print_line(console, f"wrote {path}")


def make_table(title: str | None, words: Iterable[str], numbers: Iterable[str], *, wrap: bool = False) -> Table:
    """Make a table with columns of words, and then columns of numbers, which are set to the right.

    Args:
        title: The title, above the table.
        words: Headings of the columns of words.
        numbers: Headings of the columns of numbers.
        wrap: Whether cells may be broken into lines.
    """
    table = Table(title=title, title_justify="left")
    for heading in words:
        table.add_column(escape(heading), no_wrap=not wrap)
    for heading in numbers:
        table.add_column(escape(heading), justify="right", no_wrap=not wrap)
    return table


def is_quiet(hidden: bool) -> bool:
    """Whether no bar is shown: it was asked for, or nobody looks, as standard error goes to a file."""
    return hidden or not Console(stderr=True).is_terminal


@contextmanager
def progress(name: str, total: int, hidden: bool) -> Iterator[Callable[[str], None]]:
    """Show a bar of a command's steps; the function that it gives is called after each, with what comes, or was."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=is_quiet(hidden)
    ) as bar:
        task = bar.add_task(name, total=total)
        yield lambda said: bar.update(task, advance=1, description=said)
