"""Seals: what tells that the numbers of a model are those that were written, and belong to what they are named after.

A seal stands behind each bed and each surface. It holds how many characters of the name behind the marker are the
owner's own, before any attachment, and two digests of 64 bits in pieces that any printing keeps: one of the numbers as
they are, and one as they are after MuJoCo printed them as XML, to six digits. What a bed may be given in place, as
`xi_n`, is left out, and held within bounds instead.
"""

from typing import Final

import numpy as np

from rftsim.law.laws import RESPONSES
from rftsim.law.layout import BED, TERRAIN, numbers_in
from rftsim.surface.triangles import Array

SEAL: Final = np.dtype([("length", "f8"), ("exact", "f8", 4), ("printed", "f8", 4)])
"""Characters of the owner's name, and the digests, 16 bits to a number."""
STEP: Final = 0x9E3779B97F4A7C15
FACTOR: Final = 0xBF58476D1CE4E5B9
"""Numbers by which a digest tells places and scatters bits."""
DIGITS: Final = 6
"""Digits of a number in MuJoCo's XML."""
TINY: Final = 1e-11
"""Size below which a number counts as zero in a digest; MuJoCo prints none below 1e-12."""
FREE: Final = ("up", "offset", "tolerance", "iterations")
"""Numbers of a bed that may be changed in place, beside the sand's parameters."""
TOLERANCES: Final = (1e-6, 0.1)
"""Least and largest tolerance of the implicit force, relative to a body's velocity [-]."""
COUNTS: Final = (1, 60)
"""Least and largest cap on the iterations of one solution."""
LARGEST: Final = 1e12
"""Largest parameter of a sand, and height [m], in SI units."""
LONGEST: Final = 4096
"""Characters from which on a name is none."""
ANSWERS: Final = len(RESPONSES)
"""Responses that machine code was made for."""


def _places(name: str) -> range:
    """Places of a field's numbers in a packed bed."""
    dtype, start = BED.fields[name][:2]  # type: ignore[index]
    return range(start // 8, start // 8 + numbers_in(dtype))


PARAMETERS: Final = tuple(range(_places("dynamic").stop, _places("table").start))
"""Places of the sand's parameters in a packed bed."""
SEALED: Final = np.array(
    sorted(
        k
        for name in ("response", "plane", "relief", "spacing", "rows", "columns", "dynamic", "table")
        for k in _places(name)
    ),
    dtype=np.int64,
)
"""Places of the numbers of a bed that its seal covers."""
WEIGHED: Final = 128
"""Numbers that are weighed together at each step, to see whether they were changed."""
WEIGHTS: Final = 0.5 + np.arange(1, 1 + WEIGHED) * (5**0.5 - 1) / 2 % 1.0
"""Weights of their places."""
TABLE: Final = _places("table")
REST: Final = SEALED[~np.isin(SEALED, TABLE)]
"""Places of the table, and of the other numbers that the seal covers."""
SEAL_NUMBERS: Final = numbers_in(SEAL)
SHAPE: Final = np.array([k for k, name in enumerate(TERRAIN.names or ()) if name not in ("x", "y")], dtype=np.int64)
"""Places of the numbers of a terrain that its seal covers."""


def sealed_bed(bed: Array, name: str) -> Array:
    """A packed bed with its seal behind it.

    Args:
        bed: Packed sand, a record of BED.
        name: The bed's name.
    """
    return np.concatenate([bed, _seal(bed[SEALED], name, name)])


def sealed_terrain(terrain: Array, name: str) -> Array:
    """A packed terrain with its seal behind it, which covers its shape and leaves its place and heights free.

    Args:
        terrain: Packed terrain, a record of TERRAIN and its coefficients.
        name: The bed's name.
    """
    return np.concatenate([terrain, _seal(terrain[SHAPE], name, name)])


def sealed_surface(surface: Array, body: str, bed: str) -> Array:
    """A packed surface with its seal behind it.

    Args:
        surface: Packed surface.
        body: Name of the body that it bounds.
        bed: Name of the bed that the body feels.
    """
    return np.concatenate([surface, _seal(surface, body, body + bed)])


def is_sealed(numbers: Array, seal: Array, names: bytes) -> bool:
    """Whether a seal is that of numbers and names, exactly or as printed.

    Args:
        numbers: What the seal covers: all of a surface, or the SEALED numbers of a bed.
        seal: The numbers behind it, a record of SEAL.
        names: The owner's own name, and the bed's behind that of a body.
    """
    return _pieces(_digest(numbers, names)) in (seal[1:5].tolist(), seal[5:9].tolist())


def own_names(owner: str, seal: Array) -> list[bytes]:
    """All that an owner's own name can have been before any attachment, by the length that its seal says."""
    name = owner.encode()
    length = int(seal[0]) if 0 <= seal[0] <= len(name) else len(name)
    return [name[start : start + length] for start in range(len(name) - length + 1)]


def _seal(numbers: Array, name: str, names: str) -> Array:
    printed = np.array([float(f"{x:.{DIGITS}g}") for x in numbers.tolist()])
    digests = (_pieces(_digest(kind, names.encode())) for kind in (numbers, printed))
    return np.concatenate([[len(name.encode())], *digests])


def _digest(numbers: Array, text: bytes) -> int:
    """A digest of numbers and characters that depends on the place of each."""
    with np.errstate(over="ignore"):
        words = np.concatenate(
            [np.where(np.abs(numbers) < TINY, 0.0, numbers).view("u8"), np.frombuffer(text, "u1").astype("u8")]
        )
        words = words + np.uint64(STEP) * np.arange(1, len(words) + 1, dtype="u8")
        words = (words ^ (words >> np.uint64(32))) * np.uint64(FACTOR)
        return int((words ^ (words >> np.uint64(29))).sum())


def _pieces(digest: int) -> list[int]:
    return [digest >> shift & 0xFFFF for shift in (0, 16, 32, 48)]
