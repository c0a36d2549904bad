"""Driven wheels among the bodies that feel the sand, for the structural term of the dynamic laws."""

import dataclasses
from collections.abc import Iterable, Mapping

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.surface.triangles import Surface, Wheel


def rolling(
    model: mujoco.MjModel, surfaces: Mapping[str, Surface], wheels: "Mapping[str, Wheel] | Iterable[str]"
) -> dict[str, Surface]:
    """The surfaces of the bodies that are wheels, which now say so, by body name.

    Raises:
        SceneError: A wheel does not feel the sand, or has no hinge to take its measures from.
    """
    named = dict(wheels) if isinstance(wheels, Mapping) else dict.fromkeys(wheels)
    found = {}
    for name, wheel in named.items():
        if name not in surfaces:
            raise SceneError(f"wheel {name!r} does not feel the sand; bodies that do are {', '.join(surfaces)}")
        found[name] = dataclasses.replace(surfaces[name], wheel=wheel or _hinged_wheel(model, name, surfaces[name]))
    return found


def _hinged_wheel(model: mujoco.MjModel, name: str, surface: Surface) -> Wheel:
    body = model.body(name)
    for joint in range(body.jntadr[0], body.jntadr[0] + body.jntnum[0]):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            axis, centre = model.jnt_axis[joint], model.jnt_pos[joint]
            reach = surface.corners - centre
            radius = float(np.linalg.norm(reach - np.outer(reach @ axis, axis), axis=1).max())
            return Wheel(tuple(axis.tolist()), tuple(centre.tolist()), radius)
    raise SceneError(f"wheel {name!r} has no hinge to turn about: give its Wheel(axis, centre, radius)")
