"""The engine plugin: compiled callbacks that MuJoCo calls, registered without a compiler.

One plugin instance is one bed of sand; the bodies that name the instance feel it. MuJoCo is handed the addresses of
compiled functions only, which take no interpreter lock and keep no global state: what an instance remembers hangs on
its mjData (`plugin_data`), and what describes it lies in the model's numeric fields.

Those fields are found by name. A numeric is a body's surface, or a bed's parameters, where its name without the marker
is the body's, or the instance's, name; so MJCF attachment may put any prefix and suffix around both.
"""

import ctypes
import functools
from pathlib import Path
from typing import Any, Final

import mujoco
from numba import cfunc, njit, types

from rftsim import packed
from rftsim.compiled import SOURCE
from rftsim.engine import layout
from rftsim.engine.memory import (
    allocate,
    characters,
    doubles,
    int32s,
    int64s,
    pointer,
    release,
)

PLUGIN: Final = "rftsim.sand"
BODY_MARKER: Final = "rftsim-body:"
SAND_MARKER: Final = "rftsim-sand:"
WRENCH: Final = 6
"""Numbers of a sensor's wrench: force, then moment about the body's origin, in the world frame."""

_BODY_MARKER, _SAND_MARKER = BODY_MARKER.encode(), SAND_MARKER.encode()

# What hangs on mjData: int64 [number of bodies, numeric of the bed, (body, numeric of its surface) ...], then each
# body's last wrench as six float64.
_HEAD: Final = 2
_SIZE: Final = 8


@njit(forceinline=True)
def _is_marked(names, numeric, marker, owner):
    """Whether the name at `numeric` is the name at `owner` with the marker inserted somewhere."""
    same = 0
    while names[numeric + same] != 0 and names[numeric + same] == names[owner + same]:
        same += 1
    for start in range(same + 1):
        k = 0
        while k < len(marker) and names[numeric + start + k] == marker[k]:
            k += 1
        if k < len(marker):
            continue
        i = start
        while names[owner + i] != 0 and names[numeric + i + k] == names[owner + i]:
            i += 1
        if names[owner + i] == 0 and names[numeric + i + k] == 0:
            return True
    return False


@njit(forceinline=True)
def _find_numeric(model, m, marker, owner):
    names = characters(pointer(m + model.names))
    count = pointer(m + model.nnumeric)
    address = int32s(pointer(m + model.name_numericadr), count)
    for i in range(count):
        if _is_marked(names, address[i], marker, owner):
            return i
    return -1


@njit(forceinline=True)
def _numeric(model, m, i):
    count = pointer(m + model.nnumeric)
    start = int32s(pointer(m + model.numeric_adr), count)[i]
    size = int32s(pointer(m + model.numeric_size), count)[i]
    return doubles(pointer(m + model.numeric_data) + _SIZE * start, size)


@njit(forceinline=True)
def _slot(data, d, instance):
    """Where mjData keeps the address of an instance's memory, (1,)."""
    return int64s(pointer(d + data.plugin_data) + _SIZE * instance, 1)


@njit(forceinline=True)
def _own(address):
    """An instance's memory: its table, and its wrenches."""
    n = pointer(address)
    return int64s(address, _HEAD + 2 * n), doubles(address + _SIZE * (_HEAD + 2 * n), WRENCH * n)


@njit(forceinline=True)
def _init(model, data, m, d, instance):
    nbody = pointer(m + model.nbody)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    n = 0
    for body in range(nbody):
        n += plugins[body] == instance
    names = int32s(pointer(m + model.name_bodyadr), nbody)
    instances = int32s(pointer(m + model.name_pluginadr), pointer(m + model.nplugin))
    address = allocate(_HEAD + (2 + WRENCH) * n, _SIZE)
    if address == 0:
        return -1
    table = int64s(address, _HEAD + 2 * n)
    table[0] = n
    table[1] = _find_numeric(model, m, _SAND_MARKER, instances[instance])
    complete = table[1] >= 0
    k = _HEAD
    for body in range(nbody):
        if plugins[body] == instance:
            table[k] = body
            table[k + 1] = _find_numeric(model, m, _BODY_MARKER, names[body])
            complete = complete and table[k + 1] >= 0
            k += 2
    if not complete:
        release(address)
        return -1
    _slot(data, d, instance)[0] = address
    return 0


@njit(forceinline=True)
def _fill(target, origin):
    for i in range(target.size):  # a slice assignment would compile for seconds
        target[i] = origin[i]


@njit(forceinline=True)
def _clear(target):
    for i in range(target.size):
        target[i] = 0.0


@njit(forceinline=True)
def _copy(data, target, origin, instance):
    table, wrenches = _own(_slot(data, origin, instance)[0])
    address = allocate(table.size + wrenches.size, _SIZE)
    copied = int64s(address, table.size + wrenches.size)
    for i in range(table.size):
        copied[i] = table[i]
    _fill(doubles(address + _SIZE * table.size, wrenches.size), wrenches)
    _slot(data, target, instance)[0] = address


@njit(forceinline=True)
def _press(model, data, m, d, instance):
    """Evaluate the sand on every body of the instance and add it to qfrc_passive through the body's Jacobian."""
    table, wrenches = _own(_slot(data, d, instance)[0])
    sand = _numeric(model, m, table[1])
    nbody, nv = pointer(m + model.nbody), pointer(m + model.nv)
    parent = int32s(pointer(m + model.body_parentid), nbody)
    root = int32s(pointer(m + model.body_rootid), nbody)
    dofnum = int32s(pointer(m + model.body_dofnum), nbody)
    dofadr = int32s(pointer(m + model.body_dofadr), nbody)
    dof_parent = int32s(pointer(m + model.dof_parentid), nv)
    xpos = doubles(pointer(d + data.xpos), 3 * nbody)
    xmat = doubles(pointer(d + data.xmat), 9 * nbody)
    cvel = doubles(pointer(d + data.cvel), 6 * nbody)
    com = doubles(pointer(d + data.subtree_com), 3 * nbody)
    cdof = doubles(pointer(d + data.cdof), 6 * nv)
    force = doubles(pointer(d + data.qfrc_passive), nv)
    for k in range(table[0]):
        body = table[_HEAD + 2 * k]
        x = xpos[3 * body : 3 * body + 3]
        o = com[3 * root[body] : 3 * root[body] + 3]
        w = cvel[6 * body], cvel[6 * body + 1], cvel[6 * body + 2]  # MuJoCo's cvel: angular first
        r = x[0] - o[0], x[1] - o[1], x[2] - o[2]
        v = (
            cvel[6 * body + 3] + w[1] * r[2] - w[2] * r[1],
            cvel[6 * body + 4] + w[2] * r[0] - w[0] * r[2],
            cvel[6 * body + 5] + w[0] * r[1] - w[1] * r[0],
        )
        surface = _numeric(model, m, table[_HEAD + 2 * k + 1])
        fx, fy, fz, tx, ty, tz = packed.packed_wrench(sand, surface, x, xmat[9 * body : 9 * body + 9], v, w)
        wrench = wrenches[WRENCH * k : WRENCH * k + WRENCH]
        wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5] = fx, fy, fz, tx, ty, tz
        # moment about the point that cdof refers to
        tx, ty, tz = tx + r[1] * fz - r[2] * fy, ty + r[2] * fx - r[0] * fz, tz + r[0] * fy - r[1] * fx
        while body > 0 and dofnum[body] == 0:
            body = parent[body]
        dof = dofadr[body] + dofnum[body] - 1 if body > 0 else -1
        while dof >= 0:
            c = cdof[6 * dof : 6 * dof + 6]
            force[dof] += c[0] * tx + c[1] * ty + c[2] * tz + c[3] * fx + c[4] * fy + c[5] * fz
            dof = dof_parent[dof]


@njit(forceinline=True)
def _sense(model, data, m, d, instance):
    """Copy each body's wrench to the sensors that name it."""
    table, wrenches = _own(_slot(data, d, instance)[0])
    nsensor = pointer(m + model.nsensor)
    plugins = int32s(pointer(m + model.sensor_plugin), nsensor)
    objects = int32s(pointer(m + model.sensor_objid), nsensor)
    address = int32s(pointer(m + model.sensor_adr), nsensor)
    for sensor in range(nsensor):
        if plugins[sensor] != instance:
            continue
        out = doubles(pointer(d + data.sensordata) + _SIZE * address[sensor], WRENCH)
        for k in range(table[0]):
            if table[_HEAD + 2 * k] == objects[sensor]:
                _fill(out, wrenches[WRENCH * k : WRENCH * k + WRENCH])


_PASSIVE: Final = int(mujoco.mjtPluginCapabilityBit.mjPLUGIN_PASSIVE)


def _make(model: layout.Model, data: layout.Data, source: str) -> dict[str, Any]:
    """The callbacks by name, for one layout of MuJoCo's structs.

    `source` identifies the code that they compile from. Numba's cache distinguishes functions by what they close over,
    and does not see the functions that they call; so each callback closes over it.
    """

    @cfunc(types.intc(types.intp, types.intc), cache=True)
    def nstate(m, instance):
        return min(len(source), 0)

    @cfunc(types.intc(types.intp, types.intc, types.intc), cache=True)
    def nsensordata(m, instance, sensor):
        return min(len(source), WRENCH)

    @cfunc(types.intc(types.intp, types.intp, types.intc), cache=True)
    def init(m, d, instance):
        return _init(model, data, m, d, instance) if source else -1

    @cfunc(types.void(types.intp, types.intc), cache=True)
    def destroy(d, instance):
        slot = _slot(data, d, instance)
        if source:
            release(slot[0])
        slot[0] = 0

    @cfunc(types.void(types.intp, types.intp, types.intp, types.intc), cache=True)
    def copy(target, m, origin, instance):
        if source:
            _copy(data, target, origin, instance)

    @cfunc(types.void(types.intp, types.intp, types.intp, types.intc), cache=True)
    def reset(m, state, memory, instance):
        if source:
            _clear(_own(memory)[1])

    @cfunc(types.void(types.intp, types.intp, types.intc, types.intc), cache=True)
    def compute(m, d, instance, capability):
        if source and capability == _PASSIVE:
            _press(model, data, m, d, instance)
        else:
            _sense(model, data, m, d, instance)

    callbacks = (nstate, nsensordata, init, destroy, copy, reset, compute)
    return {callback.__name__: callback for callback in callbacks}


def stored_wrenches(address: int) -> "list[tuple[int, tuple[float, ...]]]":
    """Each body's id and last wrench, from what an instance keeps at `address`."""
    n = ctypes.c_int64.from_address(address).value
    table = (ctypes.c_int64 * (_HEAD + 2 * n)).from_address(address)
    numbers = (ctypes.c_double * (WRENCH * n)).from_address(address + ctypes.sizeof(table))
    return [(table[_HEAD + 2 * k], tuple(numbers[WRENCH * k : WRENCH * (k + 1)])) for k in range(n)]


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
def register() -> int:
    """Register the plugin with MuJoCo, once in a process.

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
    callbacks = _make(*layout.layout(), SOURCE)
    plugin = _Plugin.from_buffer(memory)
    plugin.name = PLUGIN.encode()
    plugin.capabilityflags = (
        mujoco.mjtPluginCapabilityBit.mjPLUGIN_PASSIVE | mujoco.mjtPluginCapabilityBit.mjPLUGIN_SENSOR
    )
    plugin.needstage = mujoco.mjtStage.mjSTAGE_VEL
    for name, callback in callbacks.items():
        setattr(plugin, name, callback.address)
    _keep.extend([plugin, callbacks])
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(_keep))  # mjData may be freed after this module at exit
    return int(library.mjp_registerPlugin(ctypes.byref(plugin)))
