"""The inverse of a small matrix: made once, it multiplies in a tenth of the time that substitution takes."""

from typing import Final

from rftsim.machine import lanes
from rftsim.machine.compiling import fast, inline_loop
from rftsim.machine.memory import doubles, int64s, peek, poke, stack_doubles
from rftsim.solver import pattern

_SMALL: Final = pattern.SMALL
_LEAST: Final = 1e-300
"""Size of the pivot that stands for a vanishing one."""


@fast
def invert(n, numbers):
    """Invert a matrix of n rows in place, from the last one on without a change of their order (Gauss and Jordan)."""
    rows, shares = int64s(stack_doubles(_SMALL), _SMALL), doubles(stack_doubles(_SMALL), _SMALL)
    for k in range(n - 1, -1, -1):
        row = n * k
        inverse = 1.0 / (peek(numbers, row + k) if peek(numbers, row + k) != 0.0 else _LEAST)
        count = _column(numbers, n, k, rows, shares)
        lanes.scale(inverse, numbers, row, n, k)
        for column in range(0, n, lanes.LANES):
            if _is_any(numbers, row + column):
                lanes.add_to_rows(shares, rows, count, numbers, row, n, column, k)


@inline_loop
def _column(numbers, n, k, rows, shares):
    """Find the rows, but k itself, where a matrix's column k is not zero: and that number, negative."""
    count = 0
    for i in range(n):
        share = peek(numbers, n * i + k)
        poke(rows, count, i)
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
