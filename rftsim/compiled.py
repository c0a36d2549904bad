"""What the machine code is made from."""

import hashlib
from pathlib import Path
from typing import Final

FILES: Final = tuple(
    Path(__file__).parent / name
    for name in (
        "choice.py",
        "claims.py",
        "dense.py",
        *(f"engine/{name}.py" for name in ("block", "bodies", "callbacks", "explicit", "external", "implicit")),
        *(f"engine/{name}.py" for name in ("instance", "layout", "offsets")),
        "entries.py",
        "equation.py",
        "implicit.py",
        "kernels.py",
        "memory.py",
        *(f"native_{name}.py" for name in ("ahead", "build", "law", "solver", "step")),
        "packed.py",
        "registry.py",
        "rows.py",
        "state.py",
        "stepping.py",
        "tables.py",
        "unpack.py",
    )
)
"""The modules that import numba, and those whose constants they take."""
SOURCE: Final = hashlib.sha256(b"".join(path.read_bytes() for path in FILES)).digest()
"""Identifies it."""
