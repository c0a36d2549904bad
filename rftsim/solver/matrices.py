"""Matrices of an equation: dense with their inverses where it is small, of the pattern of its trees where it is large.

A matrix is stored with all its entries, row by row. What a large one has outside of the pattern is neither set nor read.
"""

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles
from rftsim.solver import dense, equation, linear_algebra, sparse

@exact
def is_small(p):
    """Whether the equation's matrices are dense."""
    return equation.head(p).ndof <= dense.SMALL


@exact
def _entries(a):
    return doubles(a.ctypes.data, a.size)


@exact
def clear(p, a):
    """Set a matrix to zero."""
    if is_small(p):
        linear_algebra.clear(_entries(a))
    else:
        sparse.clear(p, a)


@exact
def copy(p, a, out):
    """Fill the matrix out with the numbers of A."""
    if is_small(p):
        linear_algebra.copy(_entries(a), _entries(out))
    else:
        sparse.copy(p, a, out)


@exact
def add(p, a, share, out):
    """Add a share of a matrix A to the matrix out."""
    if is_small(p):
        dense.add(_entries(a), share, _entries(out))
    else:
        sparse.add(p, a, share, out)


@exact
def add_difference(p, a, b, share, out):
    """Add A - B, each column by its own share, to the matrix out."""
    if is_small(p):
        dense.add_difference(a, b, share, out)
    else:
        sparse.add_difference(p, a, b, share, out)


@exact
def multiply(p, a, x, out):
    """Fill out with the product A x; x and out differ."""
    if is_small(p):
        dense.multiply(a, x, out)
    else:
        sparse.multiply(p, a, x, out)


@exact
def factor(p, a):
    """Make of a matrix, in place, what `substitute` takes; the order of its rows stays, from the last one on."""
    if is_small(p):
        dense.invert(a)
    else:
        sparse.factor(p, a)


@exact
def substitute(p, a, b, out):
    """Fill out with the solution of A x = b, a what `factor` made of A; b and out differ."""
    if is_small(p):
        dense.multiply(a, b, out)
    else:
        sparse.substitute(p, a, b, out)
