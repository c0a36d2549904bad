"""Advice on the law of a scene: the lowest that its joints and its speed allow, with numbers. Nothing is changed."""

import math
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.add_sand import Bed
from rftsim.model.planar import joints_that_leave
from rftsim.model.readout import body_velocities, instances
from rftsim.model.start import start
from rftsim.run.validity import FROUDE_LIMIT
from rftsim.surface.triangles import Array, Surface

PLANES: Final = {"x-z plane": np.array([0.0, 1.0, 0.0]), "y-z plane": np.array([1.0, 0.0, 0.0])}
"""Normals of the vertical planes that are tried, by their names."""


class Advice(NamedTuple):
    """A law for a scene, its own or another, and why."""

    law: str
    """Name of the law."""
    reason: str
    """Why this law, with numbers."""


def advise(model: mujoco.MjModel, bed: Bed, speed: float | None = None) -> list[Advice]:
    """The laws that a scene allows and asks for: in plane or space, and quasi-static or dynamic.

    Args:
        model: The compiled model.
        bed: Its sand.
        speed: Speed of the bodies that feel the sand [m/s]; by default each one's at the start: the first keyframe's.
    """
    flat = _planes(model, bed)
    return [_dimensions(bed, list(flat)), _dynamics(model, bed, speed, next(iter(flat.values()), np.zeros(3)))]


def _planes(model: mujoco.MjModel, bed: Bed) -> dict[str, Array]:
    """Normals of the planes that the bodies cannot leave, by name; of a planar law that which it acts in."""
    if bed.law.planar:
        (plane,) = (one.bed.plane for one in instances(model) if one.name == bed.name)
        name = next((name for name, normal in PLANES.items() if abs(normal @ plane) == 1.0), "plane of motion")
        return {name: np.array(plane)}
    data, bodies = start(model), [model.body(name).id for name in bed.surfaces]
    return {
        name: normal
        for name, normal in PLANES.items()
        if not any(joints_that_leave(model, data, body, normal) for body in bodies)
    }


def _dimensions(bed: Bed, flat: list[str]) -> Advice:
    law, bodies = bed.law.name, f"all {len(bed.surfaces)} bodies" if len(bed.surfaces) > 1 else "the one body"
    if flat:
        why = f"the joints keep {bodies} that can feel the sand in the {flat[0]}: a 2D law serves"
        if bed.law.planar:
            return Advice(law, why)
        return Advice(
            "drft2d" if bed.law.dynamic else "rft2d",
            f"{why}, with less arithmetic. It is a fit of its own, about 30 % (rms) from the 3D ones",
        )
    why = f"the joints do not keep {bodies} that can feel the sand in one vertical plane, x-z or y-z"
    return Advice(law, f"{why}: a 3D law is needed")


def _dynamics(model: mujoco.MjModel, bed: Bed, speed: float | None, across: Array) -> Advice:
    """`across`: normal of the plane of motion, along which a body's size does not count; zero in space."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    law = bed.law.name
    slow, fast = law.removeprefix("d"), "d" + law.removeprefix("d")
    sizes, speeds = {}, {}
    for name, surface in bed.surfaces.items():
        turn = data.xmat[model.body(name).id].reshape(3, 3)
        corners = surface.corners - np.outer(surface.corners @ turn.T @ across, across @ turn)
        sizes[name] = float(np.ptp(corners, axis=0).max())
        speeds[name] = _mean_speed(model, data, surface, name) if speed is None else speed
    froude = {name: speeds[name] / math.sqrt(bed.sand.g * sizes[name]) for name in sizes}
    name = max(froude, key=lambda body: froude[body])
    if froude[name] == 0.0:
        least = min(sizes.values())
        limit = FROUDE_LIMIT * math.sqrt(bed.sand.g * least)
        return Advice(
            law,
            f"nothing moves at the start; up to {limit:.2g} m/s a quasi-static law serves (Froude number v/sqrt(gL) < "
            f"{FROUDE_LIMIT}, L = {least:.3g} m). Say the speed to hear more",
        )
    why = (
        f"body {name}, L = {sizes[name]:.3g} m, moves at {speeds[name]:.3g} m/s"
        f"{' at the start' if speed is None else ''}: Froude number v/sqrt(gL) = {froude[name]:.2g}"
    )
    if froude[name] < FROUDE_LIMIT:
        return Advice(slow, f"{why} < {FROUDE_LIMIT}, so a quasi-static law serves")
    return Advice(fast, f"{why}, and from {FROUDE_LIMIT} on the sand's inertia counts")


def _mean_speed(model: mujoco.MjModel, data: mujoco.MjData, surface: Surface, name: str) -> float:
    """Mean speed of a body's surface [m/s]."""
    body = model.body(name).id
    velocity, omega = body_velocities(model, data)
    arm = surface.centres @ data.xmat[body].reshape(3, 3).T
    speeds = np.linalg.norm(velocity[body] + np.cross(omega[body], arm), axis=1)
    return float(np.average(speeds, weights=surface.areas))
