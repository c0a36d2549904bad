"""Sand and surface as plain arrays of numbers, with names for what is where.

This is the form in which MuJoCo's models carry them (custom numeric fields), so that copies, pickles, attachment and
per-simulation values all come with the model. The dtypes here are the only place that knows the order; NumPy and
compiled code read by them.
"""

from collections import namedtuple
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import SandError
from rftsim.law import tables
from rftsim.law.laws import RESPONSES, Law
from rftsim.machine.kernel import exact_kernel
from rftsim.sand import ruts
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import PARAMETERS, Sand
from rftsim.sand.ruts import Ruts
from rftsim.sand.terrain import PAD as PAD
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array, Surface

TERMS: Final = len(tables.TABLE_C4)
"""Coefficients of each of f1, f2 and f3."""
_MEDIUM: Final = [("dynamic", "f8"), *((name, "f8") for name in PARAMETERS), ("table", "f8", (3, TERMS))]

BED: Final = np.dtype(
    [
        *(("response", "f8"), ("up", "f8", 3), ("offset", "f8"), ("plane", "f8", 3), ("relief", "f8")),
        *(("spacing", "f8"), ("rows", "f8"), ("columns", "f8")),
        *(("tolerance", "f8"), ("iterations", "f8")),
        *_MEDIUM,
    ]
)
"""Packed sand: its law's place in RESPONSES, normal and offset of the free surface, normal of the plane of motion,
whether a terrain lies on that free surface (0 or 1); side of a cell of ruts [m] and how many of them there are along y
and x, zero where the sand remembers nothing; tolerance and most iterations of the implicit force, whether the law is
dynamic (0 or 1), the parameters (zero where unknown), and the coefficients of f1, f2 and f3."""
TOLERANCE: Final = 3e-3
"""Error of a body's velocity, relative, to which the implicit force is solved for unless the user says otherwise."""
ITERATIONS: Final = 40
"""Most iterations of one solution, unless the user says otherwise."""

SAND: Final = np.dtype([("bed", "i8"), ("terrain", "i8"), ("ruts", "i8")])
"""What compiled code is told of a sand: addresses, of its BED, and of a TERRAIN and of RUTS, zero where it has none."""
RUTS: Final = np.dtype(
    [
        *((name, "f8") for name in ("row", "column", "clock", "moved", "left")),
    ]
)
"""The head of the ruts that a simulation remembers, all zero where there are none: row and column of the window's first
cell, counted from the world's origin; the time since sand slid [s]; volume that was displaced and that was left behind
the window [m^3]. Then for each cell the height over the free surface [m], whose place is its row and column modulo
those of the window; for each block of BLOCK_SIDE x BLOCK_SIDE their mean, with PAD zeros around all; and for each body
a record of TRACE."""
TRACE: Final = np.dtype([("travel", "f8"), ("rising", "f8"), ("unsettled", "f8", 4)])
"""What the ruts remember of a body: the way that it has gone since its marks were made [m]; whether it rises (0 or 1);
first row and column of what still slides about it, and those behind it."""
BLOCK_SIDE: Final = ruts.BLOCK
TERRAIN: Final = np.dtype(
    [(name, "f8") for name in ("rows", "columns", "x", "y", "dx", "dy", "repeat")],
)
"""The head of a packed terrain, which lies on the plane of its bed: number of its values along y and x; place of the
first and spacing along x and y [m]; whether it repeats (0 or 1). Its coefficients follow, see
`Terrain.coefficients`."""

Medium = namedtuple("Medium", [name for name, *_ in _MEDIUM])  # type: ignore[misc]
Medium.__doc__ = "The sand as a law reads it: fields of BED, which compiled loops keep in registers."

HEADER: Final = np.dtype(
    [
        ("edge_on", "f8"),
        ("lowest", "f8", 3),
        ("highest", "f8", 3),
        ("wheel_axis", "f8", 3),
        ("wheel_centre", "f8", 3),
        ("wheel_radius", "f8"),
        ("ntri", "f8"),
        ("gyration", "f8"),
        ("rim_start", "f8", 3),
        ("made_from", "f8"),
        ("gravity", "f8", 3),
        ("prints", "f8"),
    ]
)
"""The head of a packed surface: leading-edge tolerance; lowest and highest corner [m]; axis, centre [m] and radius
[m] of a wheel, zero where it is none; number of triangles; their root-mean-square distance from the origin [m]; the
direction at which the wheel's angles start; what the surface was made from, and under which gravity [m/s^2], see
`rftsim.model.stale`, zero where that is not known; number of points by which it marks the sand."""


class Columns(NamedTuple):
    """Numbers per triangle, each a column."""

    x: int
    y: int
    z: int
    nx: int
    ny: int
    nz: int
    area: int


COLUMN: Final = Columns(*range(len(Columns._fields)))
"""Which column holds what: centre [m], outward normal, area [m^2]."""


class Pressed(NamedTuple):
    """Numbers per triangle that the sand presses on, each a column."""

    x: int
    y: int
    z: int
    nx: int
    ny: int
    nz: int
    force: int


PRESSED: Final = Pressed(*range(len(Pressed._fields)))
"""Which column holds what: centre [m], outward normal, the sand's force against it [N]; body frame."""
BLOCK: Final = 32
"""Triangles that are passed over together where the box of their centroids lies above the sand; the boxes stand behind
the columns."""
BOX: Final = np.dtype([("centre", "f8", 3), ("half", "f8", 3)])
"""A box: its centre, and half its size [m], in the body frame."""
RIM: Final = 0.7
"""A wheel's triangle is of its rim where its normal is no nearer to the axis than by this cosine."""
NO_RIM: Final = 9.0
"""Instead of the angle about the axis, of a wheel's other triangles. Behind its boxes stand each triangle's."""

WRENCH: Final = 6
"""Numbers of a wrench: force, then moment about the body's origin; in memory always in the world frame."""
MOST_SIDE: Final = ruts.SIDES[1]
"""Most cells along a side of the window of ruts."""
GIVEN: Final = repr((BED.descr, PAD, BLOCK_SIDE, MOST_SIDE))
"""All that machine code of the laws is made from beside its sources: the sand's parameters, sizes of its surface."""


def numbers_in(dtype: "np.dtype[Any]") -> int:
    """How many float64 a record of a dtype holds."""
    return dtype.itemsize // 8


def record(numbers: Array, dtype: "np.dtype[Any]") -> Any:
    """The record that an array of numbers starts with; its fields are views, so writing one writes the array."""
    return numbers[: numbers_in(dtype)].view(np.dtype((np.record, dtype)))[0]


def pack_bed(
    sand: Sand,
    law: Law,
    terrain: FreeSurface | Terrain,
    plane: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    iterations: int = ITERATIONS,
) -> Array:
    """Sand under a law as numbers: a record of BED, and a packed terrain where its surface is no plane.

    Args:
        sand: The medium.
        law: The law of its force.
        terrain: The surface that bounds it from above.
        plane: Normal of the plane of motion of a planar law.
        tolerance: Error of a body's velocity, relative, to which the implicit force is solved for.
        iterations: Most iterations of one such solution.

    Raises:
        SandError: The law reads a parameter that is unknown of the sand, or is not one of LAWS nor made from one.
        ValueError: The plane's normal is not horizontal.
    """
    level = FreeSurface() if isinstance(terrain, Terrain) else terrain
    up = np.array(level.normal)
    normal = np.asarray(plane, dtype=float)
    length = np.linalg.norm(normal)
    if normal.shape != (3,) or not length > 0.0 or (law.planar and abs(normal @ up) > 1e-6 * length):
        raise ValueError(f"the normal of the plane of motion must be horizontal, as (0, 1, 0) is, not {plane!r}")
    if law.response not in RESPONSES:
        raise SandError(f"no machine code was made for the law {law.name}: add it to LAWS, and `make native`")
    unknown = [name for name in law.reads if getattr(sand, name) is None]
    if "rho_c" in unknown:
        sand.density()
    if unknown:
        raise SandError(f"the law {law.name} needs the sand's {unknown[0]}: give it")
    numbers = np.zeros(numbers_in(BED))
    bed = record(numbers, BED)
    bed.response, bed.dynamic = RESPONSES.index(law.response), law.dynamic
    bed.up, bed.offset, bed.plane = up, level.offset, normal / length
    bed.tolerance, bed.iterations, bed.relief = tolerance, iterations, isinstance(terrain, Terrain)
    for name in PARAMETERS:
        value = getattr(sand, name)
        bed[name] = 0.0 if value is None else value  # MuJoCo reads no NaN from XML
    for row, column in zip(bed.table, tables.columns(law.table), strict=True):
        row[: len(column)] = column
    return np.concatenate([numbers, pack_terrain(terrain)]) if isinstance(terrain, Terrain) else numbers


def remember(bed: Array, marks: Ruts) -> None:
    """Write into packed sand that it remembers ruts, and how large their cells and their window are.

    Raises:
        SandError: The sand's internal friction is unknown, whose angle is that at which heaps come to rest.
    """
    packed = record(bed, BED)
    if packed.mu_int == 0.0:
        raise SandError("sand that remembers needs the sand's mu_int, the tangent of the angle of its heaps: give it")
    packed.spacing, (packed.columns, packed.rows) = marks.spacing, marks.cells


def pack_terrain(terrain: Terrain) -> Array:
    """A terrain as numbers: a record of TERRAIN, then its coefficients row by row."""
    head = np.zeros(numbers_in(TERRAIN))
    packed = record(head, TERRAIN)
    packed.rows, packed.columns = terrain.heights.shape
    packed.x, packed.y = terrain.origin
    packed.dx, packed.dy = terrain.spacing
    packed.repeat = terrain.repeat
    return np.concatenate([head, terrain.coefficients.ravel()])


def pack_surface(surface: Surface, prints: Array | None = None) -> Array:
    """A surface as numbers: a record of HEADER, a column for each of COLUMN, boxes, a wheel's angles, and its prints.

    Args:
        surface: The triangles.
        prints: Points by which it marks sand that remembers, body frame, (n, 3): three columns, then their boxes.
    """
    points = np.concatenate([surface.corners, surface.centres])
    numbers = np.zeros(numbers_in(HEADER))
    header = record(numbers, HEADER)
    header.edge_on, header.ntri = surface.edge_on, surface.ntri
    header.lowest, header.highest = points.min(axis=0), points.max(axis=0)
    header.gyration = np.sqrt((surface.centres**2).sum(axis=1).mean())
    angles = np.empty(0)
    if surface.wheel is not None:
        header.wheel_axis, header.wheel_centre = surface.wheel.axis, surface.wheel.centre
        header.wheel_radius = surface.wheel.radius
        header.rim_start, angles = _rim_angles(surface, header)
    columns = *surface.centres.T, *surface.normals.T, surface.areas
    marks = np.empty((0, 3)) if prints is None else prints
    header.prints = len(marks)
    marking = (*marks.T, _boxes(marks).ravel()) if len(marks) else ()
    return np.concatenate([numbers, *columns, _boxes(surface.centres).ravel(), angles, *marking])


def _rim_angles(surface: Surface, header: Any) -> tuple[Array, Array]:
    """The direction at which angles about the wheel's axis start, (3,), and each triangle's [rad], (ntri,)."""
    axis = header.wheel_axis
    start = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    start = start / np.linalg.norm(start)
    arm = surface.centres - header.wheel_centre
    angles: Array = np.arctan2(arm @ np.cross(axis, start), arm @ start)
    return start, np.where(np.abs(surface.normals @ axis) <= RIM, angles, NO_RIM)


def _boxes(points: Array) -> Array:
    """Boxes of each BLOCK of points, or triangles' centroids, numbers of BOX, (nblock, 6)."""
    starts = np.arange(0, len(points), BLOCK)
    low, high = (end.reduceat(points, starts, axis=0) for end in (np.minimum, np.maximum))
    return np.hstack([low + high, high - low]) / 2


BED_NUMBERS: Final = numbers_in(BED)
TERRAIN_NUMBERS: Final = numbers_in(TERRAIN)
RUTS_NUMBERS: Final = numbers_in(RUTS)
TRACE_NUMBERS: Final = numbers_in(TRACE)
HEADER_NUMBERS: Final = numbers_in(HEADER)
BOX_NUMBERS: Final = numbers_in(BOX)
COLUMNS: Final = len(COLUMN)


@exact_kernel
def terrain_size(head: Any) -> Any:
    """The number of numbers of the packed terrain that starts with a head."""
    return TERRAIN_NUMBERS + (int(head.rows) + 2 * PAD) * (int(head.columns) + 2 * PAD)


@exact_kernel
def prints_start(header: Any) -> Any:
    """The number of numbers of a packed surface before its prints."""
    n = int(header.ntri)
    boxes = (n + BLOCK - 1) // BLOCK
    return HEADER_NUMBERS + COLUMNS * n + BOX_NUMBERS * boxes + (n if header.wheel_radius != 0.0 else 0)


@exact_kernel
def packed_size(header: Any) -> Any:
    """The number of numbers of the packed surface that starts with a header."""
    n = int(header.prints)
    return prints_start(header) + 3 * n + BOX_NUMBERS * ((n + BLOCK - 1) // BLOCK)


@exact_kernel
def ruts_size(bed: Any) -> Any:
    """The number of numbers that a simulation remembers of a bed's ruts, beside what it does of bodies."""
    rows, columns = int(bed.rows), int(bed.columns)
    blocks = (rows // BLOCK_SIDE + 2 * PAD) * (columns // BLOCK_SIDE + 2 * PAD)
    return 0 if rows * columns == 0 else RUTS_NUMBERS + rows * columns + blocks


def read_columns(packed: Array) -> tuple[Array, ...]:
    """The columns of a packed surface, in the order of COLUMN; views, each of shape (ntri,)."""
    n, start = int(record(packed, HEADER).ntri), HEADER_NUMBERS
    return tuple(packed[start + k * n : start + (k + 1) * n] for k in COLUMN)


def extent(packed: Array) -> float:
    """The largest extent of a packed surface along an axis of its frame [m]."""
    header = record(packed, HEADER)
    return float((header.highest - header.lowest).max())
