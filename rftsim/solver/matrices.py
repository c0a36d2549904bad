"""Matrices of an equation, of its pattern: their numbers are handed over row by row, (ndof^2,)."""

from rftsim.machine import lanes
from rftsim.machine.compiling import exact
from rftsim.machine.lanes import LANES
from rftsim.solver import equation, inverse, pattern, triangular


@exact
def clear(p, a):
    """Set a matrix to zero."""
    n = equation.head(p).ndof
    for k in range(n):
        row = k // LANES * LANES
        lanes.clear_at(equation.blocks(p, row), equation.block_count(p)[row], a, n * k)


@exact
def copy(p, a, out):
    """Fill the matrix out with the numbers of A."""
    n = equation.head(p).ndof
    for k in range(n):
        row = k // LANES * LANES
        lanes.copy_at(equation.blocks(p, row), equation.block_count(p)[row], a, n * k, out)


@exact
def add(p, a, share, out):
    """Add a share of a matrix A to the matrix out."""
    n = equation.head(p).ndof
    for k in range(n):
        row = k // LANES * LANES
        lanes.add_at(share, equation.blocks(p, row), equation.block_count(p)[row], a, n * k, out, n * k)


@exact
def add_difference(p, a, b, share, out):
    """Add A - B, each column by its own share, to the matrix out."""
    n = equation.head(p).ndof
    for k in range(n):
        row = k // LANES * LANES
        lanes.add_difference_at(share, equation.blocks(p, row), equation.block_count(p)[row], a, b, n * k, out)


@exact
def multiply(p, a, x, out):
    """Fill out with the product A x; x and out differ."""
    n = equation.head(p).ndof
    for row in range(0, n, LANES):
        lanes.multiply_at(equation.blocks(p, row), equation.block_count(p)[row], a, row, n, x, out)


@exact
def factor(p, a):
    """Make of a matrix, in place, what `substitute` takes, (2 ndof^2,); its numbers are the first half."""
    if pattern.is_small(p):
        inverse.invert(equation.head(p).ndof, a)
    else:
        triangular.factor(p, a)


@exact
def substitute(p, a, b, out):
    """Fill out with the solution of A x = b, a what `factor` made of A; b and out differ."""
    if pattern.is_small(p):
        multiply(p, a, b, out)
    else:
        triangular.substitute(p, a, b, out)
