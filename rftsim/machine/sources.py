"""The sources that each part of the machine code is made from, and their hashes."""

import functools
import hashlib
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent.parent
PARTS: Final = {"law": ("law", "machine"), "solver": ("law", "machine", "solver")}
PARTS["engine"] = (*PARTS["solver"], "engine")
"""Rooms whose modules are compiled into a part, or whose constants are compiled in."""
FILES: Final = tuple(path for folder in PARTS["engine"] for path in sorted((PACKAGE / folder).glob("*.py")))
"""The files of all parts."""


@functools.cache
def source_of(part: str) -> bytes:
    """SHA-256 of the sources of a part, one after another."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in FILES if path.parent.name in PARTS[part])).digest()
