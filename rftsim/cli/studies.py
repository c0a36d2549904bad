"""What the studies of `rftsim bench` share: a picture that is written whole, and a bar of what is done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rftsim.files import check_writable, replacing


def picture_in(folder: Path | None, name: str) -> Path | None:
    """Where a study's picture goes, checked before anything is measured."""
    if folder is None:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    check_writable(folder / f"{name}.png")
    return folder / f"{name}.png"


def remembered_in(folder: Path, name: str) -> Path:
    """Where a study keeps what it measured, checked as well."""
    folder.mkdir(parents=True, exist_ok=True)
    check_writable(folder / f"{name}.json")
    return folder / f"{name}.json"


def draw(picture: Path | None, plot: Callable[..., None], *found: Any) -> None:
    """Draw what was found into a study's picture, whole or not at all."""
    if picture is not None:
        with replacing(picture) as temporary:
            plot(*found, temporary)


def say(console: Console, picture: Path | None) -> None:
    """Say where the picture is."""
    if picture is not None:
        console.print(f"wrote {picture}", highlight=False)


@contextmanager
def progress(name: str, total: int, hidden: bool) -> Iterator[Callable[[str], None]]:
    """A bar of a study's steps; what it gives is called after each with what comes, or was."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=hidden) as bar:
        task = bar.add_task(name, total=total)
        yield lambda said: bar.update(task, advance=1, description=said)
