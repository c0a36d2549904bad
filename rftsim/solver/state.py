"""What the implicit force remembers from step to step: one array of numbers; all zero is "nothing known".

Flags, then four vectors of nv numbers (the force foreseen for the next step, the velocity that it belongs to, what the
velocity lacks to the true one after a split step, the velocity after the step), then each body's derivative, (6, 6).
"""

from typing import Final

from numba import njit

STARTED: Final = 0
KNOWS_FORCE: Final = 1
KNOWS_DERIVATIVE: Final = 2
SPLIT: Final = 3
DRIFT: Final = 4
"""Entries: the flags, and the length of the last part of a split step [s]."""
HEAD: Final = 6


@njit
def state_size(nbody, nv):
    """Numbers that last from step to step."""
    return HEAD + 4 * nv + 36 * nbody


@njit
def part_of(state, k, nv):
    """The k-th vector of a state, (nv,)."""
    return state[HEAD + k * nv : HEAD + (k + 1) * nv]
