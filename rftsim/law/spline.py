"""Quadratic B-splines on a grid, as they lie in memory: a terrain's heights, and the mean level of ruts."""

from collections import namedtuple

import numpy as np

from rftsim.law.layout import PAD
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.memory import doubles, peek

Grid = namedtuple("Grid", ["first", "rows", "columns", "x", "y", "per_x", "per_y", "per_row", "per_column"])
Grid.__doc__ = """Padded coefficients: the address of the first, zero where there are none; how many there are along y
and x, less the PAD on each side; place of the first that is no padding [m]; values per metre; one over the numbers of
rows and of columns after which they repeat, zero where they do not."""


@inline
def no_grid():
    """The grid of a surface that has none."""
    return Grid(0, 2.0, 2.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)


@inline_loop
def width_of(grid):
    """The number of padded coefficients in a row."""
    return grid.columns + 2.0 * PAD


@inline
def values_of(grid):
    """All padded coefficients, row by row."""
    return doubles(grid.first, int(width_of(grid) * (grid.rows + 2.0 * PAD)))


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
    return row * width_of(grid) + column, f, g


@inline_loop
def spline(grid, rows, f, g):
    """Height over a place [m], and slopes along x and y [-].

    Args:
        grid: The grid.
        rows: The nine coefficients about it, row by row, (3, 3).
        f: How far the place lies from the middle one along x [spacings].
        g: The same along y.
    """
    a0, a1, a2 = 0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)
    b0, b1, b2 = f - 0.5, -2.0 * f, f + 0.5
    c0, c1, c2 = 0.5 * (0.5 - g) * (0.5 - g), 0.75 - g * g, 0.5 * (0.5 + g) * (0.5 + g)
    (p0, p1, p2), (q0, q1, q2), (r0, r1, r2) = rows
    p, q, r = a0 * p0 + a1 * p1 + a2 * p2, a0 * q0 + a1 * q1 + a2 * q2, a0 * r0 + a1 * r1 + a2 * r2
    s, t, u = b0 * p0 + b1 * p1 + b2 * p2, b0 * q0 + b1 * q1 + b2 * q2, b0 * r0 + b1 * r1 + b2 * r2
    height = c0 * p + c1 * q + c2 * r
    along = (c0 * s + c1 * t + c2 * u) * grid.per_x
    across = ((g - 0.5) * p - 2.0 * g * q + (g + 0.5) * r) * grid.per_y
    return height, along, across


@inline
def nine_from(values, k, width):
    """The nine coefficients of which the first stands at a place, row by row, (3, 3)."""
    return _three(values, k), _three(values, k + width), _three(values, k + 2 * width)


@inline
def _three(values, k):
    return peek(values, k), peek(values, k + 1), peek(values, k + 2)


@inline_loop
def spline_over(grid, x, y):
    """Height over a place [m], and slopes along x and y [-]; nothing where there is no grid."""
    if grid.first == 0:
        return 0.0, 0.0, 0.0
    start, f, g = start_of(grid, x, y)
    return spline(grid, nine_from(values_of(grid), int(start), int(width_of(grid))), f, g)
