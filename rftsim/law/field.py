"""A free surface that is no plane, in memory: its height and slopes over a place.

The surface is the bed's plane, or the terrain at the bed's offset, see `rftsim.sand.terrain`, and on it the ruts, see
`ruts`.
"""

from collections import namedtuple

import numpy as np

from rftsim.law import ruts
from rftsim.law.layout import BED, SAND, TERRAIN, TERRAIN_NUMBERS
from rftsim.law.spline import Grid, no_grid, spline_over
from rftsim.machine.compiling import inline, inline_loop
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
Field = namedtuple("Field", ["level", "grid", "marks", "is_planar"])
Field.__doc__ = """A relief in memory: the bed's plane; the terrain's grid; the ruts; and whether the law acts in a
plane of motion (0 or 1)."""


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
        return Field(level, no_grid(), marks, is_planar)
    h, first = _head_at(addresses.terrain), addresses.terrain + 8 * TERRAIN_NUMBERS
    again = h.repeat / h.rows, h.repeat / h.columns
    grid = Grid(first, h.rows, h.columns, h.x, h.y, 1.0 / h.dx, 1.0 / h.dy, again[0], again[1])
    return Field(level, grid, marks, is_planar)


@inline_loop
def level_at(field, x, y):
    """Height of the bed's plane over a place [m]."""
    return field.level.height + field.level.along * x + field.level.across * y


@inline_loop
def surface_over(field, x, y):
    """Height of the free surface without its ruts over a place [m], and its slopes along x and y [-]."""
    height, along, across = spline_over(field.grid, x, y)
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
