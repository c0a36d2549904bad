"""Files written whole, or not at all, and measurements kept in one."""

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rftsim.errors import RftsimError


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A context with a temporary file beside `path`, which takes its place on the disk when the block ends well.

    Raises:
        RftsimError: The folder cannot be written.
    """
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


class Kept:
    """Measurements by name, kept in a file from one run to the next.

    Args:
        path: The file, in JSON; written whole after each measurement.
        inputs: All that the measurements depend on; what was kept under other inputs is measured again.
    """

    def __init__(self, path: Path, inputs: bytes) -> None:
        self.path = path
        self.key = hashlib.sha256(inputs).hexdigest()
        self.known: dict[str, Any] = {}
        if path.is_file():
            kept = json.loads(path.read_text())
            if kept.get("key") == self.key:
                self.known = kept["known"]

    def get(self, name: str, measure: Callable[[], Any]) -> Any:
        """The measurement of that name, as JSON has it, by `measure` now or from before."""
        if name not in self.known:
            self.known[name] = measure()
            with replacing(self.path) as temporary:
                temporary.write_text(json.dumps({"key": self.key, "known": self.known}))
        return self.known[name]
