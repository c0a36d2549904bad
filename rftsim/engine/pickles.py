"""Pickles of models and data with sand: whoever reads them imports rftsim first, so that its plugins are there.

MuJoCo's pickles name plugins by the slot that each has in its process. So what is pickled says beside it which plugin
each slot held, and is refused where that is another.
"""

import copyreg
import ctypes
from typing import Any

import mujoco

from rftsim.engine import layout, plugin
from rftsim.errors import SceneError

Pickled = tuple[Any, ...]


def register() -> None:
    """Have pickle ask this module how models and data are pickled; those without sand are as ever."""
    copyreg.pickle(mujoco.MjModel, _reduced)
    copyreg.pickle(mujoco.MjData, _reduced)


def restore(kind: Any, state: Any, slots: dict[int, str]) -> Any:
    """A model or data from its pickle.

    Args:
        kind: MjModel or MjData.
        state: What MuJoCo pickled.
        slots: Name of the plugin of each slot that it names.

    Raises:
        SceneError: Another plugin has such a slot in this process.
    """
    for slot, name in slots.items():
        if (found := _plugin_at(slot)) != name:
            raise SceneError(
                f"the pickle names plugin {name!r} by its slot {slot}, which is {found or 'empty'} in this process: "
                "import what registers plugins in the same order, or pass the model as XML"
            )
    restored = kind.__new__(kind)
    restored.__setstate__(state)
    return restored


def _reduced(owner: Any) -> Pickled:
    """What pickle keeps of a model or data."""
    slots = {int(slot): _plugin_at(int(slot)) for slot in owner.plugin}
    if plugin.slots().isdisjoint(slots):
        return owner.__reduce_ex__(2)  # type: ignore[no-any-return]
    return restore, (type(owner), owner.__getstate__(), slots)


def _plugin_at(slot: int) -> str:
    """The name of the plugin that has a slot in this process; empty where none has it."""
    find = layout.library().mjp_getPluginAtSlot
    find.argtypes, find.restype = [ctypes.c_int], ctypes.c_void_p
    address = find(slot)
    name = plugin.Plugin.from_address(address).name if address else b""
    return name.decode()
