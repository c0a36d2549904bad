"""What compiled code is cached under."""

import hashlib
from pathlib import Path
from typing import Final

_FILES = [path.read_bytes() for path in sorted(Path(__file__).parent.rglob("*.py"))]
SOURCE: Final = hashlib.sha256(
    b"".join(text for text in _FILES if b"from numba import" in text or b"TABLE_3_1" in text)
).hexdigest()
"""Identifies the source of what is compiled: the files that use numba, and the tables.

Numba's cache distinguishes functions by what they close over, and does not see the functions that they call; so what
is compiled with `cache=True` closes over this.
"""
