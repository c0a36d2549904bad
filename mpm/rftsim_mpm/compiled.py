"""How the loops are compiled, and the name that their machine code is cached under."""

import hashlib
from pathlib import Path
from typing import Final

SOURCE_HASH: Final = hashlib.sha256(
    b"".join(
        path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")) if b"from numba" in path.read_bytes()
    )
).hexdigest()
"""Identifies the source of everything that is compiled.

Numba's cache does not see a change in a function that another one calls; so what is cached closes over this.
"""

FASTMATH: Final = {"contract", "reassoc", "arcp", "nsz"}
"""Floating-point liberties of the compiled loops; a NaN stays one."""
