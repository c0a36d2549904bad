"""Matrices of an equation, of its pattern: their numbers are handed over row by row, (ndof^2,).

Factored, a matrix is A = U D L, of tiles: U and L of unit diagonal, above and below. In substitution every number
would wait for the one before, so it is made once, for the inverses of U and D L, which have the pattern of A as well:
all that follows are products. That takes time with the number of tiles times the square of the depth of their tree.
"""

from rftsim.machine import tiles
from rftsim.machine.compiling import exact
from rftsim.machine.lanes import LANES
from rftsim.solver import equation


@exact
def clear(p, a):
    """Set the numbers of a matrix to zero."""
    n = equation.head(p).ndof
    for k in range(n // LANES):
        tiles.clear(equation.tiles(p, k), equation.tile_count(p)[k], LANES * k, n, a)


@exact
def copy(p, a, out):
    """Fill the matrix out with the numbers of A."""
    n = equation.head(p).ndof
    for k in range(n // LANES):
        tiles.copy(equation.tiles(p, k), equation.tile_count(p)[k], LANES * k, n, a, out)


@exact
def add(p, a, share, out):
    """Add a share of a matrix A to the matrix out."""
    n = equation.head(p).ndof
    for k in range(n // LANES):
        tiles.add(equation.tiles(p, k), equation.tile_count(p)[k], LANES * k, n, share, a, out)


@exact
def add_difference(p, a, b, share, out):
    """Add A - B, each column by its own share, to the matrix out."""
    n = equation.head(p).ndof
    for k in range(n // LANES):
        tiles.add_difference(equation.tiles(p, k), equation.tile_count(p)[k], LANES * k, n, share, a, b, out)


@exact
def multiply(p, a, x, out):
    """Fill out with the product A x; x and out differ."""
    n = equation.head(p).ndof
    for k in range(n // LANES):
        tiles.multiply(equation.tiles(p, k), 0, equation.tile_count(p)[k], a, LANES * k, n, x, out)


@exact
def factor(p, a):
    """Make of a matrix, in place, what `substitute` takes, from the last row on without a change of their order.

    Its tiles become those of the inverse of U above the diagonal, and of the inverse of D L on and below it.
    """
    n = equation.head(p).ndof
    for k in range(n // LANES - 1, -1, -1):
        own, count, row = equation.tiles(p, k), equation.before(p)[k], LANES * k
        tiles.invert(a, row, n)
        for i in range(count):
            tiles.divide(a, own[i], row, n)
            tiles.eliminate(own, count, a, own[i], row, n)
    for k in range(n // LANES):
        own, count, row = equation.tiles(p, k), equation.before(p)[k], LANES * k
        for i in range(count):
            tiles.close_above(own, i + 1, count, a, own[i], row, n)
            tiles.close_below(own, i, count, a, row, own[i], n)


@exact
def substitute(p, a, b, out):
    """Fill out with the solution of A x = b, a what `factor` made of A; b and out differ."""
    n, between, count, before = equation.head(p).ndof, equation.between(p), equation.tile_count(p), equation.before(p)
    for k in range(n // LANES):
        tiles.multiply_and_add(equation.tiles(p, k), before[k] + 1, count[k], a, LANES * k, n, b, between)
    for k in range(n // LANES):
        tiles.multiply(equation.tiles(p, k), 0, before[k] + 1, a, LANES * k, n, between, out)
