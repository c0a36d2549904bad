"""A free surface that is no plane, in memory: its height and slopes over a place.

The surface is the bed's plane, or the terrain at the bed's offset, see `rftsim.sand.terrain`, and on it the ruts, see
`ruts`.
"""

from collections import namedtuple

import numpy as np

from rftsim.law import ruts
from rftsim.law.layout import BED, PAD, SAND, TERRAIN, TERRAIN_NUMBERS
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.memory import doubles, peek
from rftsim.machine.records import record_at, values_at

sand_at = record_at(SAND)
"""The addresses of a sand's numbers, at an address."""
terrain_at = record_at(TERRAIN)
"""The head of the packed terrain at an address."""
Head = namedtuple("Head", TERRAIN.names)  # type: ignore[misc, arg-type]
Plane = namedtuple("Plane", ["up", "offset", "plane"])
Level = namedtuple("Level", ["height", "along", "across", "plane"])
Level.__doc__ = """The bed's plane: its height at the origin [m], its slopes along x and y [-], and the normal of the
plane of motion of a planar law."""
_head_at, _plane_at = values_at(TERRAIN, Head), values_at(BED, Plane)
Field = namedtuple("Field", ["level", "grid", "first", "marks", "is_planar"])
Field.__doc__ = """A relief in memory: the bed's plane; the terrain's grid, and its first coefficient's address, zero
where it has none; the ruts; and whether the law acts in a plane of motion (0 or 1)."""
Grid = namedtuple("Grid", ["rows", "columns", "x", "y", "per_x", "per_y", "per_row", "per_column", "width", "size"])
Grid.__doc__ = """A terrain's grid: its head, with values per metre for the spacing, and one over the numbers of rows
and of columns after which it repeats, zero where it does not; the padded coefficients' number in a row, and in all,
int64."""


@inline
def is_relief(sand):
    """Whether a sand's free surface is no plane."""
    return (sand_at(sand).terrain != 0) | (sand_at(sand).ruts != 0)


@inline
def field_of(sand, is_planar):
    """The relief of a sand, for a law that acts in a plane of motion, or not."""
    addresses = sand_at(sand)
    plane, marks = _plane_at(addresses.bed), ruts.marks_of(addresses.bed, addresses.ruts)
    u = plane.up
    level = Level(plane.offset / u[2], -u[0] / u[2], -u[1] / u[2], plane.plane)
    if addresses.terrain != 0:
        level = Level(plane.offset, 0.0, 0.0, plane.plane)
    if addresses.terrain == 0:
        return Field(level, Grid(2.0, 2.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0 + 2.0 * PAD, 0), 0, marks, is_planar)
    h = _head_at(addresses.terrain)
    width, height = h.columns + 2.0 * PAD, h.rows + 2.0 * PAD
    again = h.repeat / h.rows, h.repeat / h.columns
    grid = Grid(
        h.rows, h.columns, h.x, h.y, 1.0 / h.dx, 1.0 / h.dy, again[0], again[1], width, int(width * height)
    )  # fmt: skip
    return Field(level, grid, addresses.terrain + 8 * TERRAIN_NUMBERS, marks, is_planar)


@inline_loop
def _place(t, count, per_count):
    """Of a place in spacings: the first of three padded coefficients, and how far it lies from the middle one."""
    t -= count * np.floor(t * per_count)
    t = smaller(larger(-2.0, t), count + 1.0)  # what is no number becomes one
    nearest = np.floor(t + 0.5)
    return nearest + (PAD - 1.0), t - nearest


@inline_loop
def start_of(grid, x, y):
    """The first of the nine coefficients about a place, and how far it lies from the middle one along x and y."""
    column, f = _place((x - grid.x) * grid.per_x, grid.columns, grid.per_column)
    row, g = _place((y - grid.y) * grid.per_y, grid.rows, grid.per_row)
    return row * grid.width + column, f, g


@inline_loop
def spline(grid, first, second, third, f, g):
    """Height of the terrain over a place [m], and its slopes along x and y [-].

    Args:
        grid: The terrain's grid.
        first: Coefficients of a row about it, (3,).
        second: Those of the next row.
        third: Those of the last row.
        f: How far the place lies from the middle one along x [spacings].
        g: The same along y.
    """
    a0, a1, a2 = 0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)
    b0, b1, b2 = f - 0.5, -2.0 * f, f + 0.5
    c0, c1, c2 = 0.5 * (0.5 - g) * (0.5 - g), 0.75 - g * g, 0.5 * (0.5 + g) * (0.5 + g)
    (p0, p1, p2), (q0, q1, q2), (r0, r1, r2) = first, second, third
    p, q, r = a0 * p0 + a1 * p1 + a2 * p2, a0 * q0 + a1 * q1 + a2 * q2, a0 * r0 + a1 * r1 + a2 * r2
    s, t, u = b0 * p0 + b1 * p1 + b2 * p2, b0 * q0 + b1 * q1 + b2 * q2, b0 * r0 + b1 * r1 + b2 * r2
    height = c0 * p + c1 * q + c2 * r
    along = (c0 * s + c1 * t + c2 * u) * grid.per_x
    across = ((g - 0.5) * p - 2.0 * g * q + (g + 0.5) * r) * grid.per_y
    return height, along, across


@inline
def next_three(values, k):
    """Three numbers of an array from a place on."""
    return peek(values, k), peek(values, k + 1), peek(values, k + 2)


@inline_loop
def level_at(field, x, y):
    """Height of the bed's plane over a place [m]."""
    return field.level.height + field.level.along * x + field.level.across * y


@inline_loop
def surface_over(field, x, y):
    """Height of the free surface without its ruts over a place [m], and its slopes along x and y [-]."""
    grid, height, along, across = field.grid, 0.0, 0.0, 0.0
    if field.first != 0:
        values, (start, f, g) = doubles(field.first, grid.size), start_of(grid, x, y)
        k, width = int(start), int(grid.width)
        rows = next_three(values, k), next_three(values, k + width), next_three(values, k + 2 * width)
        height, along, across = spline(grid, rows[0], rows[1], rows[2], f, g)
    return height + level_at(field, x, y), along + field.level.along, across + field.level.across


@inline_loop
def normal_of(field, along, across):
    """The upward unit normal of a surface of slopes along x and y [-], (3,), world frame.

    A planar law sees the surface's section along its plane of motion.
    """
    p = field.level.plane
    if field.is_planar:
        aside = along * p[0] + across * p[1]
        along -= aside * p[0]
        across -= aside * p[1]
    upward = 1.0 / np.sqrt(1.0 + along * along + across * across)
    return -along * upward, -across * upward, upward
