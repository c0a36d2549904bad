"""The pattern of an equation's matrices: all of a small one, and of a large one what its trees couple.

A tree couples a degree of freedom to its ancestors alone, and elimination from the last one to the first then fills
nothing in. Where constraints couple branches, one is hung below the other, so that this still holds. Matrices are
stored with all their entries, row by row; of these, the blocks of LANES rows and columns are set and read that hold a
coupled pair.
"""

from typing import Final

import numpy as np

from rftsim.machine.compiling import exact
from rftsim.machine.lanes import LANES
from rftsim.solver import equation, linear_algebra

SMALL: Final = 24
"""Most degrees of freedom of a small equation: the inverse of a matrix takes time with the cube of them."""
NONE: Final = -1
"""The parent of a degree of freedom that is coupled to none before it."""


@exact
def is_small(p):
    """Whether everything is coupled."""
    return equation.head(p).ndof <= SMALL


@exact
def couple(p, k, other):
    """Make a degree of freedom before k one of its ancestors."""
    parent = equation.parent(p)
    while k != other and other != NONE:
        above = parent[k]
        if above < other:
            parent[k], k, other = other, other, above
        else:
            k = above


@exact
def find(p):
    """Fill the pattern that follows from each degree of freedom's parent."""
    n = equation.head(p).ndof
    if not is_small(p):
        _find_ancestors(p)
        _find_blocks(p)
        return
    for row in range(0, n, LANES):
        blocks = equation.blocks(p, row)
        for column in range(0, n, LANES):
            blocks[column // LANES] = column
        equation.block_count(p)[row] = n // LANES


@exact
def _find_ancestors(p):
    """Fill what follows from each degree of freedom's parent: its ancestors, and the columns of their blocks."""
    parent, length, number = equation.parent(p), equation.ancestor_count(p), equation.column_count(p)
    for k in range(parent.size):
        own, columns, first = equation.ancestors(p, k), equation.columns(p, k), equation.first_in(p, k)
        count, blocks, above = np.int64(0), np.int64(0), parent[k]
        if above != NONE:
            count, blocks = length[above], number[above]
            linear_algebra.copy(equation.ancestors(p, above)[:count], own[:count])
            linear_algebra.copy(equation.columns(p, above)[:blocks], columns[:blocks])
            linear_algebra.copy(equation.first_in(p, above)[:blocks], first[:blocks])
            own[count] = above
            count += 1
        if blocks == 0 or columns[blocks - 1] != k // LANES * LANES:
            columns[blocks], first[blocks] = k // LANES * LANES, count
            blocks += 1
        length[k], number[k] = count, blocks


@exact
def _find_blocks(p):
    """Fill the columns of the blocks that each LANES rows have, before and behind the diagonal."""
    n = equation.head(p).ndof
    for row in range(0, n, LANES):
        equation.block_count(p)[row] = 0
        linear_algebra.clear(equation.is_block(p, row))
    for k in range(n):
        columns, row = equation.columns(p, k), k // LANES * LANES
        for i in range(equation.column_count(p)[k]):
            equation.is_block(p, row)[columns[i]] = equation.is_block(p, columns[i])[row] = 1
    for row in range(0, n, LANES):
        found, known, count = equation.blocks(p, row), equation.is_block(p, row), np.int64(0)
        for column in range(0, n, LANES):
            if known[column] != 0:
                found[count] = column
                count += 1
        equation.block_count(p)[row] = count
