"""Files written whole, or not at all, and measurements kept in one."""

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
import tomllib
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from rftsim.errors import RftsimError, RftsimWarning

PACKED: Final = (b"\x1f\x8b", b"BZh", b"\xfd7zX")
"""Beginnings of files that gzip, bzip2 and xz have packed."""


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A context with a temporary file, which takes the place of `path` on the disk when the block ends well.

    Until it is whole it lies in the system's folder of temporary files, so that a process that is killed leaves nothing
    beside `path`.

    Raises:
        RftsimError: The folder cannot be written.
    """
    check_writable(path)
    with tempfile.TemporaryDirectory(prefix="rftsim-") as folder:
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


def check_writable(path: Path, *suffixes: str) -> None:
    """Refuse a path whose folder is missing or not writable, or whose ending is none of `suffixes`.

    Raises:
        RftsimError: The path cannot be written, or must end otherwise.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise RftsimError(f"{path} must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise RftsimError(f"{path} is a folder")
    if not path.parent.is_dir():
        raise RftsimError(f"no folder {path.parent} to write {path.name} to")
    if not os.access(path.parent, os.W_OK):
        raise RftsimError(f"cannot write to {path.parent}")


def read_toml(path: Path, what: str, refuse: type[RftsimError] = RftsimError) -> dict[str, Any]:
    """The tables of a TOML file.

    Args:
        path: The file.
        what: What it should be, for errors: `sand`.
        refuse: Kind of the errors that are raised.

    Raises:
        RftsimError: It cannot be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise refuse(f"cannot read the {what} file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise refuse(f"the {what} file {path} is not TOML: {error}") from None
    except (RecursionError, ValueError):  # brackets within brackets, and whole numbers of thousands of digits
        raise refuse(f"the {what} file {path} is nested too deeply, or has a number too long to be read") from None


def check_size(path: Path, largest: int) -> None:
    """Refuse a file that is larger, packed or unpacked, than `largest` [byte].

    Raises:
        RftsimError: It is larger, or packed in a way that does not say how large it is.
    """
    with path.open("rb") as file:
        start = file.read(4)
    size = path.stat().st_size
    if start.startswith(PACKED):
        raise RftsimError(f"{path} is a packed file: unpack it first")
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            size = max(size, sum(entry.file_size for entry in archive.infolist()))
    if size > largest:
        raise RftsimError(f"{path} has {size / 1e6:.0f} MB, which is more than the {largest / 1e6:.0f} that are read")


class Kept:
    """Measurements by name, kept in a file from one run to the next.

    Args:
        path: The file, in JSON; written whole after each measurement. Of one that is damaged nothing is taken.
        inputs: All that the measurements depend on; what was kept under other inputs is measured again.
    """

    def __init__(self, path: Path, inputs: bytes) -> None:
        self.path = path
        self.key = hashlib.sha256(inputs).hexdigest()
        self.known: dict[str, Any] = {}
        if path.is_file():
            kept = _kept(path)
            if kept is None:
                warnings.warn(f"{path} is damaged: all is measured again", RftsimWarning, stacklevel=2)
            elif kept["key"] == self.key:
                self.known = kept["known"]

    def get(self, name: str, measure: Callable[[], Any]) -> Any:
        """The measurement of that name, as JSON has it, by `measure` now or from before."""
        if name not in self.known:
            self.known[name] = measure()
            kept = {"key": self.key, "known": self.known}
            with replacing(self.path) as temporary:
                temporary.write_text(json.dumps({**kept, "sha256": _checksum(kept)}))
        return self.known[name]


def _kept(path: Path) -> dict[str, Any] | None:
    """What a file of measurements holds; None where that is not what was written."""
    try:
        kept = json.loads(path.read_text())
        whole = kept.pop("sha256") == _checksum(kept) and isinstance(kept["known"], dict) and "key" in kept
    except (ValueError, RecursionError, AttributeError, KeyError, TypeError):
        return None
    return kept if whole else None


def _checksum(value: object) -> str:
    """The SHA-256 of a value, as JSON has it."""
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()
