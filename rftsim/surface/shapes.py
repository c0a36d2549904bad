"""Primitive bodies about the origin as surfaces: boxes, spheres, cylinders and capsules.

Round ones are faceted, and blown up so that they have the true volume. As fine as they are unless asked, they are the
surfaces that the same geoms of a MuJoCo model have.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import SurfaceError
from rftsim.surface import solids
from rftsim.surface.triangles import Array, Surface

FINENESS: Final = 6
"""Edges of a shape's triangles are at most its size over this, unless the caller says otherwise."""


def box(size: ArrayLike, max_edge: float | None = None) -> Surface:
    """A box of the given lengths along x, y and z.

    Args:
        size: Lengths [m], shape (3,).
        max_edge: Longest edge of a triangle [m]; by default a sixth of the largest length.

    Raises:
        SurfaceError: A length is not positive.
    """
    lengths = np.array(size, dtype=float)
    if lengths.shape != (3,):
        raise SurfaceError(f"a box has three lengths, not {size!r}")
    _check(max_edge, **dict(zip(("length", "width", "height"), lengths.tolist(), strict=True)))
    return _cut(solids.box(lengths), float(lengths.max()), max_edge)


def sphere(radius: float, max_edge: float | None = None) -> Surface:
    """A sphere, as an icosahedron whose faces were cut in four often enough.

    Args:
        radius: Its radius [m].
        max_edge: Longest edge of a triangle [m]; by default a third of the radius.

    Raises:
        SurfaceError: A length is not positive.
    """
    _check(max_edge, radius=radius)
    cuts = 2 if max_edge is None else max(2, math.ceil(math.log2(1.2 * radius / max_edge)))
    return _cut(solids.round_ball(np.full(3, radius), cuts), 2.0 * radius, max_edge)


def cylinder(radius: float, length: float, max_edge: float | None = None) -> Surface:
    """A cylinder whose axis is that of z.

    Args:
        radius: Its radius [m].
        length: Its extent along z [m].
        max_edge: Longest edge of a triangle [m]; by default a sixth of its size.

    Raises:
        SurfaceError: A length is not positive.
    """
    _check(max_edge, radius=radius, length=length)
    return _cut(solids.round_cylinder(radius, length, _sections(radius, max_edge)), max(length, 2.0 * radius), max_edge)


def capsule(radius: float, length: float, max_edge: float | None = None) -> Surface:
    """A cylinder about z that half spheres end.

    Args:
        radius: Radius of both [m].
        length: Distance between the centres of the half spheres [m].
        max_edge: Longest edge of a triangle [m]; by default a sixth of its size.

    Raises:
        SurfaceError: A length is not positive.
    """
    _check(max_edge, radius=radius, length=length)
    sections = _sections(radius, max_edge)
    return _cut(solids.round_capsule(radius, length, sections // 2, sections), length + 2.0 * radius, max_edge)


def _sections(radius: float, max_edge: float | None) -> int:
    """How many sides a circle has."""
    fine = 0 if max_edge is None else 2 * math.ceil(math.pi * radius / max_edge)
    return max(solids.SECTIONS, fine)


def _cut(triangles: Array, size: float, max_edge: float | None) -> Surface:
    return Surface(triangles).refined(size / FINENESS if max_edge is None else max_edge)


def _check(max_edge: float | None, **lengths: float) -> None:
    if max_edge is not None:
        lengths["max_edge"] = max_edge
    for name, value in lengths.items():
        if not 0.0 < value < math.inf:
            raise SurfaceError(f"{name} must be positive and finite, not {value:g}")
