"""A plugin instance: which bodies feel its sand, where their numbers lie in the model, and what it remembers.

The numbers are found by name. A numeric is a body's surface, or a bed's parameters, where its name without the marker
is the body's, or the instance's, name; so MJCF attachment may put any prefix and suffix around both.

What belongs to an mjData (`plugin_data` is its number in the registry) is one block: int64 [number of bodies, numeric
of the bed, (body, numeric of its surface) ...], then float64 [last wrench of each body (6), counters (COUNTERS), state
after the step under way]. What must last is MuJoCo's `plugin_state`, and is brought up to date only when a step ends.
"""

import ctypes
from typing import Final

from rftsim.machine import registry

CHUNK: Final = 500
"""Numbers of one numeric: MuJoCo's XML reader takes no more. A surface goes on in the numerics behind its first."""
BODY_MARKER: Final = "rftsim-body:"
SAND_MARKER: Final = "rftsim-sand:"
WRENCH: Final = 6
"""Numbers of a wrench: force, then moment about the body's origin, in the world frame."""
COUNTERS: Final = 7
"""Evaluations, Jacobians and unsolved equations of the last force; then steps, and the sums of those three."""
HEAD: Final = 2
SIZE: Final = 8


def read_wrenches(number: int, owner: int, instance: int) -> list[tuple[int, tuple[float, ...]]]:
    """Each body's id and last wrench, of the mjData at `owner` whose plugin data is `number`."""
    n, entries, numbers = _read(number, owner, instance)
    return [(entries[HEAD + 2 * k], tuple(numbers[WRENCH * k : WRENCH * (k + 1)])) for k in range(n)]


def read_counters(number: int, owner: int, instance: int) -> tuple[float, ...]:
    """Steps, evaluations, Jacobians and unsolved equations since the last reset."""
    n, _, numbers = _read(number, owner, instance)
    return tuple(numbers[WRENCH * n + 3 : WRENCH * n + COUNTERS])


def _read(
    number: int, owner: int, instance: int
) -> "tuple[int, ctypes.Array[ctypes.c_int64], ctypes.Array[ctypes.c_double]]":
    address = registry.read_address(number, owner, instance)
    n = ctypes.c_int64.from_address(address).value
    entries = (ctypes.c_int64 * (HEAD + 2 * n)).from_address(address)
    return n, entries, (ctypes.c_double * (WRENCH * n + COUNTERS)).from_address(address + ctypes.sizeof(entries))
