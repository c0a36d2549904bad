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

from rftsim.law.layout import BED, BLOCK_SIDE, RUTS, RUTS_NUMBERS
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import exact, inline
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
Marks.__doc__ = (
    """Ruts in memory: side of a cell [m]; how many, int64; the first ones; addresses of cells and blocks."""
)


@inline
def marks_of(bed, ruts):
    """The ruts at an address, of the bed at another; of no cells where the address is zero."""
    size = _cells_at(bed)
    if ruts == 0:
        return Marks(1.0, 0, 0, 0, 0, 0, 0)
    head, rows, columns = ruts_at(ruts), int(size.rows), int(size.columns)
    cells = ruts + 8 * RUTS_NUMBERS
    return Marks(
        size.spacing, rows, columns, int(head.row), int(head.column), cells, cells + 8 * rows * columns
    )  # fmt: skip


@inline
def place_of(marks, row, column):
    """Where a cell that lies in the window is kept."""
    return (row & (marks.rows - 1)) * marks.columns + (column & (marks.columns - 1))


@inline
def _is_inside(marks, row, column, more):
    """Whether a cell lies in the window, and so many beyond it."""
    r, c = row - marks.row, column - marks.column
    return (r >= 0) & (c >= 0) & (r + more < marks.rows) & (c + more < marks.columns)


@inline
def _whole(x):
    """The whole number below a number; far away for what is none, or too large."""
    return int(np.floor(smaller(larger(-1e15, x), 1e15)))


@inline
def cell(x, spacing):
    """The row or column of cells that a coordinate lies in [m]; far away for what is none."""
    return _whole(x / spacing + 0.5)


@inline
def height(marks, x, y):
    """Height of the sand over the free surface at a place [m], between cells in proportion; none out of the window."""
    u, v = x / marks.spacing, y / marks.spacing
    column, row = _whole(u), _whole(v)
    if not _is_inside(marks, row, column, 1):
        return 0.0
    values, f, g = doubles(marks.cells, marks.rows * marks.columns), u - column, v - row
    a, b = peek(values, place_of(marks, row, column)), peek(values, place_of(marks, row, column + 1))
    c, d = peek(values, place_of(marks, row + 1, column)), peek(values, place_of(marks, row + 1, column + 1))
    return (1.0 - g) * ((1.0 - f) * a + f * b) + g * ((1.0 - f) * c + f * d)


@inline
def block_place(marks, row, column):
    """Where the mean of a block that lies in the window is kept."""
    rows, columns = marks.rows // BLOCK_SIDE, marks.columns // BLOCK_SIDE
    return (row & (rows - 1)) * columns + (column & (columns - 1))


@inline
def _block(marks, row, column):
    """Mean height of a block over the free surface [m]; none out of the window."""
    rows, columns = marks.rows // BLOCK_SIDE, marks.columns // BLOCK_SIDE
    r, c = row - marks.row // BLOCK_SIDE, column - marks.column // BLOCK_SIDE
    if (r < 0) | (c < 0) | (r >= rows) | (c >= columns):
        return 0.0
    values = doubles(marks.blocks, rows * columns)
    return peek(values, block_place(marks, row, column))


@inline
def level(marks, x, y):
    """Mean level of the sand about a place over the free surface [m], and its slopes along x and y [-]."""
    side = BLOCK_SIDE * marks.spacing
    u, v = (x / marks.spacing - MIDDLE) / BLOCK_SIDE, (y / marks.spacing - MIDDLE) / BLOCK_SIDE
    column, row = _whole(u + 0.5), _whole(v + 0.5)
    f, g = u - column, v - row
    a = 0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)
    b = 0.5 * (0.5 - g) * (0.5 - g), 0.75 - g * g, 0.5 * (0.5 + g) * (0.5 + g)
    da, db = (f - 0.5, -2.0 * f, f + 0.5), (g - 0.5, -2.0 * g, g + 0.5)
    h = along = across = 0.0
    for i in range(3):
        for j in range(3):
            c = _block(marks, row + i - 1, column + j - 1)
            h += b[i] * a[j] * c
            along += b[i] * da[j] * c
            across += db[i] * a[j] * c
    return h, along / side, across / side


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
    side = BLOCK_SIDE * marks.spacing
    rows, columns = marks.rows // BLOCK_SIDE, marks.columns // BLOCK_SIDE
    first_row, first_column = marks.row // BLOCK_SIDE, marks.column // BLOCK_SIDE
    low = max(_whole((y - long) / side - 2.0), first_row), max(_whole((x - wide) / side - 2.0), first_column)
    high = (
        min(_whole((y + long) / side + 3.0), first_row + rows),
        min(_whole((x + wide) / side + 3.0), first_column + columns),
    )
    most = 0.0
    for row in range(low[0], high[0]):
        for column in range(low[1], high[1]):
            most = max(most, _block(marks, row, column))
    return most


@inline
def reaches(marks, above):
    """The share with which a face bears that lies so far above what is left of the sand [m]."""
    return smaller(larger(1.0 - above / (GAP * marks.spacing), 0.0), 1.0)
