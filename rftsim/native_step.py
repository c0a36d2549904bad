"""One time step of the implicit force as functions of a plain address; see `entries`."""

from numba import types

from rftsim import stepping
from rftsim.entries import address, entry


@entry(types.intc, address)
def is_needed(p):
    """Whether the sand can act in the step."""
    return 1 if stepping.is_needed(p) else 0


@entry(types.void, address)
def step(p):
    """The sand's generalised force of one step."""
    stepping.step(p)
