"""The offsets of `layout`, as compiled code reads them when it runs, so that it fits any layout."""

from typing import Final

from numba import types

from rftsim.engine.layout import SYMBOL, Contact, Data, Model
from rftsim.machine.compiling import inline
from rftsim.machine.memory import named_address, tuples

_MODEL: Final = len(Model._fields)
_DATA: Final = len(Data._fields)
_CONTACT: Final = len(Contact._fields)
_place = named_address(SYMBOL)
_read_model, _read_data, _read_contact = (tuples(size, types.int64) for size in (_MODEL, _DATA, _CONTACT))


@inline
def model():
    """The byte offsets of fields in mjModel."""
    return Model(*_read_model(_place()))


@inline
def data():
    """The byte offsets of fields in mjData."""
    return Data(*_read_data(_place() + 8 * _MODEL))


@inline
def contact():
    """The byte offsets of fields in mjContact, and its size."""
    return Contact(*_read_contact(_place() + 8 * (_MODEL + _DATA)))
