"""Somebody's robot on legs, read from a model file: its base, joints, actuators, feet and pose, alone in the world."""

import fnmatch
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from rftsim_models import parts

from rftsim.errors import SceneError
from rftsim.model.add_sand import read_spec
from rftsim.model.poses import posed
from rftsim_envs.physics import Array
from rftsim_envs.task import ConfigError

_GEOM, _JOINT = mujoco.mjtGeom, mujoco.mjtJoint
START: Final = "start"
"""Name of the keyframe in which the robot stands, the only one that is left."""
CAMERA: Final = "follow"
"""Name of the camera that follows the robot."""
AWAY: Final = 3.2
"""Distance of that camera, over the robot's length."""
NEAR: Final = 0.05
"""Height over the lowest point up to which a body is a foot, over the base's height."""
DOWN: Final = np.array([0.0, 0.0, -1.0])
"""The way down, (3,)."""
POSE: Final = "rftsim_pose"
"""Name of a keyframe that a pose has while it is read."""
UPRIGHT: Final = 0.97
"""Cosine of the lean of the base's z axis in the pose beyond which it is no measure of tipping over."""


class Choice(NamedTuple):
    """Choices that a user makes of what is in a robot's file; empty texts and tuples stand for what is found."""

    base: str = ""
    """Name of the body with the free joint."""
    joints: tuple[str, ...] = ()
    """Names of the joints that are driven; patterns as `*_knee` serve."""
    feet: tuple[str, ...] = ()
    """Names of the bodies that stand on the ground, or patterns."""
    keyframe: str = ""
    """Name or number of the keyframe that is the pose."""
    pose: tuple[str, ...] = ()
    """Positions of joints in the pose, as `*_knee=-1.2` [rad or m]."""


class Robot(NamedTuple):
    """A robot that stands over level ground at z = 0, with nothing else in the world."""

    spec: mujoco.MjSpec
    """Its model, whose first keyframe is the pose with its lowest point at z = 0."""
    base: str
    """Name of the body with the free joint."""
    joints: tuple[str, ...]
    """Names of the hinges and slides that are driven, or of all where none were named."""
    driven: tuple[str, ...]
    """Names of the actuators that actions move."""
    feet: tuple[str, ...]
    """Names of the bodies that stand on the ground."""
    soles: Array
    """The lowest point of each foot in the pose, in its body's axes [m], (nfeet, 3)."""
    length: float
    """Its length along its heading in the pose [m]."""
    height: float
    """Height of the base over the lowest point in the pose [m]."""


def read_robot(path: "str | Path", choice: Choice) -> Robot:
    """Read a robot from an MJCF or URDF file, and take all else out of its world.

    Raises:
        ConfigError: It is no robot whose base is free and that is driven, or what was named is not there.
    """
    spec = _read(path)
    base = _base(spec, choice.base, str(path))
    _leave_alone(spec, base)
    _name_all(spec)
    model, data = _posed(spec, choice, str(path))
    _check_upright(data, base)
    joints, driven = _driven(model, choice.joints)
    low = _lowest(model, data)
    ground = min(float(point[2]) for point in low.values())
    data.qpos[2] -= ground
    feet = _feet(low, choice.feet, ground, float(data.qpos[2]))
    soles = np.array([(low[foot] - data.body(foot).xpos) @ data.body(foot).xmat.reshape(3, 3) for foot in feet])
    robot = Robot(spec, base, joints, driven, feet, soles, _length(model, data, base), float(data.qpos[2]))
    _write_start(spec, data, robot)
    return robot


def _read(path: "str | Path") -> mujoco.MjSpec:
    if not Path(path).is_file():
        raise ConfigError(f"no model file {path}: model takes the path of a robot's MJCF or URDF")
    try:
        return read_spec(path)
    except ValueError as error:
        raise ConfigError(f"{path} is no model of MuJoCo's: {' '.join(str(error).split())}") from None


def _base(spec: mujoco.MjSpec, name: str, path: str) -> str:
    """The name of the body that bears the robot: the one with a free joint, and the most of them hanging on it."""
    free = [joint.parent for joint in spec.joints if joint.type == _JOINT.mjJNT_FREE]
    if not free:
        raise ConfigError(f"{path} has no body with a free joint: a robot that walks has a base with <freejoint/>")
    for number, body in enumerate(free):
        body.name = body.name or f"base_{number}"
    names = {body.name: len(body.find_all("body")) for body in free}
    if name and name not in names:
        raise ConfigError(f"base {name!r} has no free joint; bodies with one are {', '.join(names)}")
    return name or max(names, key=lambda one: names[one])


def _leave_alone(spec: mujoco.MjSpec, base: str) -> None:
    """Take all bodies and geoms out of the world but the robot's, and all keyframes that no longer fit."""
    others = [body for body in spec.worldbody.bodies if body.name != base]
    for body in others:
        spec.delete(body)
    for geom in list(spec.worldbody.geoms):
        spec.delete(geom)
    if any(body.find_all("joint") for body in others):
        for key in list(spec.keys):
            spec.delete(key)


def _name_all(spec: mujoco.MjSpec) -> None:
    """Give a name to each body, joint and actuator that has none."""
    for kind, elements in (("body", spec.bodies), ("joint", spec.joints), ("actuator", spec.actuators)):
        taken = {element.name for element in elements}
        for number, element in enumerate(elements):
            if not element.name:
                element.name = next(n for n in _candidates(kind, number, element) if n not in taken)
                taken.add(element.name)


def _candidates(kind: str, number: int, element: Any) -> Iterable[str]:
    if kind == "actuator" and element.target:
        yield element.target
    yield f"{kind}_{number}"
    yield f"unnamed_{kind}_{number}"


def _posed(spec: mujoco.MjSpec, choice: Choice, path: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The compiled robot, and data in its pose, with controls that hold it and where everything is."""
    try:
        model = spec.compile()
        data = posed(model, choice.keyframe or None)
        if choice.pose:
            _bend(model, data, choice.pose)
            spec.add_key(name=POSE, qpos=data.qpos)
            model = spec.compile()
            data = posed(model, POSE)
    except (SceneError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{path}: {' '.join(str(error).split())}") from None
    mujoco.mj_kinematics(model, data)
    return model, data


def _bend(model: mujoco.MjModel, data: mujoco.MjData, pose: Sequence[str]) -> None:
    """Move the joints that a pose names."""
    names = [model.joint(i).name for i in _scalar(model)]
    for word in pose:
        pattern, _, value = word.partition("=")
        try:
            position = float(value)
        except ValueError:
            position = math.nan
        if not math.isfinite(position):
            raise ConfigError(f"pose takes JOINT=POSITION, as {names[0] if names else 'knee'}=0.5, not {word!r}")
        for name in _matching((pattern,), names, "joint"):
            data.qpos[model.joint(name).qposadr[0]] = position


def _scalar(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Ids of the hinges and slides."""
    return np.flatnonzero(np.isin(model.jnt_type, [int(_JOINT.mjJNT_HINGE), int(_JOINT.mjJNT_SLIDE)]))


def _matching(patterns: Sequence[str], names: Sequence[str], kind: str) -> tuple[str, ...]:
    """The names that patterns match, each once, in the order of the patterns.

    Raises:
        ConfigError: A pattern matches none.
    """
    found: dict[str, None] = {}
    for pattern in patterns:
        matched = [name for name in names if fnmatch.fnmatchcase(name, pattern)]
        if not matched:
            raise ConfigError(f"no {kind} {pattern!r}; the robot has {', '.join(names) or 'none'}")
        found |= dict.fromkeys(matched)
    return tuple(found)


def _driven(model: mujoco.MjModel, patterns: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the joints that are observed and of the actuators that actions move.

    Raises:
        ConfigError: Nothing drives the robot, or one of the joints that were named.
    """
    names = [model.joint(i).name for i in _scalar(model)]
    joints = _matching(patterns, names, "joint")
    at = {
        model.actuator(a).name: model.joint(model.actuator_trnid[a, 0]).name
        for a in range(model.nu)
        if model.actuator_trntype[a] in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    }
    if not model.nu:
        joint = names[0] if names else "knee"
        raise ConfigError(f'the robot has no actuators: give its joints some, as <position joint="{joint}" kp="100"/>')
    if not joints:
        return tuple(names), tuple(model.actuator(a).name for a in range(model.nu))
    idle = [joint for joint in joints if joint not in at.values()]
    if idle:
        moved = ", ".join(dict.fromkeys(at.values())) or "none"
        raise ConfigError(f"no actuator drives {', '.join(idle)}; joints with one are {moved}")
    return joints, tuple(actuator for joint in joints for actuator, moved in at.items() if moved == joint)


def _lowest(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array]:
    """The lowest point of each body that collides, world frame [m], (3,), by name."""
    found: dict[str, Array] = {}
    for geom in _colliding(model):
        name, point = model.body(model.geom_bodyid[geom]).name, support(model, data, geom, DOWN)
        if name not in found or point[2] < found[name][2]:
            found[name] = point
    return found


def support(model: mujoco.MjModel, data: mujoco.MjData, geom: int, way: Array) -> Array:
    """The farthest point of a geom along a unit vector, both in the world frame [m], (3,)."""
    kind, size, turn = _GEOM(model.geom_type[geom]), model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
    along = way @ turn
    if kind == _GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        local = points[np.argmax(points @ along)]
    elif kind == _GEOM.mjGEOM_BOX:
        local = size * np.sign(along)
    elif kind == _GEOM.mjGEOM_ELLIPSOID:
        local = size**2 * along / np.linalg.norm(size * along)
    elif kind == _GEOM.mjGEOM_CYLINDER:
        across = np.array([*along[:2], 0.0]) / max(float(np.hypot(*along[:2])), 1e-12)
        local = size[0] * across + np.array([0.0, 0.0, size[1] * np.sign(along[2])])
    else:  # a sphere, or a capsule
        half = size[1] if kind == _GEOM.mjGEOM_CAPSULE else 0.0
        local = size[0] * along + np.array([0.0, 0.0, half * np.sign(along[2])])
    point: Array = data.geom_xpos[geom] + turn @ local
    return point


def _colliding(model: mujoco.MjModel) -> list[int]:
    """Ids of the geoms that collide and can move.

    Raises:
        ConfigError: There is none.
    """
    colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    found = np.flatnonzero(colliding & (model.body_weldid[model.geom_bodyid] != 0)).tolist()
    if not found:
        raise ConfigError("no geom of the robot collides (contype and conaffinity are all 0), so it cannot stand")
    return [int(geom) for geom in found]


def _check_upright(data: mujoco.MjData, base: str) -> None:
    up = float(data.body(base).xmat[8])
    if up < UPRIGHT:
        raise ConfigError(
            f"the z axis of {base} leans by {math.degrees(math.acos(max(up, -1.0))):.0f} degrees in the pose; it "
            "has to point up, as tipping over is told by it: take another keyframe"
        )


def _feet(low: dict[str, Array], patterns: Sequence[str], ground: float, height: float) -> tuple[str, ...]:
    """The bodies that were named as feet, or those that are as low as the lowest one, within a share of the height."""
    if patterns:
        return _matching(patterns, list(low), "colliding body")
    return tuple(name for name, point in low.items() if point[2] - ground < NEAR * height)


def _length(model: mujoco.MjModel, data: mujoco.MjData, base: str) -> float:
    """The distance between the ends of what collides, along the heading [m]."""
    ahead = data.body(base).xmat.reshape(3, 3)[:, 0]
    ends = [[support(model, data, geom, way) @ ahead for way in (-ahead, ahead)] for geom in _colliding(model)]
    return float(np.max(ends) - np.min(ends))


def _write_start(spec: mujoco.MjSpec, data: mujoco.MjData, robot: Robot) -> None:
    """Leave the pose as the only keyframe, and add a camera, points on the soles and sensors of where they are."""
    for key in list(spec.keys):
        spec.delete(key)
    spec.add_key(name=START, qpos=data.qpos, ctrl=data.ctrl, act=data.act)
    if all(camera.name != CAMERA for camera in spec.cameras):
        parts.add_camera(spec.body(robot.base), AWAY * robot.length)
    for foot, point in zip(robot.feet, robot.soles, strict=True):
        spec.body(foot).add_site(name=sole(foot), pos=point, size=[1e-3] * 3, group=5)
        place, site = mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_SITE
        spec.add_sensor(name=sole(foot), type=place, objtype=site, objname=sole(foot))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def sole(foot: str) -> str:
    """The name of the point on a foot's sole, and of the sensor of where it is."""
    return f"{foot}_sole"
