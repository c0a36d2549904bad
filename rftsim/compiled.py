"""What the machine code is made from."""

import hashlib
from pathlib import Path
from typing import Final

_HERE: Final = Path(__file__).parent
_BESIDES: Final = ("engine/block.py", "engine/layout.py", "packed.py", "registry.py", "tables.py")
"""Files whose constants are compiled in, beside those that import numba."""


def _is_compiled(path: Path, text: bytes) -> bool:
    return b"\nfrom numba import" in text or path.relative_to(_HERE).as_posix() in _BESIDES


_TEXTS: Final = {path: path.read_bytes() for path in sorted(_HERE.rglob("*.py"))}
FILES: Final = tuple(path for path, text in _TEXTS.items() if _is_compiled(path, text))
SOURCE: Final = hashlib.sha256(b"".join(_TEXTS[path] for path in FILES)).digest()
"""Identifies it."""
