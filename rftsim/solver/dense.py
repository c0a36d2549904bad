"""Small matrices with all their entries, and their inverses.

An inverse is made once and multiplies many times, in a tenth of the time that substitution takes with its every number
waiting for the one before.
"""

from typing import Final

from rftsim.machine import lanes
from rftsim.machine.compiling import exact, fast, inline_loop
from rftsim.machine.memory import doubles, int64s, peek, poke, stack_doubles

SMALL: Final = 32
"""Most rows of a small matrix: an inverse takes time with the cube of them."""
_LEAST: Final = 1e-300
"""Size of the pivot that stands for a vanishing one."""


@exact
def multiply(a, x, out):
    """Fill out with the product A x."""
    lanes.multiply(a, x, x.size, out)


@fast
def invert(a):
    """Invert a matrix in place, without a change of the order of its rows, from the last one on (Gauss and Jordan)."""
    n, numbers = a.shape[0], doubles(a.ctypes.data, a.size)
    starts, shares = int64s(stack_doubles(SMALL), SMALL), doubles(stack_doubles(SMALL), SMALL)
    for k in range(n - 1, -1, -1):
        row = n * k
        inverse = 1.0 / (peek(numbers, row + k) if peek(numbers, row + k) != 0.0 else _LEAST)
        count = _column(numbers, n, k, starts, shares)
        lanes.scale(inverse, numbers, row, n, k)
        for column in range(0, n, lanes.LANES):
            if _is_any(numbers, row + column):
                lanes.add_to_rows(shares, starts, count, numbers, row, column, k)


@inline_loop
def _column(numbers, n, k, starts, shares):
    """Find the rows, but k itself, where a matrix's column k is not zero: where they start, that number negative."""
    count = 0
    for i in range(n):
        share = peek(numbers, n * i + k)
        poke(starts, count, n * i)
        poke(shares, count, -share)
        count += (share != 0.0) & (i != k)
    return count


@inline_loop
def _is_any(numbers, place):
    """Whether one of LANES numbers is not zero."""
    found = peek(numbers, place) != 0.0
    for k in range(1, lanes.LANES):
        found = found | (peek(numbers, place + k) != 0.0)
    return found


@exact
def add(a, share, out):
    """Add a share of a matrix's entries, (n^2,), to those of out."""
    lanes.add_scaled(share, a, 0, a.size, out, 0)


@exact
def add_difference(a, b, share, out):
    """Add A - B, each column by its own share, to the matrix out."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            out[i, k] += share[k] * (a[i, k] - b[i, k])
