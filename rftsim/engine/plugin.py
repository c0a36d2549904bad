"""The engine plugin: compiled callbacks that MuJoCo calls, registered without a compiler.

One plugin instance is one bed of sand; the bodies that name the instance feel it. MuJoCo is handed the addresses of
compiled functions only, which take no interpreter lock and keep no global state.
"""

import ctypes
import functools
from typing import Any, Final

import mujoco

from rftsim.engine import layout
from rftsim.law import evaluate
from rftsim.law.layout import GIVEN
from rftsim.machine import link

EXPLICIT: Final = "rftsim.sand"
IMPLICIT: Final = "rftsim.sand.implicit"
"""The two plugins: the force at the velocity of the moment, and the one at the end of the step."""
RUTS: Final = "ruts"
"""The attribute of an instance whose bed remembers: how many numbers of plugin_state that takes. MuJoCo asks for the
size of the state before it has the model's numerics."""


class Plugin(ctypes.Structure):
    """The struct mjpPlugin, as mjplugin.h declares it."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("nattribute", ctypes.c_int),
        ("attributes", ctypes.c_void_p),
        ("capabilityflags", ctypes.c_int),
        ("needstage", ctypes.c_int),
        *(
            (name, ctypes.c_void_p)
            for name in (
                *("nstate", "nsensordata", "init", "destroy", "copy", "reset", "compute", "advance", "visualize"),
                *("actuator_act_dot", "sdf_distance", "sdf_gradient", "sdf_staticdistance", "sdf_attribute"),
                "sdf_aabb",
            )
        ),
    ]


_keep: list[Any] = []  # MuJoCo holds addresses of what is here, so it is never released


def slots() -> frozenset[int]:
    """The slots of both plugins, as a model's `plugin` names that of each of its instances."""
    return frozenset(register(name) for name in (EXPLICIT, IMPLICIT))


@functools.cache
def register(name: str) -> int:
    """Register one of the plugins with MuJoCo, once in a process.

    Returns:
        The plugin's slot.

    Raises:
        LayoutError: This MuJoCo lays out its structs otherwise than it describes them.
    """
    library = layout.library()
    size = ctypes.sizeof(Plugin)
    memory = ctypes.create_string_buffer(b"\xff" * (size + 64), size + 64)
    library.mjp_defaultPlugin(memory)
    if memory.raw[:size].strip(b"\0") or memory.raw[size : size + 8] != b"\xff" * 8:
        raise layout.LayoutError(f"MuJoCo {mujoco.__version__} has another mjpPlugin; rftsim needs mujoco>=3.5,<5")
    layout.publish()
    evaluate.linked()  # which the solver calls by name, and the engine both
    link.load("solver", GIVEN)("rftsim_step")
    address = link.load("engine", layout.GIVEN)
    plugin = Plugin.from_buffer(memory)
    plugin.name = name.encode()
    bits = mujoco.mjtPluginCapabilityBit
    plugin.capabilityflags = bits.mjPLUGIN_PASSIVE | bits.mjPLUGIN_SENSOR
    plugin.needstage = mujoco.mjtStage.mjSTAGE_ACC  # when MuJoCo has read the sensors of forces that are mended
    kind = "explicit" if name == EXPLICIT else "implicit"
    attributes = (ctypes.c_char_p * 1)(RUTS.encode())
    plugin.nattribute, plugin.attributes = len(attributes), ctypes.addressof(attributes)
    for field in ("nsensordata", "destroy", "copy", "reset", "advance"):
        setattr(plugin, field, address(f"rftsim_{field}"))
    for field in ("nstate", "init", "compute"):
        setattr(plugin, field, address(f"rftsim_{kind}_{field}"))
    _keep.extend((plugin, attributes))
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(_keep))  # mjData may be freed after this module at exit
    return int(library.mjp_registerPlugin(ctypes.byref(plugin)))
