"""Boxes, balls and solids of revolution about the origin, as triangles that wind outward, (ntri, 3, 3).

The same as trimesh's, triangle by triangle; importing trimesh would take longer than all else at start-up.
"""

from typing import Final

import numpy as np

from rftsim.surface.splitting import Array, quartered

SECTIONS: Final = 24
"""Sides of round solids, unless more are asked for."""
_SHORT: Final = 0.5257311121191336  # sqrt((5 - sqrt 5) / 10)
_LONG: Final = 0.85065080835204  # sqrt((5 + sqrt 5) / 10)
_ICOSAHEDRON: Final = np.array(
    [(s * _SHORT, t * _LONG, 0.0) for t in (1, -1) for s in (-1, 1)]
    + [(0.0, s * _SHORT, t * _LONG) for t in (1, -1) for s in (-1, 1)]
    + [(t * _LONG, 0.0, s * _SHORT) for t in (1, -1) for s in (-1, 1)]
)[
    [
        *((0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11)),
        *((1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)),
        *((3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)),
        *((4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)),
    ]
]
_CUBE: Final = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])[
    [
        *((1, 3, 0), (4, 1, 0), (0, 3, 2), (2, 4, 0), (1, 7, 3), (5, 1, 4)),
        *((5, 7, 1), (3, 7, 2), (6, 4, 2), (2, 7, 6), (6, 5, 4), (7, 5, 6)),
    ]
]


def box(extents: Array) -> Array:
    """A box of the given lengths along x, y and z [m], shape (12, 3, 3)."""
    triangles: Array = _CUBE * extents
    return triangles


def ball(subdivisions: int) -> Array:
    """An icosahedron, each of whose triangles is cut in four so many times, its corners on the unit sphere."""
    triangles = _ICOSAHEDRON
    for _ in range(subdivisions):
        triangles = quartered(triangles)
        size = np.sqrt(np.dot(triangles.reshape(-1, 3) ** 2, [1.0, 1.0, 1.0])).reshape(-1, 3, 1)
        triangles += triangles / size * (1.0 - size)
    return triangles


def cylinder(radius: float, height: float, sections: int) -> Array:
    """A prism of so many sides, inscribed to a cylinder about z."""
    half = height / 2.0
    return revolved(np.array([(0.0, -half), (radius, -half), (radius, half), (0.0, half)]), sections)


def capsule(radius: float, height: float, sections: int, rings: int) -> Array:
    """A solid inscribed to a capsule about z.

    Args:
        radius: Radius of the capsule [m].
        height: Distance between the centres of its ends [m].
        sections: Number of sides about z.
        rings: Number of rings of each half circle.
    """
    quarter = rings // 2 + 1
    angle = np.concatenate([np.linspace(-np.pi / 2.0, 0.0, quarter), np.linspace(0.0, np.pi / 2.0, quarter)])
    profile = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    profile[: len(profile) // 2, 1] -= height / 2.0
    profile[len(profile) // 2 :, 1] += height / 2.0
    return revolved(profile, sections)


def revolved(profile: Array, sections: int) -> Array:
    """The solid that a profile sweeps about z, without empty faces.

    Args:
        profile: Distances from the axis and heights, from bottom to top [m], shape (n, 2).
        sections: Number of sides about z.
    """
    radius, height = profile.T
    angle = np.linspace(0.0, 2.0 * np.pi, sections + 1)
    angle[-1] = 0.0
    angle = angle[:, None] * (radius > 1e-9 * radius.max())  # on the axis, all of them are one point
    level = np.broadcast_to(height, angle.shape)
    points = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, level], axis=2)
    here, onward = points[:-1], points[1:]
    lower = np.stack([here[:, :-1], onward[:, :-1], here[:, 1:]], axis=2)
    upper = np.stack([here[:, 1:], onward[:, :-1], onward[:, 1:]], axis=2)
    triangles = np.stack([lower, upper], axis=2).reshape(-1, 3, 3)
    double = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    kept: Array = triangles[double > 2e-8 * np.ptp(profile) ** 2]
    return kept


def round_ball(radii: Array, subdivisions: int) -> Array:
    """A faceted ellipsoid of the true volume.

    Args:
        radii: Half axes [m], shape (3,).
        subdivisions: See `ball`.
    """
    unit = ball(subdivisions)
    blown_up: Array = unit * radii * (4.0 * np.pi / 3.0 / volume(unit)) ** (1.0 / 3.0)
    return blown_up


def round_cylinder(radius: float, height: float, sections: int) -> Array:
    """A faceted cylinder about z of the true volume and height, see `cylinder`."""
    return _widened(cylinder(radius, height, sections), np.pi * radius**2 * height)


def round_capsule(radius: float, height: float, sections: int, rings: int) -> Array:
    """A faceted capsule about z of the true volume and length, see `capsule`."""
    true = np.pi * radius**2 * (height + 4.0 / 3.0 * radius)
    return _widened(capsule(radius, height, sections, rings), true)


def _widened(triangles: Array, true: float) -> Array:
    """A solid about z made wider, so that it has a volume [m^3]."""
    widen = np.sqrt(true / volume(triangles))
    wider: Array = triangles * [widen, widen, 1.0]
    return wider


def volume(triangles: Array) -> float:
    """Volume within a closed surface [m^3]: the flux of (x, 0, 0) through it."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    return float((np.cross(b - a, c - b)[:, 0] * triangles.sum(axis=1)[:, 0]).sum() / 6.0)
