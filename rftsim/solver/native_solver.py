"""The solver of the implicit force as a function of a plain address; see `entries`."""

from numba import types

from rftsim.machine.exports import address, entry
from rftsim.solver import newton


@entry(types.void, address)
def solve(p):
    """Solve the equation at p."""
    newton.solve(p)
