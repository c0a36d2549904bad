"""A rigid intruder of any shape: dropped, dragged or drilled."""

from typing import Final, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rftsim_models.studio import new_scene

Motion = Literal["drop", "drag", "drill"]
MOTIONS: Final = get_args(Motion)
INTRUDER: Final = "intruder"
SERVO: Final = 1e5
"""Gain of the rate servos: [N s/m] and [N m s]."""


def build_intruder(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    motion: Motion = "drop",
    density: float = 1000.0,
    height: float = 0.0,
    speed: float = 0.1,
    rate: float = 0.0,
    gravity: float = 9.81,
) -> mujoco.MjSpec:
    """An intruder whose own origin starts at a height above z = 0 [m].

    Args:
        vertices: Vertices of its mesh [m], (nvert, 3).
        faces: Triangles of its mesh, as numbers of vertices, (nface, 3).
        motion: `drop`: free; `drag`: at a speed along x, its height held; `drill`: downward at a speed, turning about
            the vertical at a rate.
        density: Density of the solid [kg/m^3].
        height: Height of the mesh's origin above the ground [m].
        speed: Imposed speed [m/s].
        rate: Imposed angular rate about the vertical [rad/s].
        gravity: Acceleration along -z [m/s^2].

    Raises:
        ValueError: No such motion, or a density that is not positive.
    """
    if motion not in MOTIONS:
        raise ValueError(f"no motion {motion!r}; motions are {', '.join(MOTIONS)}")
    if not density > 0.0:
        raise ValueError(f"density must be positive, not {density}")
    spec = new_scene(INTRUDER, gravity=gravity, timestep=1e-3)
    points = np.asarray(vertices, dtype=float)
    spec.add_mesh(name=INTRUDER, uservert=points.ravel(), userface=np.asarray(faces).ravel())
    body = spec.worldbody.add_body(name=INTRUDER, pos=[0, 0, height])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=INTRUDER, density=density, rgba=[0.55, 0.60, 0.68, 1])
    if motion == "drop":
        body.add_freejoint(name="free")
        return spec
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    drag, sink = ("x", slide, [1, 0, 0], speed), ("z", slide, [0, 0, 1], -speed)
    _impose(spec, body, [drag] if motion == "drag" else [sink, ("yaw", hinge, [0, 0, 1], rate)])
    return spec


def _impose(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, imposed: list[tuple[str, mujoco.mjtJoint, list[int], float]]
) -> None:
    """Give a body joints, by name, kind, axis and rate [m/s or rad/s], on stiff servos that hold these rates."""
    for name, kind, axis, _ in imposed:
        body.add_joint(name=name, type=kind, axis=axis)
        servo = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        servo.set_to_velocity(kv=SERVO)
    values = [value for *_, value in imposed]
    spec.add_key(name="start", qvel=values, ctrl=values)
