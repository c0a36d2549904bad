"""Sand and surface as plain arrays of numbers.

This is the form in which MuJoCo's models carry them (custom numeric fields), so that copies, pickles, attachment and
per-simulation values all come with the model. Compiled code reads them through `unpack`.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from rftsim.law import tables
from rftsim.law.laws import Law
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, Surface

SAND_FIELDS: Final = (
    *("law", "planar", "dynamic", "up_x", "up_y", "up_z", "offset", "plane_x", "plane_y", "plane_z"),
    *("xi_n", "zeta", "mu_surf", "rho_c", "lambda_", "g"),
)
"""Entries of a packed sand, in order; behind them the coefficients of f1, f2 and f3, TERMS each."""
TERMS: Final = len(tables.TABLE_C4)
SAND_SIZE: Final = len(SAND_FIELDS) + 3 * TERMS
STRENGTHS: Final = [SAND_FIELDS.index(name) for name in ("xi_n", "zeta")]
"""Where a packed sand has what scales its force, under the 3D laws and under the 2D ones."""

HEADER: Final = 19
"""Numbers before the triangles of a packed surface.

0 leading-edge tolerance; 1-3 and 4-6 lowest and highest corner; 7-9 wheel axis, 10-12 wheel centre, 13 wheel radius
(zero where the body is no wheel); 14 number of triangles; 15 their root-mean-square
distance from the origin; 16-18 direction at which the wheel's angles start.
"""
COLUMNS: Final = 7
"""Numbers per triangle, each a column: centre (3), normal (3), area."""
BLOCK: Final = 32
"""Triangles that are passed over together where the box of their centroids lies above the sand; the boxes stand behind
the columns."""
BOX: Final = 6
"""Numbers of a box: centre and half its size, in the body frame."""
RIM: Final = 0.7
"""A wheel's triangle is of its rim where its normal is no nearer to the axis than by this cosine."""
NO_RIM: Final = 9.0
"""Instead of the angle about the axis, of a wheel's other triangles. Behind its boxes stand each triangle's."""


def pack_sand(sand: Sand, law: Law, free_surface: FreeSurface, plane: ArrayLike) -> Array:
    """A sand bed as numbers: those of SAND_FIELDS, then the law's coefficients; (SAND_SIZE,).

    Raises:
        SandError: The law is dynamic and the sand's density unknown.
        ValueError: The plane's normal is not horizontal.
    """
    up = np.array(free_surface.normal)
    normal = np.asarray(plane, dtype=float)
    length = np.linalg.norm(normal)
    if normal.shape != (3,) or not length > 0.0 or (law.planar and abs(normal @ up) > 1e-6 * length):
        raise ValueError(f"the normal of the plane of motion must be horizontal, as (0, 1, 0) is, not {plane!r}")
    rho_c = sand.density() if law.dynamic else (sand.rho_c or 0.0)
    flags = (law.code, law.planar, law.dynamic)
    strength = (sand.xi_n, sand.zeta, sand.mu_surf, rho_c, sand.lambda_, sand.g)
    table = np.zeros((3, TERMS))
    for row, column in zip(table, tables.columns(law.table), strict=True):
        row[: len(column)] = column
    return np.array([*flags, *up, free_surface.offset, *(normal / length), *strength, *table.ravel()], dtype=float)


def pack_surface(surface: Surface) -> Array:
    """A surface as numbers: a header of HEADER, then COLUMNS columns of ntri."""
    points = np.concatenate([surface.corners, surface.centres])
    header = np.zeros(HEADER)
    header[0] = surface.edge_on
    header[1:4], header[4:7] = points.min(axis=0), points.max(axis=0)
    if surface.wheel is not None:
        header[7:10], header[10:13], header[13] = surface.wheel.axis, surface.wheel.centre, surface.wheel.radius
    header[14] = surface.ntri
    header[15] = np.sqrt((surface.centres**2).sum(axis=1).mean())
    angles = _rim_angles(surface, header) if surface.wheel is not None else np.empty(0)
    columns = *surface.centres.T, *surface.normals.T, surface.areas
    return np.concatenate([header, *columns, _boxes(surface).ravel(), angles])


def _rim_angles(surface: Surface, header: Array) -> Array:
    """Each triangle's angle about the wheel's axis [rad], (ntri,); the header gets the direction where they start."""
    axis, centre = header[7:10], header[10:13]
    start = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    header[16:19] = start = start / np.linalg.norm(start)
    arm = surface.centres - centre
    angles: Array = np.arctan2(arm @ np.cross(axis, start), arm @ start)
    return np.where(np.abs(surface.normals @ axis) <= RIM, angles, NO_RIM)


def _boxes(surface: Surface) -> Array:
    """Boxes of the centroids of each BLOCK of triangles, (nblock, BOX)."""
    blocks = [surface.centres[start : start + BLOCK] for start in range(0, surface.ntri, BLOCK)]
    low, high = (np.array([end(block, axis=0) for block in blocks]) for end in (np.min, np.max))
    return np.hstack([low + high, high - low]) / 2


def size_of(header: Array) -> int:
    """Numbers of the packed surface that starts with a header."""
    n = int(header[14])
    return HEADER + COLUMNS * n + BOX * ((n + BLOCK - 1) // BLOCK) + (n if header[13] != 0.0 else 0)


def read_columns(body: Array) -> tuple[Array, ...]:
    """The columns of a packed surface: centre (3), normal (3), area; views, each (ntri,)."""
    n = int(body[14])
    return tuple(body[HEADER + k * n : HEADER + (k + 1) * n] for k in range(COLUMNS))
