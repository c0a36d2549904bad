"""A free surface that is no plane, as faces feel it: how deep they lie below it, and which way is up there.

Depth is along the normal above a face, to first order in what the surface bends within that depth.
"""

from typing import Final

from numba import carray, types

from rftsim.law import ruts
from rftsim.law.field import level_at, next_three, normal_of, spline, start_of, surface_over
from rftsim.law.frame import over
from rftsim.law.layout import COLUMN, COLUMNS
from rftsim.law.vectors import cross, smaller, to_body, to_world
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.memory import doubles, on_stack, peek, poke

TILE: Final = 32
"""Faces that are looked for together in a terrain."""
ABOUT: Final = 12
"""Numbers that are kept meanwhile of each: the first coefficient's place, two distances, and nine coefficients."""
_scratch = on_stack(ABOUT * TILE, types.float64)
FOUND: Final = COLUMNS
"""First of four columns of a face where what is found is kept: depth, and the normal of the surface."""


@inline
def _rutted(field, n, place, above):
    """What a face feels of ruts: how much it bears, and the free surface above it, height [m] and slopes [-].

    Args:
        field: The relief.
        n: The face's outward normal, world frame, (3,).
        place: Its centre, world frame [m], (3,).
        above: Height of the free surface without ruts above it [m], and slopes along x and y [-].
    """
    (x, y, z), (height, along, across), cell = place, above, field.marks.spacing
    left = ruts.height(field.marks, x + ruts.BEFORE * cell * n[0], y + ruts.BEFORE * cell * n[1])
    share = ruts.reaches(field.marks, z - height - left)
    level, more_along, more_across = ruts.level(field.marks, x, y)
    return share, height + level, along + more_along, across + more_across


@inline_loop
def _felt(field, frame, centre, z, above, share):
    """Depth that a face feels [m], and the normal above it, body frame, (3,).

    Args:
        field: The relief.
        frame: The body's frame.
        centre: The face's centre, body frame [m], (3,).
        z: Its height in the world [m].
        above: Height of the free surface above it [m], and slopes along x and y [-].
        share: How much it bears.
    """
    height, along, across = above
    normal, m, (x, y, w) = normal_of(field, along, across), frame.moved, centre
    nx, ny, nz = to_body(frame.turn, normal[0], normal[1], normal[2])
    mx, my, mz = m[0] + m[4] * w - m[5] * y, m[1] + m[5] * x - m[3] * w, m[2] + m[3] * y - m[4] * x
    deep = (height - z) * normal[2] - (nx * mx + ny * my + nz * mz)
    return smaller(share * deep, deep) if share < 1.0 else deep, nx, ny, nz


@inline
def look(x, y, z, n, frame, field):
    """The depth that a face feels below the free surface [m], negative above it, and the normal there, body frame (3,).

    Whatever a wheel has made of the surface is left out.

    Args:
        x: The face's centre, body frame [m].
        y: The same.
        z: The same.
        n: Its outward normal, body frame, (3,).
        frame: The body's frame.
        field: The relief.
    """
    a, b, c = _in_world(frame, (x, y, z))
    height, along, across = surface_over(field, a, b)
    share = 1.0
    if field.marks.rows != 0:
        n_hat = to_world(frame.turn, n[0], n[1], n[2])
        share, height, along, across = _rutted(field, n_hat, (a, b, c), (height, along, across))
    return _felt(field, frame, (x, y, z), c, (height, along, across), share)


@inline_loop
def _in_world(frame, point):
    """A point of the body in the world frame [m], (3,)."""
    a, b, c = to_world(frame.turn, point[0], point[1], point[2])
    return a + frame.place[0], b + frame.place[1], c + frame.place[2]


@inline_loop
def settle(chosen, stride, n, frame, field):
    """The same for n faces, whose centres and normals, and what is found, lie in columns of a stride in an array.

    In loops one behind another, of which the compiler takes all but those that look into a grid for several faces at
    once.
    """
    scratch = carray(_scratch(), (TILE * ABOUT,))
    for first in range(0, n, TILE):
        some = min(TILE, n - first)
        is_one = field.first != 0 and _find(scratch, chosen, stride, first, some, frame, field)
        if field.first != 0 and not (is_one and field.marks.rows == 0):
            _gather(scratch, some, field)
        if field.marks.rows != 0:
            _settle_rutted(scratch, chosen, stride, first, some, frame, field)
        elif is_one:
            _settle_one(scratch, chosen, stride, first, some, frame, field)
        else:
            _settle_smooth(scratch, chosen, stride, first, some, frame, field)


@inline_loop
def _find(scratch, chosen, stride, start, n, frame, field):
    """Write where n faces from one on lie in the grid into a scratch; whether all have the same nine coefficients."""
    for i in range(n):
        x, y, _ = _in_world(frame, _three(chosen, stride, start + i, COLUMN.x))
        k, f, g = start_of(field.grid, x, y)
        poke(scratch, i, k)
        poke(scratch, i + TILE, f)
        poke(scratch, i + 2 * TILE, g)
    first, others = peek(scratch, 0), 0
    for i in range(n):
        others += 1 if peek(scratch, i) != first else 0
    return others == 0


@inline_loop
def _gather(scratch, n, field):
    """Copy the coefficients about each of n faces into the scratch."""
    values, width = doubles(field.first, field.grid.size), int(field.grid.width)
    for i in range(n):
        k = int(peek(scratch, i))
        for row in range(3):
            a, b, c = next_three(values, k + row * width)
            at = i + (3 + 3 * row) * TILE
            poke(scratch, at, a)
            poke(scratch, at + TILE, b)
            poke(scratch, at + 2 * TILE, c)


@inline_loop
def _over_found(scratch, i, rows, field):
    """Height of the terrain over the i-th face [m], and slopes [-], from coefficients."""
    f, g = peek(scratch, i + TILE), peek(scratch, i + 2 * TILE)
    height, along, across = spline(field.grid, rows[0], rows[1], rows[2], f, g)
    return height + field.level.height, along, across


@inline_loop
def _settle_one(scratch, chosen, stride, start, n, frame, field):
    """Find depth and normal for n faces from one on that have the same coefficients; there are no ruts."""
    values, width, k = doubles(field.first, field.grid.size), int(field.grid.width), int(peek(scratch, 0))
    rows = next_three(values, k), next_three(values, k + width), next_three(values, k + 2 * width)
    for i in range(n):
        centre = _three(chosen, stride, start + i, COLUMN.x)
        z = _in_world(frame, centre)[2]
        deep, nx, ny, nz = _felt(field, frame, centre, z, _over_found(scratch, i, rows, field), 1.0)
        _keep(chosen, stride, start + i, deep, nx, ny, nz)


@inline_loop
def _settle_smooth(scratch, chosen, stride, start, n, frame, field):
    """The same of faces whose coefficients have been gathered."""
    for i in range(n):
        centre = _three(chosen, stride, start + i, COLUMN.x)
        z = _in_world(frame, centre)[2]
        rows = _three(scratch, TILE, i, 3), _three(scratch, TILE, i, 6), _three(scratch, TILE, i, 9)
        deep, nx, ny, nz = _felt(field, frame, centre, z, _over_found(scratch, i, rows, field), 1.0)
        _keep(chosen, stride, start + i, deep, nx, ny, nz)


@inline_loop
def _settle_rutted(scratch, chosen, stride, start, n, frame, field):
    """The same where there are ruts."""
    for i in range(n):
        centre = _three(chosen, stride, start + i, COLUMN.x)
        x, y, z = _in_world(frame, centre)
        above = level_at(field, x, y), field.level.along, field.level.across
        if field.first != 0:
            rows = _three(scratch, TILE, i, 3), _three(scratch, TILE, i, 6), _three(scratch, TILE, i, 9)
            above = _over_found(scratch, i, rows, field)
        n_hat = _three(chosen, stride, start + i, COLUMN.nx)
        n_hat = to_world(frame.turn, n_hat[0], n_hat[1], n_hat[2])
        share, h, along, across = _rutted(field, n_hat, (x, y, z), above)
        deep, nx, ny, nz = _felt(field, frame, centre, z, (h, along, across), share)
        _keep(chosen, stride, start + i, deep, nx, ny, nz)


@inline
def _three(chosen, stride, i, column):
    """Numbers of the i-th face in three columns from one on."""
    at = i + column * stride
    return peek(chosen, at), peek(chosen, at + stride), peek(chosen, at + 2 * stride)


@inline
def _keep(chosen, stride, i, a, b, c, d):
    """Write four numbers of the i-th face behind its columns."""
    at = i + FOUND * stride
    poke(chosen, at, a)
    poke(chosen, at + stride, b)
    poke(chosen, at + 2 * stride, c)
    poke(chosen, at + 3 * stride, d)


@inline
def local(frame, up):
    """The frame over a place of a relief where that is up: the axis of the plane of motion lies along the surface."""
    return over(frame, up, up, cross(cross(frame.up, frame.forward), up), frame.height, frame.relief)
