"""A plugin instance: which bodies feel its sand, where their numbers lie in the model, and what it remembers.

The numbers are found by name. A numeric is a body's surface, or a bed's parameters, where its name without the marker
is the body's, or the instance's, name; so MJCF attachment may put any prefix and suffix around both.

What belongs to an mjData (`plugin_data` is its number in the registry) is one block: a record of BLOCK_HEAD, one of
MEMBER for each body, each body's last wrench (WRENCH numbers), what was left in MuJoCo's cfrc_ext for each (as many), a
record of COUNTERS, and the state after the step under way. What must last is MuJoCo's `plugin_state`, and is brought up
to date only when a step ends.
"""

import ctypes
from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.law.layout import WRENCH
from rftsim.machine import registry
from rftsim.machine.kernel import exact_kernel

CHUNK: Final = 500
"""Numbers of one numeric: MuJoCo's XML reader takes no more. A surface goes on in the numerics behind its first."""
BODY_MARKER: Final = "rftsim-body:"
SAND_MARKER: Final = "rftsim-sand:"
BLOCK_HEAD: Final = np.dtype([("nbody", "i8"), ("bed", "i8")])
"""Number of bodies, and the numeric of the bed."""
MEMBER: Final = np.dtype([("body", "i8"), ("numeric", "i8")])
"""A body's id, and the numeric of its surface."""
COUNTERS: Final = np.dtype(
    [
        *((name, "f8") for name in ("evaluations", "derivatives", "unsolved")),
        *((name, "f8") for name in ("steps", "all_evaluations", "all_derivatives", "all_unsolved")),
    ]
)
"""Cost of the last force, as the solver's WORK; then the number of steps, and the sums of the costs over them."""
_HEAD: Final = BLOCK_HEAD.itemsize
_MEMBER: Final = MEMBER.itemsize
_WRENCH: Final = 8 * WRENCH
_COUNTERS: Final = COUNTERS.itemsize


@exact_kernel
def wrenches_start(nbody: Any) -> Any:
    """Bytes of a block before its wrenches."""
    return _HEAD + _MEMBER * nbody


@exact_kernel
def marks_start(nbody: Any) -> Any:
    """Bytes of a block before what was left in cfrc_ext."""
    return _HEAD + (_MEMBER + _WRENCH) * nbody


@exact_kernel
def counters_start(nbody: Any) -> Any:
    """Bytes of a block before its counters."""
    return _HEAD + (_MEMBER + 2 * _WRENCH) * nbody


@exact_kernel
def state_start(nbody: Any) -> Any:
    """Bytes of a block before its state."""
    return counters_start(nbody) + _COUNTERS


class Block(NamedTuple):
    """A block as Python sees it: views of its memory, which live no longer than the mjData."""

    bodies: "np.ndarray[Any, np.dtype[np.int64]]"
    """Ids of the bodies, shape (nbody,)."""
    wrenches: "np.ndarray[Any, np.dtype[np.float64]]"
    """Their last wrenches, shape (nbody, WRENCH)."""
    counters: Any
    """Record of COUNTERS."""


def read_block(number: int, owner: int, instance: int) -> Block:
    """The block of an instance in the mjData at `owner` whose plugin data is `number`."""
    address = registry.read_address(number, owner, instance)
    n = int(_view(address, BLOCK_HEAD, 1)[0]["nbody"])
    members = _view(address + _HEAD, MEMBER, n)
    wrenches = _view(address + wrenches_start(n), np.dtype("f8"), WRENCH * n).reshape(n, WRENCH)
    return Block(members["body"], wrenches, _view(address + counters_start(n), COUNTERS, 1)[0])


def _view(address: int, dtype: "np.dtype[Any]", count: int) -> Any:
    """Records at an address, shape (count,)."""
    return np.frombuffer(memoryview((ctypes.c_char * (dtype.itemsize * count)).from_address(address)), dtype=dtype)
