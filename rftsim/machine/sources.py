"""The sources that the machine code is made from, and their hash."""

import hashlib
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent.parent
FOLDERS: Final = ("engine", "law", "machine", "solver")
"""Rooms whose modules are compiled, or whose constants are compiled in."""
FILES: Final = tuple(path for folder in FOLDERS for path in sorted((PACKAGE / folder).glob("*.py")))
SOURCE: Final = hashlib.sha256(b"".join(path.read_bytes() for path in FILES)).digest()
"""SHA-256 of all of them, one after another."""
