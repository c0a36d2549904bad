"""Ruts as the laws feel them: the level of the sand that holds a face, and whether the sand is there at all.

What carries a face is the weight of the sand beside it, and not what lies just above it: in a continuum a foot that is
pressed into its own print again bears what it did the first time, though the print is half as deep as it was pressed.
So the depth counts from the mean level about the face, over twice as far as what presses is wide: a surface of
quadratic B-splines through the means of blocks of cells. And the face bears nothing where it does not reach what is
left of the sand before it, over a gap of half a cell.
"""

from collections import namedtuple
from typing import Final

import numpy as np

from rftsim.law.layout import BED, BLOCK_SIDE, PAD, RUTS, RUTS_NUMBERS
from rftsim.law.spline import Grid, no_grid, spline_over, values_of, width_of
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import exact, inline, inline_loop
from rftsim.machine.memory import doubles, peek
from rftsim.machine.records import record_at, values_at

GAP: Final = 0.5
"""Distance from the sand over which a face comes to bear [cells]."""
BEFORE: Final = 1.5
"""How far before a face the sand is that it must reach [cells]."""
MIDDLE: Final = 0.5 * (BLOCK_SIDE - 1)
"""Of a block, its middle from its first cell [cells]."""

ruts_at = record_at(RUTS)
"""The head of the ruts at an address."""
_Cells = namedtuple("_Cells", ["spacing", "rows", "columns"])
_cells_at = values_at(BED, _Cells)
Marks = namedtuple("Marks", ["spacing", "rows", "columns", "row", "column", "cells", "blocks"])
Marks.__doc__ = """Ruts in memory: side of a cell [m]; how many, int64; the first ones; the address of the cells; the
grid of the blocks' means, whose padding is zero."""


@inline
def marks_of(bed, ruts):
    """The ruts at an address, of the bed at another; of no cells where the address is zero."""
    size = _cells_at(bed)
    if ruts == 0:
        return Marks(1.0, 0, 0, 0, 0, 0, no_grid())
    head, rows, columns = ruts_at(ruts), int(size.rows), int(size.columns)
    row, column, cells = int(head.row), int(head.column), ruts + 8 * RUTS_NUMBERS
    x, y = (column + MIDDLE) * size.spacing, (row + MIDDLE) * size.spacing
    per, first = 1.0 / (BLOCK_SIDE * size.spacing), cells + 8 * rows * columns
    blocks = Grid(first, size.rows / BLOCK_SIDE, size.columns / BLOCK_SIDE, x, y, per, per, 0.0, 0.0)
    return Marks(size.spacing, rows, columns, row, column, cells, blocks)


@inline
def place_of(marks, row, column):
    """Where a cell that lies in the window is kept."""
    return (row & (marks.rows - 1)) * marks.columns + (column & (marks.columns - 1))


@inline
def _whole(x):
    """The whole number below a number; far away for what is none, or too large."""
    return int(np.floor(smaller(larger(-1e15, x), 1e15)))


@inline
def cell(x, spacing):
    """The row or column of cells that a coordinate lies in [m]; far away for what is none."""
    return _whole(x / spacing + 0.5)


@inline_loop
def along(x, spacing, first, count):
    """The pair of cells that is nearest to a coordinate [m], along an axis with so many cells from one on.

    Returns:
        The first of both, how far the coordinate lies beyond it [cells], and whether it lies between them (0 or 1).
    """
    u = x / spacing - first
    low = smaller(larger(0.0, np.floor(u)), count - 2.0)  # what is no number becomes one
    return low + first, u - low, 1.0 if (u >= low) & (u < low + 1.0) else 0.0


@inline
def four_cells(marks, row, column):
    """Heights over the free surface of a cell and of the next ones, along rows first [m], (4,)."""
    values = doubles(marks.cells, marks.rows * marks.columns)
    a, b = peek(values, place_of(marks, row, column)), peek(values, place_of(marks, row, column + 1))
    c, d = peek(values, place_of(marks, row + 1, column)), peek(values, place_of(marks, row + 1, column + 1))
    return a, b, c, d


@inline_loop
def between(four, f, g):
    """Height between four cells [m], so far from the first along columns and rows [cells], in proportion."""
    a, b, c, d = four
    return (1.0 - g) * ((1.0 - f) * a + f * b) + g * ((1.0 - f) * c + f * d)


@inline
def height(marks, x, y):
    """Height of the sand over the free surface at a place [m], between cells in proportion; none out of the window."""
    row, g, is_in = along(y, marks.spacing, marks.row, marks.rows)
    column, f, is_beside = along(x, marks.spacing, marks.column, marks.columns)
    return is_in * is_beside * between(four_cells(marks, int(row), int(column)), f, g) if marks.rows != 0 else 0.0


@inline
def block_place(marks, row, column):
    """Where the mean of the block of a cell that lies in the window is kept."""
    across, along = (row - marks.row) // BLOCK_SIDE, (column - marks.column) // BLOCK_SIDE
    return (across + PAD) * int(width_of(marks.blocks)) + along + PAD


@inline
def level(marks, x, y):
    """Mean level of the sand about a place over the free surface [m], and its slopes along x and y [-]."""
    return spline_over(marks.blocks, x, y)


@exact
def highest_level(marks, x, y, wide, long):
    """The highest that the mean level comes over the free surface about a rectangle, at most [m]; zero or more.

    Args:
        marks: The ruts.
        x: Its middle [m].
        y: Its middle [m].
        wide: Half its size along x [m].
        long: Half its size along y [m].
    """
    if marks.rows == 0:
        return 0.0
    grid, side, most = marks.blocks, BLOCK_SIDE * marks.spacing, 0.0
    values, width = values_of(grid), int(width_of(grid))
    first = max(_whole((y - long - grid.y) / side - 0.5), 0), max(_whole((x - wide - grid.x) / side - 0.5), 0)
    last = (
        min(_whole((y + long - grid.y) / side + 1.5), marks.rows // BLOCK_SIDE - 1),
        min(_whole((x + wide - grid.x) / side + 1.5), marks.columns // BLOCK_SIDE - 1),
    )
    for row in range(first[0], last[0] + 1):
        for column in range(first[1], last[1] + 1):
            most = max(most, peek(values, (row + PAD) * width + column + PAD))
    return most


@inline
def reaches(marks, above):
    """The share with which a face bears that lies so far above what is left of the sand [m]."""
    return smaller(larger(1.0 - above / (GAP * marks.spacing), 0.0), 1.0)
