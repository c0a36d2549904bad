"""The solver of the implicit force as a function of a plain address; see `entries`."""

from numba import types

from rftsim import implicit
from rftsim.entries import address, entry


@entry(types.void, address)
def solve(p):
    """Solve the equation at p."""
    implicit.solve(p)
