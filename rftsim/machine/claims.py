"""The registry's places for compiled code: found, claimed and given back, from any thread."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rftsim.machine.compiling import exact
from rftsim.machine.memory import allocate, named_address, release
from rftsim.machine.records import record_at
from rftsim.machine.registry import PLACE, PLACES, SYMBOL

_table_address = named_address(SYMBOL)
_place_at = record_at(PLACE)
_BYTES = PLACE.itemsize


@intrinsic
def _claim(typing_context: Any, address: Any, owner: Any) -> Any:
    """Write an owner where there is none; whether that succeeded. Atomic."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        pointer = builder.inttoptr(arguments[0], word.as_pointer())
        pair = builder.cmpxchg(pointer, ir.Constant(word, 0), arguments[1], "seq_cst", "seq_cst")
        return builder.extract_value(pair, 1)

    return types.boolean(types.intp, types.int64), generate


@exact
def _is_own(number, owner, which):
    """Whether a place is that of an owner's memory."""
    place = _place_at(_table_address() + _BYTES * number)
    return place.owner == owner and place.which == which


@exact
def find(hint, owner, which):
    """The number of an owner's place, or -1; `hint` is looked at first."""
    if 0 <= hint < PLACES and _is_own(hint, owner, which):
        return hint
    start = (owner >> 4) % PLACES
    for k in range(PLACES):
        number = (start + k) % PLACES
        if _is_own(number, owner, which):
            return number
    return -1


@exact
def _take(owner):
    """The number of a free place that an owner has claimed now, or -1 where there is none left."""
    start = (owner >> 4) % PLACES
    for k in range(PLACES):
        candidate = (start + k) % PLACES
        at = _table_address() + _BYTES * candidate
        if _place_at(at).owner == 0 and _claim(at, owner):  # the owner is a place's first word
            return candidate
    return -1


@exact
def make(hint, owner, which, words):
    """Allocate `words` zeroed words for an owner, or keep its memory if the size matches.

    Returns:
        The number of the owner's place, or -1 where there is no place or no memory left.
    """
    number = find(hint, owner, which)
    if number < 0:
        number = _take(owner)
        if number < 0:
            return -1
        _place_at(_table_address() + _BYTES * number).which = which
    place = _place_at(_table_address() + _BYTES * number)
    if place.address == 0 or place.words != words:
        release(place.address)
        place.address, place.words = allocate(words, 8), words
    return number if place.address != 0 else -1


@exact
def address(number):
    """The address of the memory of a place."""
    return _place_at(_table_address() + _BYTES * number).address


@exact
def words(number):
    """The size of the memory of a place, in words."""
    return _place_at(_table_address() + _BYTES * number).words


@exact
def drop(number):
    """Release a place and its memory."""
    place = _place_at(_table_address() + _BYTES * number)
    memory = place.address
    place.which = place.address = place.words = 0
    place.owner = 0  # last: from here on it may be claimed
    release(memory)
