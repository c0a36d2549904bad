"""The engine plugin: compiled callbacks that MuJoCo calls, registered without a compiler.

One plugin instance is one bed of sand; the bodies that name the instance feel it. MuJoCo is handed the addresses of
compiled functions only, which take no interpreter lock and keep no global state.
"""

import ctypes
import functools
from pathlib import Path
from typing import Any, Final

import mujoco
from numba import cfunc, njit, types

from rftsim import registry
from rftsim.compiled import SOURCE
from rftsim.engine import explicit, instance, layout
from rftsim.engine.external import link
from rftsim.memory import doubles, int32s, pointer

EXPLICIT: Final = "rftsim.sand"
IMPLICIT: Final = "rftsim.sand.implicit"
"""The two plugins: the force at the velocity of the moment, and the one at the end of the step."""

_RK4: Final = int(mujoco.mjtIntegrator.mjINT_RK4)
_PASSIVE: Final = int(mujoco.mjtPluginCapabilityBit.mjPLUGIN_PASSIVE)


@njit
def _sense(model, data, m, d, number):
    """Copy each body's wrench to the sensors that name it."""
    address = instance.block_of(model, data, m, d, number)
    table, wrenches = instance.table(address), instance.wrenches(address)
    nsensor = pointer(m + model.nsensor)
    plugins = int32s(pointer(m + model.sensor_plugin), nsensor)
    objects = int32s(pointer(m + model.sensor_objid), nsensor)
    start = int32s(pointer(m + model.sensor_adr), nsensor)
    for sensor in range(nsensor):
        if plugins[sensor] != number:
            continue
        out = doubles(pointer(d + data.sensordata) + instance.SIZE * start[sensor], instance.WRENCH)
        for k in range(table[0]):
            if table[instance.HEAD + 2 * k] == objects[sensor]:
                for i in range(instance.WRENCH):
                    out[i] = wrenches[instance.WRENCH * k + i]


def _make(model: layout.Model, data: layout.Data, source: str) -> tuple[Any, ...]:
    """The callbacks that both plugins have, for one layout of MuJoCo's structs.

    `source` identifies the code that they compile from. Numba's cache distinguishes functions by what they close over,
    and does not see the functions that they call; so each callback closes over it.
    """

    @cfunc(types.intc(types.intp, types.intc, types.intc), cache=True)
    def nsensordata(m, number, sensor):
        return min(len(source), instance.WRENCH)

    @cfunc(types.intc(types.intp, types.intp, types.intc), cache=True)
    def init(m, d, number):
        return instance.initialise(model, data, m, d, number) if source else -1

    @cfunc(types.void(types.intp, types.intc), cache=True)
    def destroy(d, number):
        if source:
            instance.destroy(data, d, number)

    @cfunc(types.void(types.intp, types.intp, types.intp, types.intc), cache=True)
    def copy(target, m, origin, number):
        if source:
            instance.copy(model, data, target, m, origin, number)

    @cfunc(types.void(types.intp, types.intp, types.intp, types.intc), cache=True)
    def reset(m, state, memory, number):
        if source:
            block = registry.address(memory) if 0 <= memory < registry.SIZE else 0
            if block != 0:
                instance.forget(block)
            lasting = doubles(state, instance.state_size(model, m, number))
            for i in range(lasting.size):
                lasting[i] = 0.0

    @cfunc(types.void(types.intp, types.intp, types.intc), cache=True)
    def advance(m, d, number):
        if source:
            instance.keep(model, data, m, d, number)

    return nsensordata, init, destroy, copy, reset, advance


def _make_explicit(model: layout.Model, data: layout.Data, source: str) -> tuple[Any, ...]:
    @cfunc(types.intc(types.intp, types.intc), cache=True)
    def nstate(m, number):
        return min(len(source), 0)

    @cfunc(types.void(types.intp, types.intp, types.intc, types.intc), cache=True)
    def compute(m, d, number, capability):
        if source and capability == _PASSIVE:
            explicit.press(model, data, m, d, number)
        else:
            _sense(model, data, m, d, number)

    return nstate, compute


def _make_implicit(model: layout.Model, data: layout.Data, contact: layout.Contact, source: str) -> tuple[Any, ...]:
    from rftsim.engine import implicit  # compiles for minutes where it is not cached

    @cfunc(types.intc(types.intp, types.intc), cache=True)
    def nstate(m, number):
        return instance.wanted_state(model, m, number) if source else 0

    @cfunc(types.void(types.intp, types.intp, types.intc, types.intc), cache=True)
    def compute(m, d, number, capability):
        if not source or capability != _PASSIVE:
            _sense(model, data, m, d, number)
        elif int32s(m + model.opt_integrator, 1)[0] == _RK4:
            explicit.press(model, data, m, d, number)
        else:
            implicit.press(model, data, contact, m, d, number)

    return nstate, compute


class _Plugin(ctypes.Structure):
    """mjpPlugin, as mjplugin.h declares it."""

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


def _library() -> ctypes.CDLL:
    """MuJoCo's own shared library, which is loaded already."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise layout.LayoutError(f"no MuJoCo library beside {mujoco.__file__}")


_keep: list[Any] = []  # MuJoCo holds addresses of what is here, so it is never released


@functools.cache
def register(name: str) -> int:
    """Register one of the plugins with MuJoCo, once in a process.

    Returns:
        The plugin's slot.

    Raises:
        LayoutError: This MuJoCo lays out its structs otherwise than it describes them.
    """
    library = _library()
    size = ctypes.sizeof(_Plugin)
    memory = ctypes.create_string_buffer(b"\xff" * (size + 64), size + 64)
    library.mjp_defaultPlugin(memory)
    if memory.raw[:size].strip(b"\0") or memory.raw[size : size + 8] != b"\xff" * 8:
        raise layout.LayoutError(f"MuJoCo {mujoco.__version__} has another mjpPlugin; rftsim needs mujoco>=3.17,<4")
    link(library)
    model, data, contact = layout.layout()
    if name == EXPLICIT:
        callbacks = (*_make(model, data, SOURCE), *_make_explicit(model, data, SOURCE))
    else:
        callbacks = (*_make(model, data, SOURCE), *_make_implicit(model, data, contact, SOURCE))
    plugin = _Plugin.from_buffer(memory)
    plugin.name = name.encode()
    bits = mujoco.mjtPluginCapabilityBit
    plugin.capabilityflags = bits.mjPLUGIN_PASSIVE | bits.mjPLUGIN_SENSOR
    plugin.needstage = mujoco.mjtStage.mjSTAGE_VEL
    for callback in callbacks:
        setattr(plugin, callback.__name__, callback.address)
    _keep.append((plugin, callbacks))
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(_keep))  # mjData may be freed after this module at exit
    return int(library.mjp_registerPlugin(ctypes.byref(plugin)))
