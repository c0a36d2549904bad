"""Memory that belongs to an owner's address, found by number.

MuJoCo copies an mjData's plugin data bit by bit when it is pickled, so a pointer kept there may be another's, or dead.
A number that is looked up here is safe: an entry is used by its owner alone. Compiled code reaches the table by name,
from any thread.
"""

import ctypes
from typing import Any, Final

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from rftsim.memory import allocate, int64s, release

SIZE: Final = 1 << 15
"""Entries: beds of sand in all mjData alive in a process."""
_WORDS: Final = 4  # owner, which of the owner's, address, size
_SYMBOL: Final = "rftsim_registry"

_table: Final = (ctypes.c_int64 * (SIZE * _WORDS))()
ctypes.pythonapi.Py_IncRef(ctypes.py_object(_table))  # MuJoCo may free data after this module
llvm.add_symbol(_SYMBOL, ctypes.addressof(_table))


@intrinsic
def _table_address(typing_context: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        module = builder.module
        table = module.globals.get(_SYMBOL) or ir.GlobalVariable(module, ir.IntType(64), _SYMBOL)
        return builder.ptrtoint(table, context.get_value_type(types.intp))

    return types.intp(), generate


@intrinsic
def _claim(typing_context: Any, address: Any, owner: Any) -> Any:
    """Write an owner where there is none; whether that succeeded. Atomic."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        pointer = builder.inttoptr(arguments[0], word.as_pointer())
        pair = builder.cmpxchg(pointer, ir.Constant(word, 0), arguments[1], "seq_cst", "seq_cst")
        return builder.extract_value(pair, 1)

    return types.boolean(types.intp, types.int64), generate


@njit
def _entry(number):
    return int64s(_table_address() + 8 * _WORDS * number, _WORDS)


@njit
def find(hint, owner, which):
    """The number of an owner's entry, or -1; `hint` is looked at first."""
    if 0 <= hint < SIZE and _entry(hint)[0] == owner and _entry(hint)[1] == which:
        return hint
    start = (owner >> 4) % SIZE
    for k in range(SIZE):
        number = (start + k) % SIZE
        entry = _entry(number)
        if entry[0] == owner and entry[1] == which:
            return number
    return -1


@njit
def make(hint, owner, which, words):
    """Give an owner memory, what it has where the size is right; its number, or -1 where there is none left."""
    number = find(hint, owner, which)
    if number < 0:
        start = (owner >> 4) % SIZE
        for k in range(SIZE):
            candidate = (start + k) % SIZE
            if _entry(candidate)[0] == 0 and _claim(_table_address() + 8 * _WORDS * candidate, owner):
                number = candidate
                break
        if number < 0:
            return -1
        _entry(number)[1] = which
    entry = _entry(number)
    if entry[2] == 0 or entry[3] != words:
        release(entry[2])
        entry[2], entry[3] = allocate(words, 8), words
    return number if entry[2] != 0 else -1


@njit
def address(number):
    """Where the memory of an entry is."""
    return _entry(number)[2]


@njit
def drop(number):
    """Release an entry and its memory."""
    entry = _entry(number)
    memory = entry[2]
    entry[1] = entry[2] = entry[3] = 0
    entry[0] = 0  # last: from here on it may be claimed
    release(memory)


def read_address(number: int, owner: int, which: int) -> int:
    """Where an owner's memory is, for Python; 0 where it has none."""
    for candidate in (number, *range(SIZE)):
        if _table[_WORDS * candidate] == owner and _table[_WORDS * candidate + 1] == which:
            return int(_table[_WORDS * candidate + 2])
    return 0
