"""Files that are written whole or not at all."""

import contextlib
import os
import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from rftsim_mpm.errors import MpmError

PACKED = (b"\x1f\x8b", b"BZh", b"\xfd7zX")
"""Beginnings of files that gzip, bzip2 and xz have packed."""


def check_writable(path: Path, *suffixes: str) -> None:
    """Refuse a path whose folder is missing or not writable, or whose ending is none of `suffixes`.

    Raises:
        MpmError: The path is such a one, or a folder.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise MpmError(f"{path} must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise MpmError(f"{path} is a folder")
    if not path.parent.is_dir():
        raise MpmError(f"no folder {path.parent} to write {path.name} to")
    if not os.access(path.parent, os.W_OK):
        raise MpmError(f"cannot write to {path.parent}")


def check_size(path: Path, largest: int) -> None:
    """Refuse a file that is larger, packed or unpacked, than `largest` [byte].

    Raises:
        MpmError: It is larger, or packed in a way that does not say how large it is.
    """
    with path.open("rb") as file:
        start = file.read(4)
    size = path.stat().st_size
    if start.startswith(PACKED):
        raise MpmError(f"{path} is a packed file: unpack it first")
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            size = max(size, sum(entry.file_size for entry in archive.infolist()))
    if size > largest:
        raise MpmError(f"{path} has {size / 1e6:.0f} MB, which is more than the {largest / 1e6:.0f} that are read")


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file that takes the place of `path`, on the disk, when the block ends well.

    Until it is whole it lies in the system's folder of temporary files, so that a process that is killed leaves nothing
    beside `path`.
    """
    check_writable(path)
    with tempfile.TemporaryDirectory(prefix="rftsim-mpm-") as folder:
        temporary = Path(folder) / path.name
        yield temporary
        _put(temporary, path)


def _put(whole: Path, path: Path) -> None:
    """Put a file that is whole in its place, from which other file system it may be."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    beside = Path(name)
    try:
        with whole.open("rb") as source, open(handle, "wb") as target:
            shutil.copyfileobj(source, target)
            target.flush()
            os.fsync(target.fileno())
        beside.chmod(0o644)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
