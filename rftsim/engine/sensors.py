"""MuJoCo's sensors on sand: the wrenches themselves, and what builtin sensors read.

MuJoCo computes its own sensors of forces first and asks plugins afterwards, so what it wrote is mended: `force` and
`torque` are read again from cfrc_int when the sand is in it (see `reactions`), and `touch` gets the sand's pressure
beside that of contacts (see `touch`).
"""

from typing import Any, Final, NamedTuple

from rftsim.engine import bodies, instance, reactions, touch
from rftsim.engine.layout import CONSTANTS
from rftsim.law.layout import WRENCH
from rftsim.law.vectors import cross, to_body
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int32s, pointer
from rftsim.solver import linear_algebra

_TOUCH: Final = CONSTANTS["touch"]
_FORCE: Final = CONSTANTS["force"]
_TORQUE: Final = CONSTANTS["torque"]


class Sensors(NamedTuple):
    """Views of a model's sensors: what each is, of what, and where its readings go."""

    kind: Any
    plugin: Any
    owner: Any
    start: Any
    cutoff: Any
    site_body: Any


@inline
def _sensors(model, m):
    """Views of mjModel's arrays, one number for each sensor, and the body of each site."""
    n = pointer(m + model.nsensor)
    return Sensors(
        int32s(pointer(m + model.sensor_type), n),
        int32s(pointer(m + model.sensor_plugin), n),
        int32s(pointer(m + model.sensor_objid), n),
        int32s(pointer(m + model.sensor_adr), n),
        doubles(pointer(m + model.sensor_cutoff), n),
        int32s(pointer(m + model.site_bodyid), pointer(m + model.nsite)),
    )


@exact
def _is_fresh(model, data, m, d, i):
    """Whether MuJoCo computed a sensor just now, instead of reading what it had kept of it."""
    n = pointer(m + model.nsensor)
    if int32s(pointer(m + model.sensor_history), 2 * n)[2 * i] <= 0:
        return True
    if doubles(pointer(m + model.sensor_delay), n)[i] > 0.0:
        return False  # computed at the end of the step, from the mended cfrc_int
    interval = doubles(pointer(m + model.sensor_interval), 2 * n)[2 * i]
    first = int32s(pointer(m + model.sensor_historyadr), n)[i]
    last = doubles(pointer(d + data.history) + 8 * first, 1)[0]
    return interval <= 0.0 or last + interval <= doubles(d + data.time, 1)[0]


@exact
def _carries(t, address, body):
    """Whether a body, or one that hangs on it, feels the sand of the block at an address."""
    for k in range(instance.head(address).nbody):
        felt = instance.body(address, k)
        while felt > body:
            felt = t.parent[felt]
        if felt == body:
            return True
    return False


@exact
def _read_wrench(model, data, m, d, address, body, start):
    """Copy a body's wrench to a sensor that names it and starts at a place of sensordata."""
    if not 0 <= start <= pointer(m + model.nsensordata) - WRENCH:
        return
    for k in range(instance.head(address).nbody):
        if instance.body(address, k) == body:
            out = doubles(pointer(d + data.sensordata) + 8 * start, WRENCH)
            linear_algebra.copy(instance.wrench(address, k), out)


@exact
def _read_reaction(model, data, m, d, t, site, body, wants_torque, out):
    """Read what a body's parent does to it from cfrc_int, about a site and in its frame: the force, or the torque."""
    c = doubles(pointer(d + data.cfrc_int) + 8 * WRENCH * body, WRENCH)
    x = doubles(pointer(d + data.site_xpos) + 8 * 3 * site, 3)
    turn = doubles(pointer(d + data.site_xmat) + 8 * 9 * site, 9)
    f = c[3], c[4], c[5]
    if wants_torque:
        s = cross(bodies.arm(t, body, x), f)
        f = c[0] - s[0], c[1] - s[1], c[2] - s[2]
    out[0], out[1], out[2] = to_body(turn, f[0], f[1], f[2])


@exact
def _cut(out, cutoff):
    """Keep readings within a cutoff, as MuJoCo does; where it is zero, there is none."""
    if cutoff > 0.0:
        for i in range(out.size):
            out[i] = max(min(out[i], cutoff), -cutoff)


@inline
def read_wrenches(model, data, m, d, number):
    """Read the wrench on each body that a sensor of an instance names."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0:
        return
    all_sensors = _sensors(model, m)
    for i in range(all_sensors.plugin.size):
        if all_sensors.plugin[i] == number:
            _read_wrench(model, data, m, d, address, all_sensors.owner[i], all_sensors.start[i])


@inline
def read(model, data, m, d, number, is_implicit):
    """Read the wrenches on an instance's bodies, and mend every sensor of MuJoCo's that they concern."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0:
        return
    all_sensors, readings = _sensors(model, m), pointer(d + data.sensordata)
    t = bodies.tree(model, data, m, d)
    reactions.add_sand(data, d, t, address)
    for i in range(all_sensors.kind.size):
        kind, owner, place = all_sensors.kind[i], all_sensors.owner[i], readings + 8 * all_sensors.start[i]
        if all_sensors.plugin[i] == number:
            _read_wrench(model, data, m, d, address, owner, all_sensors.start[i])
        if kind != _TOUCH and kind != _FORCE and kind != _TORQUE:
            continue
        body = all_sensors.site_body[owner]
        if not (_carries(t, address, body) and _is_fresh(model, data, m, d, i)):
            continue
        out = doubles(place, 1 if kind == _TOUCH else 3)
        if kind == _TOUCH:
            out[0] += touch.pressed(model, data, m, d, t, address, owner, is_implicit)
        else:
            _read_reaction(model, data, m, d, t, owner, body, kind == _TORQUE, out)
        _cut(out, all_sensors.cutoff[i])
