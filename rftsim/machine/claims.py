"""The registry's entries for compiled code: found, claimed and given back, from any thread."""

from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from rftsim.machine.memory import allocate, int64s, named_address, release
from rftsim.machine.registry import SIZE, SYMBOL, WORDS

_table_address = named_address(SYMBOL)


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
    return int64s(_table_address() + 8 * WORDS * number, WORDS)


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
            if _entry(candidate)[0] == 0 and _claim(_table_address() + 8 * WORDS * candidate, owner):
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
