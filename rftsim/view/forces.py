"""The sand's force on each body as people draw it: one arrow from the surface above where it acts."""

from typing import NamedTuple

import mujoco
import numpy as np

from rftsim.law import layout
from rftsim.model.ground import Ground, ground
from rftsim.model.readout import Instance, Wrenches, instances, wrenches
from rftsim.surface.triangles import Array


class Resultant(NamedTuple):
    """The sand's force on a body."""

    body: int
    """The body's id."""
    start: Array
    """Point of the free surface above the middle of the pressure [m], shape (3,); the body's origin without force."""
    force: Array
    """The force [N], shape (3,)."""


def resultants(model: mujoco.MjModel, data: mujoco.MjData) -> list[Resultant]:
    """The sand's force on each body that feels it, in the order of the beds and of their bodies."""
    found = wrenches(model, data)
    return [
        _resultant(bed, surface, data, body, found)
        for bed, surface in [(bed, ground(model, data, bed.name)) for bed in instances(model)]
        for body in bed.bodies
    ]


def _resultant(bed: Instance, ground: Ground, data: mujoco.MjData, body: int, found: Wrenches) -> Resultant:
    """The force on a body, from its line of action: where that passes nearest to the middle of what is buried."""
    force, origin = found.force[body], data.xpos[body]
    strength = float(np.linalg.norm(force))
    if strength == 0.0:
        return Resultant(body, origin.copy(), force)
    surface = bed.bodies[body]
    middle = _buried_middle(ground, surface, origin, data.xmat[body].reshape(3, 3))
    along = force / strength
    arm = np.cross(force, found.moment[body]) / strength**2
    point = origin + arm + ((middle - origin - arm) @ along) * along
    if np.linalg.norm(point - middle) > layout.extent(surface):  # a moment without a force to speak of
        point = middle
    point[2] = max(point[2], float(ground.height_at(point[0], point[1])))
    return Resultant(body, point, force)


def _buried_middle(ground: Ground, surface: Array, origin: Array, turn: Array) -> Array:
    """The mean of a body's triangles below the undisturbed sand, weighted by area and depth [m], shape (3,)."""
    *columns, area = layout.read_columns(surface)
    centres = np.array(columns[:3]).T @ turn.T + origin
    x, y, z = centres.T
    weights = area * np.maximum(ground.undisturbed_at(x, y) - z, 0.0)
    return weights @ centres / weights.sum() if weights.any() else origin
