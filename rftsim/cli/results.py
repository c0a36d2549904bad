"""Files of a command's results: pictures that are written whole, and what a study remembers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing


def picture_in(folder: Path | None, name: str) -> Path | None:
    """Make a folder for a picture, NAME.png, and check that it can be written, before anything is measured."""
    return None if folder is None else _file_in(folder, f"{name}.png")


def remembered_in(folder: Path, name: str) -> Path:
    """Make a folder for what a study measured, NAME.json, and check that it can be written."""
    return _file_in(folder, f"{name}.json")


def _file_in(folder: Path, name: str) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RftsimError(f"cannot make the folder {folder}: {error.strerror}") from error
    check_writable(folder / name)
    return folder / name


def draw(picture: Path | None, plot: Callable[..., None], *found: Any) -> None:
    """Draw what was found into a picture, if one was asked for, whole or not at all."""
    if picture is not None:
        with replacing(picture) as temporary:
            plot(*found, temporary)
