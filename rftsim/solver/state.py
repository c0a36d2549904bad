"""The state that the implicit force keeps from step to step, as numbers; all zero is "nothing known".

Whether a step was made, then nv numbers each of `lacking` and `after`, then a record of KEPT for each body of the bed.
"""

from typing import Final

import numpy as np

from rftsim.law.layout import WRENCH, numbers_in
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles
from rftsim.machine.records import record_at

KEPT: Final = np.dtype(
    [
        *(("known", "f8"), ("drift", "f8"), ("parts", "f8")),
        *((name, "f8", WRENCH) for name in ("wrench", "twist", "strain")),
        ("derivative", "f8", (WRENCH, WRENCH)),
        *(("missed", "f8", WRENCH), ("trend", "f8")),
    ]
)
"""The sand's force on a body near where the last step ended: whether it is known; the length of the last part where
that step was split, else zero [s], and the parts that the next one should have; the wrench that is foreseen at a
twist that the law feels; the strain over v_c, see `newton`; the derivative of the wrench by the twist; by how much
that missed the first wrench of the last step; and the share of this that is foreseen of the next."""
KEPT_NUMBERS: Final = numbers_in(KEPT)

kept_at = record_at(KEPT)
"""The record KEPT at an address."""


@inline
def state_size(nbody, nv):
    """Numbers that last from step to step, of a bed of so many bodies in a model of so many degrees of freedom."""
    return 1 + 2 * nv + KEPT_NUMBERS * nbody


@inline
def started(address):
    """Whether a step was made, (1,), of the state at an address."""
    return doubles(address, 1)


@inline
def lacking(address, nv):
    """The velocity that MuJoCo's lacks to the true one after a split step, (nv,), of the state at an address."""
    return doubles(address + 8, nv)


@inline
def after(address, nv):
    """MuJoCo's velocity after the step, as it was solved for, (nv,), of the state at an address; else zero."""
    return doubles(address + 8 * (1 + nv), nv)


@inline
def kept(address, nv, k):
    """Address of the record KEPT of the k-th body of the state at an address."""
    return address + 8 * (1 + 2 * nv + KEPT_NUMBERS * k)
