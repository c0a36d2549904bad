"""Memory that belongs to an owner's address, found by number.

MuJoCo copies an mjData's plugin data bit by bit when it is pickled, so a pointer kept there may be another's, or dead.
A number that is looked up here is safe: an entry is used by its owner alone. Compiled code reaches the table by name,
from any thread, see `claims`.
"""

import ctypes
from typing import Final

import llvmlite.binding as llvm

SIZE: Final = 1 << 15
"""Entries: beds of sand in all mjData alive in a process."""
WORDS: Final = 4
"""Of an entry: owner, which of the owner's, address, size."""
SYMBOL: Final = "rftsim_registry"

_table: Final = (ctypes.c_int64 * (SIZE * WORDS))()
ctypes.pythonapi.Py_IncRef(ctypes.py_object(_table))  # MuJoCo may free data after this module
llvm.add_symbol(SYMBOL, ctypes.addressof(_table))


def read_address(number: int, owner: int, which: int) -> int:
    """Where an owner's memory is, for Python; 0 where it has none."""
    for candidate in (number, *range(SIZE)):
        if _table[WORDS * candidate] == owner and _table[WORDS * candidate + 1] == which:
            return int(_table[WORDS * candidate + 2])
    return 0
