"""What compiled code is cached under."""

import hashlib
from pathlib import Path
from typing import Final

SOURCE: Final = hashlib.sha256(
    b"".join(file.read_bytes() for file in sorted(Path(__file__).parent.glob("**/*.py")))
).hexdigest()
"""Identifies the package's source.

Numba's cache distinguishes functions by what they close over, and does not see the functions that they call; so what
is compiled with `cache=True` closes over this.
"""
