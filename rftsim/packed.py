"""Sand and surface as plain arrays of numbers, and the evaluation of a law on them.

This is the form in which MuJoCo's models carry them (custom numeric fields), so that copies, pickles, attachment and
per-simulation values all come with the model. Compiled code and Python read them through the same functions.
"""

from typing import Final

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import ArrayLike

from rftsim import kernels, tables
from rftsim.kernels import Frame, Medium
from rftsim.laws import Law
from rftsim.sand import FreeSurface, Sand
from rftsim.surface import Array, Surface

SAND_FIELDS: Final = (
    *("law", "planar", "dynamic", "up_x", "up_y", "up_z", "offset", "plane_x", "plane_y", "plane_z"),
    *("xi_n", "zeta", "mu_surf", "rho_c", "lambda_", "g"),
)
"""Entries of a packed sand, in order; behind them the coefficients of f1, f2 and f3, TERMS each."""
TERMS: Final = len(tables.TABLE_C4)
SAND_SIZE: Final = len(SAND_FIELDS) + 3 * TERMS
STRENGTHS: Final = [SAND_FIELDS.index(name) for name in ("xi_n", "zeta")]
"""Where a packed sand has what scales its force, under the 3D laws and under the 2D ones."""

HEADER: Final = 16
"""Numbers before the triangles of a packed surface.

0 leading-edge tolerance; 1-3 and 4-6 lowest and highest corner; 7-9 wheel axis, 10-12 wheel centre, 13 wheel radius
(zero where the body is no wheel); 14 number of triangles; 15 their root-mean-square
distance from the origin.
"""
COLUMNS: Final = 7
"""Numbers per triangle, each a column: centre (3), normal (3), area."""
BLOCK: Final = kernels.BLOCK
"""Triangles that are passed over together where their bounding sphere lies above the sand; the spheres (centre, radius)
stand behind the columns."""


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
    return np.concatenate([header, *surface.centres.T, *surface.normals.T, surface.areas, _spheres(surface).ravel()])


def _spheres(surface: Surface) -> Array:
    """Bounding spheres of the centroids of each BLOCK of triangles, (nblock, 4)."""
    blocks = [surface.centres[start : start + BLOCK] for start in range(0, surface.ntri, BLOCK)]
    centres = np.array([(block.min(axis=0) + block.max(axis=0)) / 2 for block in blocks])
    radii = [np.linalg.norm(block - centre, axis=1).max() for block, centre in zip(blocks, centres, strict=True)]
    return np.column_stack([centres, radii])


@njit(forceinline=True)
def size_of(header):
    """Numbers of the packed surface that starts with a header."""
    n = int(header[14])
    return HEADER + COLUMNS * n + 4 * ((n + BLOCK - 1) // BLOCK)


def read_columns(body: Array) -> tuple[Array, ...]:
    """The columns of a packed surface: centre (3), normal (3), area; views, each (ntri,)."""
    n = int(body[14])
    return tuple(body[HEADER + k * n : HEADER + (k + 1) * n] for k in range(COLUMNS))


@njit(forceinline=True)
def columns(body):
    """The same for compiled code."""
    n = int(body[14])
    start = HEADER
    return (
        body[start : start + n],
        body[start + n : start + 2 * n],
        body[start + 2 * n : start + 3 * n],
        body[start + 3 * n : start + 4 * n],
        body[start + 4 * n : start + 5 * n],
        body[start + 5 * n : start + 6 * n],
        body[start + 6 * n : start + 7 * n],
    )


@njit(forceinline=True)
def block_is_clear(body, block, frame, margin):
    """Whether a block of triangles lies more than a margin above the undisturbed sand."""
    start = HEADER + COLUMNS * int(body[14]) + 4 * block
    height = frame.rise[0] * body[start] + frame.rise[1] * body[start + 1] + frame.rise[2] * body[start + 2]
    return height - body[start + 3] >= frame.height + margin


@njit(forceinline=True)
def next_run(body, start, count, frame, margin):
    """The next triangles from start on whose blocks are not clear, first to last; both are count where none are."""
    first = start
    while first < count and block_is_clear(body, first // BLOCK, frame, margin):
        first += BLOCK
    last = first
    while last < count and not block_is_clear(body, last // BLOCK, frame, margin):
        last += BLOCK
    return min(first, count), min(last, count)


@njit(forceinline=True)
def to_world(xmat, x, y, z):
    """Rotate a vector from the body to the world frame; xmat is row-major, (9,)."""
    return (
        xmat[0] * x + xmat[1] * y + xmat[2] * z,
        xmat[3] * x + xmat[4] * y + xmat[5] * z,
        xmat[6] * x + xmat[7] * y + xmat[8] * z,
    )


@njit(forceinline=True)
def to_body(xmat, x, y, z):
    """Rotate a vector from the world to the body frame."""
    return (
        xmat[0] * x + xmat[3] * y + xmat[6] * z,
        xmat[1] * x + xmat[4] * y + xmat[7] * z,
        xmat[2] * x + xmat[5] * y + xmat[8] * z,
    )


@njit(forceinline=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def is_clear(sand, body, xpos, xmat):
    """Whether the body's bounding box lies wholly above the sand."""
    up = to_body(xmat, sand[3], sand[4], sand[5])
    lowest = sand[3] * xpos[0] + sand[4] * xpos[1] + sand[5] * xpos[2] - sand[6]
    for k in range(3):
        lowest += min(up[k] * body[1 + k], up[k] * body[4 + k])
    return lowest >= 0.0


@njit(forceinline=True)
def medium_of(sand, body):
    """The medium of a packed sand as its law sees it."""
    xi = sand[11] if sand[1] != 0.0 else sand[10]
    lambda_rho = sand[14] * sand[13] if sand[2] != 0.0 else 0.0
    first = len(SAND_FIELDS)
    table = (
        to_fixed_tuple(sand[first : first + TERMS], TERMS),
        to_fixed_tuple(sand[first + TERMS : first + 2 * TERMS], TERMS),
        to_fixed_tuple(sand[first + 2 * TERMS :], TERMS),
    )
    return Medium(xi, sand[12], lambda_rho, body[0], kernels.STEP, table)


@njit(forceinline=True)
def frame_of(sand, body, xpos, xmat, velocity, omega):
    """The frame of a body at xpos, xmat whose origin moves with velocity and which turns with omega, world frame."""
    v0 = to_body(xmat, velocity[0], velocity[1], velocity[2])
    w = to_body(xmat, omega[0], omega[1], omega[2])
    up = to_body(xmat, sand[3], sand[4], sand[5])
    plane = to_body(xmat, sand[7], sand[8], sand[9])
    height = sand[6] - (sand[3] * xpos[0] + sand[4] * xpos[1] + sand[5] * xpos[2])
    frame = Frame(v0, w, up, up, _cross(plane, up), height, (0.0, 0.0, 0.0, 0.0), 0.0)
    if sand[2] == 0.0 or body[13] == 0.0:
        return frame
    rear, drop = _structural(sand, body, frame, plane)
    return Frame(v0, w, up, up, frame.forward, height, rear, drop)


@njit(forceinline=True)
def _structural(sand, body, frame, plane):
    """The half-space behind a driven wheel where the free surface has dropped, and by how much.

    delta h = r (r omega^2 / g), [Agarwal] section 4.6.2, over the rear half of the contact arc: the arc that the
    submerged leading triangles of the rim span at the wheel's centre, halved by angle.
    """
    nothing = (0.0, 0.0, 0.0, 0.0), 0.0
    axis = body[7], body[8], body[9]
    centre = body[10], body[11], body[12]
    spin = _dot(frame.omega, axis)
    along = _dot(frame.up, axis)
    level = np.sqrt(max(1.0 - along * along, 0.0))
    if spin == 0.0 or level < 1e-3:  # a wheel at rest, or lying on its side
        return nothing
    cross = _cross(axis, frame.up)
    sign = (1.0 if spin > 0.0 else -1.0) / level
    ahead = sign * cross[0], sign * cross[1], sign * cross[2]
    down = (
        (along * axis[0] - frame.up[0]) / level,
        (along * axis[1] - frame.up[1]) / level,
        (along * axis[2] - frame.up[2]) / level,
    )
    first, last, clear = 3.0, -3.0, False
    cx, cy, cz, nx, ny, nz, area = columns(body)
    planar = sand[1]
    for i in range(area.size):
        if i % BLOCK == 0:
            clear = block_is_clear(body, i // BLOCK, frame, 0.0)
        if clear:
            continue
        x, y, z = cx[i], cy[i], cz[i]
        depth = frame.height - (frame.up[0] * x + frame.up[1] * y + frame.up[2] * z)
        if depth <= 0.0 or abs(nx[i] * axis[0] + ny[i] * axis[1] + nz[i] * axis[2]) > 0.7:
            continue
        wv = _cross(frame.omega, (x, y, z))
        v = frame.v0[0] + wv[0], frame.v0[1] + wv[1], frame.v0[2] + wv[2]
        n = nx[i], ny[i], nz[i]
        if _dot(n, v) - planar * _dot(n, plane) * _dot(v, plane) <= 0.0:
            continue
        p = x - centre[0], y - centre[1], z - centre[2]
        angle = _diamond(_dot(p, ahead), _dot(p, down))
        first, last = min(first, angle), max(last, angle)
    if last < first:
        return nothing
    middle = 0.5 * (_angle(first) + _angle(last))
    s, c = np.sin(middle), np.cos(middle)
    onward = (
        c * ahead[0] - s * down[0],
        c * ahead[1] - s * down[1],
        c * ahead[2] - s * down[2],
    )
    radius = body[13]
    offset = body[0] * radius - _dot(onward, centre)  # rounding must not choose for a triangle on the middle
    return (onward[0], onward[1], onward[2], offset), radius * radius * spin * spin / sand[15]


@njit(forceinline=True)
def _diamond(s, c):
    """A number that grows with the angle atan2(s, c), in (-2, 2]; no trigonometry."""
    t = s / (abs(s) + abs(c) + kernels.TINY)
    if c >= 0.0:
        return t
    return 2.0 - t if s >= 0.0 else -2.0 - t


@njit(forceinline=True)
def _angle(t):
    """The angle whose _diamond is t."""
    c = 1.0 - abs(t)
    s = t if abs(t) <= 1.0 else (2.0 - t if t > 0.0 else -2.0 - t)
    return np.arctan2(s, c)
