"""A plugin instance: which bodies feel its sand, where their numbers lie in the model, and what it remembers.

The numbers are found by name. A numeric is a body's surface, or a bed's parameters, where its name without the marker
is the body's, or the instance's, name; so are those of its terrain; so MJCF attachment may put any prefix and suffix
around both. They are checked when the block is made, see `checks`; where they lie and how many they are is kept, and
not read from the model again.

What belongs to an mjData (`plugin_data` is its number in the registry) is one block: a record of BLOCK_HEAD, one of
MEMBER for each body, each body's last wrench (WRENCH numbers), what was left in MuJoCo's cfrc_ext for each (as many), a
record of COUNTERS, and the state after the step under way. What must last is MuJoCo's `plugin_state`, and is brought up
to date only when a step ends.
"""

import ctypes
from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.errors import SceneError
from rftsim.law.layout import WRENCH
from rftsim.machine import registry
from rftsim.machine.kernel import exact_kernel

CHUNK: Final = 500
"""Numbers of one numeric: MuJoCo's XML reader takes no more. A surface goes on in the numerics behind its first."""
BODY_MARKER: Final = "rftsim-body:"
MORE_MARKER: Final = "rftsim-body-"
"""Instead of BODY_MARKER, with the numeric's number and a colon behind it, where a surface goes on."""
SAND_MARKER: Final = "rftsim-sand:"
TERRAIN_MARKER: Final = "rftsim-terrain:"
MORE_TERRAIN_MARKER: Final = "rftsim-terrain-"
"""Likewise, of a terrain that goes on."""
BLOCK_HEAD: Final = np.dtype(
    [
        *((name, "i8") for name in ("nbody", "bed", "state", "state_size", "has_complained", "looking")),
        *(
            ("ruts_size", "i8"),
            ("terrain", "i8"),
            ("terrain_size", "i8"),
            ("terrain_weight", "f8"),
            ("bed_weight", "f8"),
        ),
    ]
)
"""Number of bodies; the bed's place in numeric_data; address and size of the state that lasts, but for ruts; whether it
was said that the numbers were changed; the body whose surface is looked at; size of the ruts, which lie behind the
state that lasts; the terrain's place in numeric_data and its size, zero where there is none; the weights of the
terrain's and the bed's sealed numbers, see `checks`."""
MEMBER: Final = np.dtype(
    [
        *((name, "i8") for name in ("body", "start", "read", "size", "looked_at")),
        *((name, "f8") for name in ("weight", "header_weight", "weight_so_far", "ntri", "wheel_radius")),
    ]
)
"""A body's id; its surface's place in numeric_data, and that of the first one with the same numbers, which is read in
its stead, as it is at hand; how many numbers it has; how many were looked at since their weight was last compared;
their weight and that of the header; that of those looked at; what the size follows from."""
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


def read_block(numbers: Any, owner: int, instance: int) -> Block:
    """The block of an instance in the mjData at `owner` whose plugin data is `numbers`.

    Raises:
        SceneError: The data has none: it was made of another model.
    """
    address = registry.read_address(int(numbers[instance]), owner, instance) if instance < len(numbers) else 0
    if address == 0:
        raise SceneError("the data holds nothing of the model's sand: make it with mujoco.MjData(model), and step it")
    n = int(_view(address, BLOCK_HEAD, 1)[0]["nbody"])
    members = _view(address + _HEAD, MEMBER, n)
    wrenches = _view(address + wrenches_start(n), np.dtype("f8"), WRENCH * n).reshape(n, WRENCH)
    return Block(members["body"], wrenches, _view(address + counters_start(n), COUNTERS, 1)[0])


def _view(address: int, dtype: "np.dtype[Any]", count: int) -> Any:
    """Records at an address, shape (count,)."""
    return np.frombuffer(memoryview((ctypes.c_char * (dtype.itemsize * count)).from_address(address)), dtype=dtype)
