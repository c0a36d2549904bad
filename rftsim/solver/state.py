"""The state that the implicit force keeps from step to step, as numbers; all zero is "nothing known".

A record of FLAGS, then four vectors of nv numbers, then each body's derivative, (6, 6).
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.law.layout import numbers_in
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles
from rftsim.machine.records import record_at

FLAGS: Final = np.dtype(
    [("started", "f8"), ("knows_force", "f8"), ("knows_derivative", "f8"), ("split", "f8"), ("drift", "f8")]
)
"""Flags, and the length of the last part of a split step [s]."""
FLAGS_NUMBERS: Final = numbers_in(FLAGS)
DERIVATIVE: Final = 36
"""Numbers of a body's derivative."""

flags_at = record_at(FLAGS)
"""The flags of the state at an address."""


class State(NamedTuple):
    """A state, of nbody bodies in the sand and nv degrees of freedom."""

    address: Any
    nbody: Any
    nv: Any


@inline
def state_size(nbody, nv):
    """Numbers that last from step to step."""
    return FLAGS_NUMBERS + 4 * nv + DERIVATIVE * nbody


@inline
def numbers(state):
    """All numbers of a state, (state_size,), to be copied or cleared."""
    return doubles(state.address, state_size(state.nbody, state.nv))


@inline
def _vector(state, k):
    return doubles(state.address + 8 * (FLAGS_NUMBERS + k * state.nv), state.nv)


@inline
def foreseen(state):
    """The sand's generalised force foreseen for the next step, (nv,)."""
    return _vector(state, 0)


@inline
def last(state):
    """The generalised velocity that the foreseen force belongs to, (nv,)."""
    return _vector(state, 1)


@inline
def lacking(state):
    """The velocity that MuJoCo's lacks to the true one after a split step, (nv,)."""
    return _vector(state, 2)


@inline
def after(state):
    """The generalised velocity after the step, (nv,)."""
    return _vector(state, 3)


@inline
def derivatives(state):
    """The derivatives of all bodies' wrenches by their twists, (36 nbody,)."""
    return doubles(state.address + 8 * (FLAGS_NUMBERS + 4 * state.nv), DERIVATIVE * state.nbody)


@inline
def begin(state):
    """Forget everything but that a step was made."""
    x = numbers(state)
    for i in range(x.size):
        x[i] = 0.0
    flags_at(state.address).started = 1.0
