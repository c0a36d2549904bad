"""The factors of large matrices, two triangular ones, and their inverses, which have the pattern of the trees as well.

In substitution every number waits for the one before; so it is done once, for the inverses, and all that follows are
products. It takes time with the number of degrees of freedom times the square of the depth of the trees.
"""

from typing import Final

import numpy as np

from rftsim.machine import lanes
from rftsim.machine.compiling import exact, fast
from rftsim.machine.memory import peek, poke
from rftsim.solver import equation, linear_algebra, pattern

_LEAST: Final = 1e-300
"""Size of the pivot that stands for a vanishing one."""


@fast
def factor(p, a):
    """Factor a matrix, the first of two, from the last row on, without a change of their order; see `matrices`.

    A is U L, U of unit diagonal. The first becomes the inverse of L, the second the transposed one of U.
    """
    n, pivots = equation.head(p).ndof, equation.pivots(p)
    one, other = a[: n * n], a[n * n :]
    for k in range(n - 1, -1, -1):
        own, count, columns = equation.ancestors(p, k), equation.ancestor_count(p)[k], equation.columns(p, k)
        pivot, first, shares = peek(one, n * k + k), equation.first_in(p, k), other[n * k : n * k + n]
        pivots[k] = 1.0 / (pivot if pivot != 0.0 else _LEAST)
        for i in range(count):
            poke(shares, i, -peek(one, n * peek(own, i) + k) * pivots[k])
        for block in range(equation.column_count(p)[k]):
            if first[block] < count:  # what stands behind the diagonal is not read any more
                lanes.add_to_rows(shares, own, count, one, n * k, n, columns[block], np.int64(pattern.NONE))
    _invert(p, one, other)


@fast
def _invert(p, lower, upper):
    """Invert the triangular factors in place, row by row: each is a sum of those of its ancestors."""
    n, left, right = equation.head(p).ndof, equation.shares(p), equation.others_shares(p)
    for k in range(n):
        own, count, columns = equation.ancestors(p, k), equation.ancestor_count(p)[k], equation.columns(p, k)
        first, pivot = equation.first_in(p, k), equation.pivots(p)[k]
        for i in range(count):
            poke(left, i, -peek(lower, n * k + peek(own, i)))
            poke(right, i, peek(upper, n * k + i))
        for block in range(equation.column_count(p)[k]):
            ends, column = (first[block], count), columns[block]
            lanes.combine_rows(left, own, ends, lower, n, column, k, pivot)
            lanes.combine_rows(right, own, ends, upper, n, column, k, 1.0)


@exact
def substitute(p, a, b, out):
    """Fill out with the solution of A x = b from the inverses of its factors; b and out differ."""
    n, between = equation.head(p).ndof, equation.between(p)
    linear_algebra.clear(between)
    for k in range(n):
        lanes.add_at(b[k], equation.columns(p, k), equation.column_count(p)[k], a, n * (n + k), between, 0)
    for k in range(n):
        out[k] = lanes.dot_at(equation.columns(p, k), equation.column_count(p)[k], a, n * k, between)
