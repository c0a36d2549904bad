"""One time step of the implicit force as functions of a plain address; see `entries`."""

from numba import types

from rftsim.machine.exports import address, entry
from rftsim.solver import time_step


@entry(types.intc, address)
def is_needed(p):
    """Whether the sand can act in the step."""
    return 1 if time_step.is_needed(p) else 0


@entry(types.void, address)
def step(p):
    """The sand's generalised force of one step."""
    time_step.step(p)
