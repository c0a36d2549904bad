"""Files that are written whole or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from rftsim_mpm.errors import MpmError


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


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path` that takes its place, on the disk, when the block ends well."""
    check_writable(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
