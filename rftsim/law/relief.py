"""A free surface that is no plane, as faces feel it: how deep they lie below it, and which way is up there.

Depth is along the normal above a face, to first order in what the surface bends within that depth.
"""

from typing import Final

from numba import carray, types

from rftsim.law import ruts
from rftsim.law.field import level_at, normal_of, surface_over
from rftsim.law.frame import over
from rftsim.law.layout import COLUMN, COLUMNS
from rftsim.law.spline import nine_from, spline, start_of, values_of, width_of
from rftsim.law.vectors import cross, smaller, to_body, to_world
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.memory import on_stack, peek, poke

TILE: Final = 32
"""Faces that are looked for together in a terrain."""
ABOUT: Final = 12
"""Numbers that are kept meanwhile of each: the first coefficient's place, two distances, and nine coefficients."""
_scratch = on_stack(ABOUT * TILE, types.float64)
FOUND: Final = COLUMNS
"""First of four columns of a face where what is found is kept: depth, and the normal of the surface. Meanwhile, where
there are ruts: height of the surface [m], its slopes along x and y [-], and how much the face bears."""


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
    scratch, grid = carray(_scratch(), (TILE * ABOUT,)), field.grid
    for first in range(0, n, TILE):
        some = min(TILE, n - first)
        if field.marks.rows != 0:
            _settle_rutted(scratch, chosen, stride, first, some, frame, field)
        elif _find(scratch, chosen, stride, first, some, frame, grid):
            _settle_one(scratch, chosen, stride, first, some, frame, field)
        else:
            _gather(scratch, some, grid)
            _settle_smooth(scratch, chosen, stride, first, some, frame, field)


@inline_loop
def _find(scratch, chosen, stride, start, n, frame, grid):
    """Write where n faces from one on lie in a grid into a scratch; whether all have the same nine coefficients."""
    for i in range(n):
        x, y, _ = _in_world(frame, _three(chosen, stride, start + i, COLUMN.x))
        k, f, g = start_of(grid, x, y)
        poke(scratch, i, k)
        poke(scratch, i + TILE, f)
        poke(scratch, i + 2 * TILE, g)
    first, others = peek(scratch, 0), 0
    for i in range(n):
        others += 1 if peek(scratch, i) != first else 0
    return others == 0


@inline_loop
def _gather(scratch, n, grid):
    """Copy the coefficients about each of n faces into the scratch."""
    values, width = values_of(grid), int(width_of(grid))
    for i in range(n):
        rows = nine_from(values, int(peek(scratch, i)), width)
        for row in range(3):
            _poke_three(scratch, TILE, i, 3 + 3 * row, rows[row])


@inline_loop
def _over_found(scratch, i, rows, grid):
    """Height over the i-th face [m], and slopes [-], from coefficients."""
    return spline(grid, rows, peek(scratch, i + TILE), peek(scratch, i + 2 * TILE))


@inline_loop
def _gathered(scratch, i):
    """The coefficients of the i-th face."""
    return _three(scratch, TILE, i, 3), _three(scratch, TILE, i, 6), _three(scratch, TILE, i, 9)


@inline_loop
def _settle_one(scratch, chosen, stride, start, n, frame, field):
    """Find depth and normal for n faces from one on that have the same coefficients; there are no ruts."""
    grid = field.grid
    rows = nine_from(values_of(grid), int(peek(scratch, 0)), int(width_of(grid)))
    for i in range(n):
        _settle_face(chosen, stride, start + i, _over_found(scratch, i, rows, grid), frame, field)


@inline_loop
def _settle_smooth(scratch, chosen, stride, start, n, frame, field):
    """The same of faces whose coefficients have been gathered."""
    for i in range(n):
        above = _over_found(scratch, i, _gathered(scratch, i), field.grid)
        _settle_face(chosen, stride, start + i, above, frame, field)


@inline_loop
def _settle_face(chosen, stride, i, above, frame, field):
    """Keep depth and normal of the i-th face, from height [m] and slopes [-] of the terrain above it."""
    centre, (height, along, across) = _three(chosen, stride, i, COLUMN.x), above
    above = height + field.level.height, along, across
    _keep(chosen, stride, i, _felt(field, frame, centre, _in_world(frame, centre)[2], above, 1.0))


@inline_loop
def _settle_rutted(scratch, chosen, stride, start, n, frame, field):
    """Find depth and normal for n faces from one on where there are ruts."""
    for i in range(start, start + n):
        x, y, _ = _in_world(frame, _three(chosen, stride, i, COLUMN.x))
        _keep(chosen, stride, i, (level_at(field, x, y), field.level.along, field.level.across, 1.0))
    if field.grid.first != 0:
        _add_over(scratch, chosen, stride, start, n, frame, field.grid)
    _bear(scratch, chosen, stride, start, n, frame, field.marks)
    _add_over(scratch, chosen, stride, start, n, frame, field.marks.blocks)
    for i in range(start, start + n):
        centre, above = _three(chosen, stride, i, COLUMN.x), _three(chosen, stride, i, FOUND)
        share = peek(chosen, i + (FOUND + 3) * stride)
        _keep(chosen, stride, i, _felt(field, frame, centre, _in_world(frame, centre)[2], above, share))


@inline_loop
def _add_over(scratch, chosen, stride, start, n, frame, grid):
    """Add what a grid adds to the height and slopes of the surface above n faces from one on."""
    _find(scratch, chosen, stride, start, n, frame, grid)
    _gather(scratch, n, grid)
    for i in range(n):
        at, (height, along, across) = start + i, _over_found(scratch, i, _gathered(scratch, i), grid)
        h, a, b = _three(chosen, stride, at, FOUND)
        _poke_three(chosen, stride, at, FOUND, (h + height, a + along, b + across))


@inline_loop
def _bear(scratch, chosen, stride, start, n, frame, marks):
    """Keep how much n faces from one on bear, see `ruts`; kept is the height of the surface without ruts."""
    for i in range(n):
        x, y, _ = _in_world(frame, _three(chosen, stride, start + i, COLUMN.x))
        normal = _three(chosen, stride, start + i, COLUMN.nx)
        nx, ny, _ = to_world(frame.turn, normal[0], normal[1], normal[2])
        ahead = ruts.BEFORE * marks.spacing
        row, g, is_in = ruts.along(y + ahead * ny, marks.spacing, marks.row, marks.rows)
        column, f, is_beside = ruts.along(x + ahead * nx, marks.spacing, marks.column, marks.columns)
        _poke_three(scratch, TILE, i, 0, (row, column, is_in * is_beside))
        poke(scratch, i + 3 * TILE, f)
        poke(scratch, i + 4 * TILE, g)
    for i in range(n):
        a, b, c, d = ruts.four_cells(marks, int(peek(scratch, i)), int(peek(scratch, i + TILE)))
        _poke_three(scratch, TILE, i, 5, (a, b, c))
        poke(scratch, i + 8 * TILE, d)
    for i in range(n):
        at, four = start + i, (*_three(scratch, TILE, i, 5), peek(scratch, i + 8 * TILE))
        left = ruts.between(four, peek(scratch, i + 3 * TILE), peek(scratch, i + 4 * TILE))
        _, _, z = _in_world(frame, _three(chosen, stride, at, COLUMN.x))
        above = z - peek(chosen, at + FOUND * stride) - peek(scratch, i + 2 * TILE) * left
        poke(chosen, at + (FOUND + 3) * stride, ruts.reaches(marks, above))


@inline
def _three(chosen, stride, i, column):
    """Numbers of the i-th face in three columns from one on."""
    at = i + column * stride
    return peek(chosen, at), peek(chosen, at + stride), peek(chosen, at + 2 * stride)


@inline
def _poke_three(array, stride, i, column, numbers):
    """Write numbers of the i-th face in three columns from one on."""
    at, (a, b, c) = i + column * stride, numbers
    poke(array, at, a)
    poke(array, at + stride, b)
    poke(array, at + 2 * stride, c)


@inline
def _keep(chosen, stride, i, found):
    """Write four numbers of the i-th face behind its columns."""
    a, b, c, d = found
    _poke_three(chosen, stride, i, FOUND, (a, b, c))
    poke(chosen, i + (FOUND + 3) * stride, d)


@inline
def local(frame, up):
    """The frame over a place of a relief where that is up: the axis of the plane of motion lies along the surface."""
    return over(frame, up, up, cross(cross(frame.up, frame.forward), up), frame.height, frame.relief)
