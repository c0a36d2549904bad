"""The part of a bed's ruts that is worked on: a rectangle of cells, and scratch for each of them."""

from typing import Final

import numpy as np

from rftsim.law import ruts
from rftsim.law.field import surface_over
from rftsim.law.layout import BLOCK_SIDE
from rftsim.law.spline import values_of
from rftsim.law.vectors import larger
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import doubles, peek, poke
from rftsim.machine.table import Table

TABLE_HEAD: Final = np.dtype([(name, "i8") for name in ("rows", "columns", "row", "column")])
"""The head of a patch: how many rows and columns of cells it has, and the first of each, counted from the origin."""
_T: Final = Table(TABLE_HEAD, ("rows", "columns"))
head = _T.head
"""Record TABLE_HEAD of the patch at p."""
height = _T.matrix("rows", "columns")
"""Height of the sand at each cell, world frame [m], (rows, columns)."""
lowest = _T.matrix("rows", "columns")
"""Lowest point of a body over each cell, world frame [m], (rows, columns); infinite where there is none."""
mover = _T.matrix("rows", "columns")
"""Which body that is, by its place in the bed, (rows, columns)."""
level = _T.matrix("rows", "columns")
"""Heights of the cells between which sand can slide [m], no numbers for others, (rows, columns)."""
flow = _T.matrix("rows", "columns")
"""How much the sand of a cell rises [m], (rows, columns)."""
lay_out, place = _T.layout(), _T.place()
DIAGONAL: Final = 2.0**0.5
"""Distance to a neighbour across a corner [cells]."""
TABLE: Final = _T.size
"""Numbers of a patch's table."""


@loop
def _fill_run(heights, start, count, field, x, y, spacing, values, place):
    """Fill the heights of so many cells of a row from one on, of which the first lies at a place; the highest [m]."""
    top = -np.inf
    for j in range(count):
        height, _, _ = surface_over(field, x + j * spacing, y)
        poke(heights, start + j, height + peek(values, place + j))
    for j in range(count):
        top = larger(top, peek(heights, start + j))
    return top


@exact
def fill(p, field, marks):
    """Fill the heights of a patch's cells, and no body over them; the highest [m]."""
    table, heights, bodies, top = head(p), flat(p, height(p)), flat(p, lowest(p)), -np.inf
    values, x, rows, columns = (
        doubles(marks.cells, marks.rows * marks.columns),
        marks.spacing,
        table.rows,
        table.columns,
    )
    first = min(columns, marks.columns - (table.column & (marks.columns - 1)))  # behind it they go on from the start
    for i in range(rows):
        row = table.row + i
        for start, end in ((0, first), (first, columns)):
            column, at = table.column + start, i * columns + start
            if start < end:
                place = ruts.place_of(marks, row, column)
                high = _fill_run(heights, at, end - start, field, column * x, row * x, x, values, place)
                top = max(top, high)
    for k in range(bodies.size):
        bodies[k] = np.inf
    return top


@inline
def is_held(p, i, j, gap):
    """Whether a body lies on the sand of a cell, or within a gap of it [m]."""
    return lowest(p)[i, j] <= height(p)[i, j] + gap


@exact
def raise_cell(p, marks, i, j, by):
    """Raise the sand of a cell of the patch [m], and the mean of its block."""
    row, column, count = head(p).row + i, head(p).column + j, marks.rows * marks.columns
    values, blocks = doubles(marks.cells, count), values_of(marks.blocks)
    values[ruts.place_of(marks, row, column)] += by
    blocks[ruts.block_place(marks, row, column)] += by / BLOCK_SIDE**2
    height(p)[i, j] += by


@exact
def flat(p, matrix):
    """A matrix of the patch, row by row, (rows * columns,)."""
    return doubles(matrix.ctypes.data, head(p).rows * head(p).columns)
