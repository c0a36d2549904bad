"""A plane nowhere below a relief under a body, by which all of it that is clear of the sand is passed over."""

from typing import Final

import numpy as np

from rftsim.law import ruts
from rftsim.law.field import level_at, normal_of, surface_over
from rftsim.law.frame import over
from rftsim.law.layout import PAD
from rftsim.law.spline import values_of, width_of
from rftsim.law.vectors import cross, dot, larger, smaller, to_body, to_world
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import peek

NODES: Final = 16384
"""Coefficients below a body that are looked through for it; of more, all its triangles are looked at."""


@exact
def over_relief(frame, field, lowest, highest, reach):
    """The frame of a body over a relief, of which no point above the body's box, or within a reach of it, is higher.

    Args:
        frame: The frame over the plane of the bed.
        field: The relief.
        lowest: Lowest corner of the body's box [m], (3,).
        highest: Highest corner [m], (3,).
        reach: How far the body can move from where it is [m].
    """
    r = frame.turn
    x, y, z = (
        0.5 * (lowest[0] + highest[0]),
        0.5 * (lowest[1] + highest[1]),
        0.5 * (lowest[2] + highest[2]),
    )
    half = highest[0] - x, highest[1] - y, highest[2] - z
    a, b, _ = to_world(r, x, y, z)
    a, b = a + frame.place[0], b + frame.place[1]
    wide = abs(r[0]) * half[0] + abs(r[1]) * half[1] + abs(r[2]) * half[2] + reach
    long = abs(r[3]) * half[0] + abs(r[4]) * half[1] + abs(r[5]) * half[2] + reach
    height, along, across = surface_over(field, a, b)
    normal = normal_of(field, along, across)
    above = height + _most_above(field, (a, b), (wide, long), (along, across, height))
    above += ruts.highest_level(field.marks, a, b, wide, long)
    up = to_body(r, normal[0], normal[1], normal[2])
    rise = to_body(r, -along, -across, 1.0)
    plane = cross(frame.up, frame.forward)
    forward = cross(plane, up)
    length = 1.0 / np.sqrt(dot(forward, forward))
    forward = length * forward[0], length * forward[1], length * forward[2]
    bound = above + along * (frame.place[0] - a) + across * (frame.place[1] - b) - frame.place[2]
    return over(frame, up, rise, forward, bound, 1.0)


@exact
def _most_above(field, middle, half, tangent):
    """How far the relief comes above a plane over a rectangle, at most [m]; infinite where that is not looked for.

    No point of a surface of B-splines is above all its coefficients, and of a plane they lie on it.
    """
    grid, level = field.grid, field.level
    if grid.first == 0:
        return 0.0
    first_column = np.floor((middle[0] - half[0] - grid.x) * grid.per_x - 1.5)
    first_row = np.floor((middle[1] - half[1] - grid.y) * grid.per_y - 1.5)
    columns = np.ceil((middle[0] + half[0] - grid.x) * grid.per_x + 1.5) - first_column + 1.0
    rows = np.ceil((middle[1] + half[1] - grid.y) * grid.per_y + 1.5) - first_row + 1.0
    if not rows * columns <= NODES:
        return np.inf
    values, along, across = values_of(grid), tangent[0] - level.along, tangent[1] - level.across
    beside, step = level_at(field, middle[0], middle[1]) - tangent[2], along / grid.per_x
    is_whole = first_column >= -PAD and first_column + columns <= grid.columns + PAD
    most, x = -np.inf, grid.x + first_column / grid.per_x - middle[0]
    for k in range(int(rows)):
        row = first_row + k
        start = int(width_of(grid)) * _index(row, grid.rows, grid.per_row)
        at = beside - across * (grid.y + row / grid.per_y - middle[1]) - along * x
        if is_whole:
            most = max(most, at + _most_in_row(values, start + int(first_column) + PAD, int(columns), step))
        else:
            for i in range(int(columns)):
                value = peek(values, start + _index(first_column + i, grid.columns, grid.per_column))
                most = max(most, at + value - step * i)
    return most


@loop
def _most_in_row(values, start, count, step):
    """The largest of so many numbers, less a step more for each; four at a time, as each comparison waits for one."""
    a = b = c = d = peek(values, start)
    whole = count - count % 4
    for i in range(0, whole, 4):
        fallen = step * i
        a = larger(a, peek(values, start + i) - fallen)
        b = larger(b, peek(values, start + i + 1) - (fallen + step))
        c = larger(c, peek(values, start + i + 2) - (fallen + 2.0 * step))
        d = larger(d, peek(values, start + i + 3) - (fallen + 3.0 * step))
    for i in range(whole, count):
        a = larger(a, peek(values, start + i) - step * i)
    return larger(larger(a, b), larger(c, d))


@inline
def _index(node, count, per_count):
    """The place of a coefficient among the padded ones along an axis; those beyond have the last one's value."""
    node -= count * np.floor((node + 0.5) * per_count)
    return int(smaller(larger(-float(PAD), node), count + (PAD - 1.0))) + PAD
