"""The part of a bed's ruts that is worked on: a rectangle of cells, and scratch for each of them."""

from typing import Final

import numpy as np

from rftsim.law import ruts
from rftsim.law.layout import BLOCK_SIDE
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles
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
target = _T.matrix("rows", "columns")
"""The cell that takes what is displaced, by its place in the patch, (rows, columns); -1 where none is known. Afterwards
the heights between which sand slides."""
flow = _T.matrix("rows", "columns")
"""How much the sand of a cell rises [m], (rows, columns)."""
lay_out, place = _T.layout(), _T.place()
TABLE: Final = _T.size
"""Numbers of a patch's table."""


@inline
def is_held(p, i, j, gap):
    """Whether a body lies on the sand of a cell, or within a gap of it [m]."""
    return lowest(p)[i, j] <= height(p)[i, j] + gap


@exact
def raise_cell(p, marks, i, j, by):
    """Raise the sand of a cell of the patch [m], and the mean of its block."""
    row, column, count = head(p).row + i, head(p).column + j, marks.rows * marks.columns
    values, blocks = doubles(marks.cells, count), doubles(marks.blocks, count // BLOCK_SIDE**2)
    values[ruts.place_of(marks, row, column)] += by
    blocks[ruts.block_place(marks, row // BLOCK_SIDE, column // BLOCK_SIDE)] += by / BLOCK_SIDE**2
    height(p)[i, j] += by


@exact
def flat(p, matrix):
    """A matrix of the patch, row by row, (rows * columns,)."""
    return doubles(matrix.ctypes.data, head(p).rows * head(p).columns)
