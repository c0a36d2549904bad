"""The offsets of `layout`, as compiled code reads them when it runs, so that it fits any layout."""

from typing import Final

from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple

from rftsim.engine.layout import SYMBOL, Contact, Data, Model
from rftsim.memory import int64s, named_address

_MODEL: Final = len(Model._fields)
_DATA: Final = len(Data._fields)
_CONTACT: Final = len(Contact._fields)
_place = named_address(SYMBOL)


@njit(forceinline=True)
def model():
    """Offsets in mjModel."""
    return Model(*to_fixed_tuple(int64s(_place(), _MODEL), _MODEL))


@njit(forceinline=True)
def data():
    """Offsets in mjData."""
    return Data(*to_fixed_tuple(int64s(_place() + 8 * _MODEL, _DATA), _DATA))


@njit(forceinline=True)
def contact():
    """Offsets in mjContact."""
    return Contact(*to_fixed_tuple(int64s(_place() + 8 * (_MODEL + _DATA), _CONTACT), _CONTACT))
