"""Parts that the robots share: options, felt and seen geoms, sensors, a camera, and the pose they start in.

Geoms of bodies that touch the ground are meshes, as fine as the sand needs them: with `rftsim.add_sand` pass
`max_edge=AS_MESHED`. They collide with a floor (its conaffinity 1) and not with one another, and where they are concave
MuJoCo's contact takes their convex hull.
"""

from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from rftsim_models.outline import Array, Faces
from rftsim_models.studio import new_scene

TORSO: Final = "torso"
AS_MESHED: Final = 1.0
"""Longest edge of a triangle [m] that leaves the meshes as they are."""
SEEN_GROUP: Final = 2
SAND_GROUP: Final = 3
"""Geom groups: that of what is only looked at, and that of what the sand presses on where it looks different."""
BODY_RGBA: Final = (0.20, 0.32, 0.50, 1.0)
LIMB_RGBA: Final = (0.55, 0.60, 0.68, 1.0)
FOOT_RGBA: Final = (0.16, 0.17, 0.19, 1.0)

_GEOM = mujoco.mjtGeom


def check_positive(parameters: object, names: Sequence[str]) -> None:
    """Raise a ValueError for the first of these parameters that is not positive."""
    for name in names:
        if not getattr(parameters, name) > 0.0:
            raise ValueError(f"{name} must be positive, not {getattr(parameters, name)}")


def new_robot(name: str) -> mujoco.MjSpec:
    """An empty model with the robots' options: 9.81 m/s^2, steps of 5 ms, implicitfast, radians."""
    spec = new_scene(name, gravity=9.81, timestep=5e-3)
    spec.compiler.degree = False
    return spec


def add_felt(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    solid: tuple[Array, Faces],
    mass: float,
    *,
    pos: Sequence[float] = (0, 0, 0),
    rgba: Sequence[float] = FOOT_RGBA,
) -> None:
    """Give a body a mesh that touches the ground, and its mass [kg]."""
    vertices, faces = solid
    spec.add_mesh(
        name=body.name,
        uservert=vertices.ravel(),
        userface=faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT,
    )
    body.add_geom(
        name=body.name,
        type=_GEOM.mjGEOM_MESH,
        meshname=body.name,
        mass=mass,
        pos=pos,
        rgba=rgba,
        contype=1,
        conaffinity=0,
    )


def add_rod(
    body: mujoco.MjsBody,
    start: Sequence[float],
    end: Sequence[float],
    radius: float,
    mass: float = 0.0,
    rgba: Sequence[float] = LIMB_RGBA,
) -> None:
    """Give a body a rod that touches nothing, from one point to another [m], and its mass [kg]."""
    body.add_geom(
        type=_GEOM.mjGEOM_CAPSULE,
        fromto=[*start, *end],
        size=[radius, 0, 0],
        mass=mass,
        rgba=rgba,
        contype=0,
        conaffinity=0,
        group=SEEN_GROUP,
    )


def add_seen(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: Sequence[float],
    pos: Sequence[float],
    rgba: Sequence[float],
) -> None:
    """Give a body a geom of some size at some place [m], which is only looked at."""
    body.add_geom(type=kind, size=size, pos=pos, rgba=rgba, mass=0, contype=0, conaffinity=0, group=SEEN_GROUP)


def add_senses(spec: mujoco.MjSpec, torso: mujoco.MjsBody) -> None:
    """Add `gyro`, `velocimeter` and `accelerometer` at the site `imu`, the torso's origin, and its `orientation`."""
    kind = mujoco.mjtSensor
    torso.add_site(name="imu", size=[0.004] * 3, group=4)
    for name, sense in (
        ("gyro", kind.mjSENS_GYRO),
        ("velocimeter", kind.mjSENS_VELOCIMETER),
        ("accelerometer", kind.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(name=name, type=sense, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    body = mujoco.mjtObj.mjOBJ_XBODY
    spec.add_sensor(name="orientation", type=kind.mjSENS_FRAMEQUAT, objtype=body, objname=torso.name)


def add_camera(torso: mujoco.MjsBody, distance: float) -> None:
    """Add the camera `follow`, which looks from this distance [m]: from the right, somewhat from ahead and above."""
    out = np.array([0.55, -1.0, 0.42])
    out /= np.linalg.norm(out)
    right = np.cross([0, 0, 1.0], out)
    right /= np.linalg.norm(right)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.column_stack([right, np.cross(out, right), out]).ravel())
    torso.add_camera(name="follow", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM, pos=distance * out, quat=quat, fovy=40)


def add_servo(
    spec: mujoco.MjSpec, joint: str, torque: float, limit: Sequence[float], *, kv: float, kp: float = 0.0
) -> None:
    """Add a servo of a joint's rate, or of its position where kp > 0.

    Args:
        spec: The model.
        joint: The joint's name, and the servo's.
        torque: Largest torque [N m].
        limit: Lowest and highest target, [rad/s] or [rad].
        kv: Torque for an error of the rate [N m s/rad].
        kp: Torque for an error of the position [N m/rad].
    """
    servo = spec.add_actuator(name=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint)
    if kp > 0.0:
        servo.set_to_position(kp=kp, kv=kv)
    else:
        servo.set_to_velocity(kv=kv)
    servo.forcerange, servo.ctrlrange = [-torque, torque], limit


def add_start(spec: mujoco.MjSpec, qpos: Sequence[float], ctrl: Sequence[float]) -> None:
    """Add the keyframe `start`: a pose whose root is at such a height that the lowest vertex is at z = 0.

    Args:
        spec: The model, whose root is a free joint, or slides along x and z.
        qpos: The pose, whatever its height, (nq,).
        ctrl: Controls that hold it, (nu,).
    """
    model = spec.copy().compile()
    data = mujoco.MjData(model)
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    lifted = np.array(qpos, dtype=float)
    lifted[2 if model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE else 1] -= lowest(model, data)
    spec.add_key(name="start", qpos=lifted, ctrl=ctrl)


def lowest(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Height of the lowest vertex of the meshes that touch the ground [m]."""
    heights = []
    for geom in np.flatnonzero((model.geom_type == _GEOM.mjGEOM_MESH) & (model.geom_contype > 0)):
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        heights.append(data.geom_xpos[geom][2] + points @ data.geom_xmat[geom].reshape(3, 3)[2])
    return float(np.concatenate(heights).min())
