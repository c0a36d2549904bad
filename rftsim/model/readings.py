"""Sensors that cannot read the sand: what MuJoCo computes where nothing of it can be put in."""

from collections.abc import Iterable

import mujoco

from rftsim.engine import plugin

_OBJECT = mujoco.mjtObj
_SENSOR = mujoco.mjtSensor
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_ACC = int(mujoco.mjtStage.mjSTAGE_ACC)
_OF_CONTACTS = frozenset(
    int(getattr(_SENSOR, name)) for name in ("mjSENS_CONTACT", "mjSENS_TACTILE") if hasattr(_SENSOR, name)
)


def reading_doubts(model: mujoco.MjModel, felt: Iterable[int]) -> list[str]:
    """Say which sensors of a model do not read the sand as they would read rigid ground, and why.

    Args:
        model: The compiled model, with its sand or before it is put there.
        felt: Ids of the bodies that feel the sand.

    Returns:
        At most one sentence or two for each kind of sensor; none where all read what they should.
    """
    bodies = frozenset(felt)
    watching = [i for i in range(model.nsensor) if _watches(model, i, bodies)]
    touch = [i for i in watching if model.sensor_type[i] == _SENSOR.mjSENS_TOUCH]
    found = [
        (
            [i for i in watching if int(model.sensor_type[i]) in _OF_CONTACTS],
            "reads contacts between geoms, of which the sand makes none, so it reads nothing of the sand: "
            "use touch sensors, or the wrench `<body>_sand`",
        ),
        (
            [i for i in touch if _delay(model, i) > 0.0],
            "is a touch sensor with a delay, which MuJoCo fills from contacts alone: take its delay away",
        ),
        (
            [i for i in touch if model.site_type[model.sensor_objid[i]] == _MESH],
            "is a touch sensor whose zone is a mesh, in which the sand's pressure is not looked for: use a box or an "
            "ellipsoid",
        ),
        (
            [i for i in watching if model.sensor_type[i] == _SENSOR.mjSENS_PLUGIN and _is_others(model, i)],
            "belongs to another plugin, which knows contacts at best and not the sand",
        ),
        (
            [i for i in range(model.nsensor) if _is_user(model, i)],
            "is a user sensor of stage acc, and its callback runs before the sand is put in cfrc_ext and cfrc_int: "
            "call rne_post_constraint there",
        ),
    ]
    doubts = [f"sensor {_named(model, sensors)} {why}" for sensors, why in found if sensors]
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SENSOR:
        doubts.append(
            "the model disables sensors, so none reads the sand, and cfrc_ext and cfrc_int hold it only after "
            "rne_post_constraint"
        )
    return doubts


def _watches(model: mujoco.MjModel, sensor: int, felt: frozenset[int]) -> bool:
    """Whether a sensor's object, or what that is related to, is a felt body, a part of one, or anything at all."""
    named = [
        (int(kind), int(index))
        for kind, index in (
            (model.sensor_objtype[sensor], model.sensor_objid[sensor]),
            (model.sensor_reftype[sensor], model.sensor_refid[sensor]),
        )
        if kind != _OBJECT.mjOBJ_UNKNOWN and index >= 0
    ]
    return not named or any(_concerns(model, kind, index, felt) for kind, index in named)


def _concerns(model: mujoco.MjModel, kind: int, index: int, felt: frozenset[int]) -> bool:
    """Whether an object is a body that feels the sand, or a part of one; of a subtree, whether it has one."""
    if kind == _OBJECT.mjOBJ_XBODY:
        return any(index in _path(model, body) for body in felt)
    owners = {_OBJECT.mjOBJ_GEOM: model.geom_bodyid, _OBJECT.mjOBJ_SITE: model.site_bodyid}
    if kind in owners:
        return int(owners[_OBJECT(kind)][index]) in felt
    return kind == _OBJECT.mjOBJ_BODY and index in felt


def _path(model: mujoco.MjModel, body: int) -> list[int]:
    """A body and all that it hangs on, down to the world."""
    path = [body]
    while path[-1] > 0:
        path.append(int(model.body_parentid[path[-1]]))
    return path


def _delay(model: mujoco.MjModel, sensor: int) -> float:
    """The delay of a sensor [s]; none where this MuJoCo knows no delays."""
    return float(model.sensor_delay[sensor]) if hasattr(model, "sensor_delay") else 0.0


def _is_others(model: mujoco.MjModel, sensor: int) -> bool:
    """Whether a sensor is computed by a plugin that is not this package's."""
    return model.plugin[model.sensor_plugin[sensor]] not in plugin.slots()


def _is_user(model: mujoco.MjModel, sensor: int) -> bool:
    """Whether a sensor is filled by a callback of the user's, at the stage of forces."""
    return bool(model.sensor_type[sensor] == _SENSOR.mjSENS_USER and model.sensor_needstage[sensor] == _ACC)


def _named(model: mujoco.MjModel, sensors: list[int]) -> str:
    """The first of some sensors by name or number, and how many there are beside it."""
    name = model.sensor(sensors[0]).name
    more = f" (and {len(sensors) - 1} more)" if len(sensors) > 1 else ""
    return (repr(name) if name else str(sensors[0])) + more
