"""Why a model's sand is refused, or gives no force, in the sentences that compiled code hands to MuJoCo.

Each names what is wrong and what would be right; `%s` stands for the name of a bed or a body.
"""

import ctypes
import functools
from typing import Final, NamedTuple

import llvmlite.binding as llvm

from rftsim.engine.seal import COUNTS, LARGEST, TOLERANCES
from rftsim.machine.registry import PLACES

_ANEW: Final = "make the model anew with rftsim.add_sand"


class Refusals(NamedTuple):
    """The sentences, of which compiled code knows the places."""

    none: str = "nothing is wrong with %s"
    state: str = (
        "rftsim's plugin cannot take bed '%s': it was made for the other force, or with more or fewer bodies. An MJB "
        "names plugins by number: import rftsim and other plugins in the order in which they were when it was saved, "
        "or load XML"
    )
    bed: str = f"rftsim's plugin finds no numbers of bed '%s', or not those that were written: {_ANEW}"
    bounds: str = (
        "rftsim's plugin cannot take bed '%s': its normal must be a unit vector that points upward, its parameters "
        f"finite, from 0 to {LARGEST:g}, its tolerance {TOLERANCES[0]:g} to {TOLERANCES[1]:g}, its iterations whole, "
        f"{COUNTS[0]} to {COUNTS[1]}"
    )
    terrain: str = f"rftsim's plugin finds no terrain of bed '%s', or not the shape that was written: {_ANEW}"
    surface: str = (
        "rftsim's plugin finds no surface of body '%s', or not the one that was written: numerics were taken away, "
        f"cut, renamed, moved or changed; {_ANEW}"
    )
    plugin: str = (
        "rftsim's plugin finds a surface of body '%s', which names no plugin and would feel no sand: delete the "
        f"numerics of that name, or {_ANEW}"
    )
    sensor: str = (
        f"rftsim's plugin finds a sensor on bed '%s' that has no room for a wrench, or names a body out of it: {_ANEW}"
    )
    memory: str = f"rftsim's plugin has no memory for bed '%s', or more than {PLACES} beds in the data of this process"
    changed: str = (
        "the numbers of bed '%s', of a surface in it, or of its plugin_state were changed to what none can be, so its "
        "force is NaN: what may be changed in place are the sand's parameters, see rftsim.instances"
    )
    exhausted: str = "there is no memory to solve for the force of bed '%s', so it is NaN"


WHY: Final = Refusals(*range(len(Refusals._fields)))
"""The place of each sentence."""
SYMBOL: Final = "rftsim_refusals"
"""Where compiled code finds their addresses."""


@functools.cache
def publish() -> None:
    """Make the sentences known to compiled code, for as long as the process lives."""
    texts = [ctypes.create_string_buffer(text.encode()) for text in Refusals()]
    table = (ctypes.c_int64 * len(texts))(*map(ctypes.addressof, texts))
    for kept in (texts, table):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))
    llvm.add_symbol(SYMBOL, ctypes.addressof(table))
