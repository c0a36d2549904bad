"""Memory that belongs to an owner's address, found by number.

MuJoCo copies an mjData's plugin data bit by bit when it is pickled, so a pointer kept there may be another's, or dead.
A number that is looked up here is safe: a place is used by its owner alone. Compiled code reaches the table by name,
from any thread, see `claims`.
"""

import ctypes
from typing import Final

import llvmlite.binding as llvm
import numpy as np

PLACES: Final = 1 << 15
"""Places of the table: beds of sand in all mjData alive in a process."""
PLACE: Final = np.dtype([("owner", "i8"), ("which", "i8"), ("address", "i8"), ("words", "i8")])
"""A place: address of its owner, zero where it is free; which of the owner's memories; where it is, and its size."""
SYMBOL: Final = "rftsim_registry"
"""The name under which compiled code finds the table."""

_memory: Final = (ctypes.c_int64 * (PLACES * PLACE.itemsize // 8))()
ctypes.pythonapi.Py_IncRef(ctypes.py_object(_memory))  # MuJoCo may free data after this module
llvm.add_symbol(SYMBOL, ctypes.addressof(_memory))
_table: Final = np.frombuffer(memoryview(_memory), dtype=PLACE)


def read_address(number: int, owner: int, which: int) -> int:
    """The address of an owner's memory, for Python; 0 where it has none."""
    place = _table[number] if 0 <= number < PLACES else None
    if place is None or place["owner"] != owner or place["which"] != which:
        (found,) = np.nonzero((_table["owner"] == owner) & (_table["which"] == which))
        if not len(found):
            return 0
        place = _table[found[0]]
    return int(place["address"])
