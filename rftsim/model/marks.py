"""The ruts that fit a model: cells small against what presses on the sand, in a window around all that does."""

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from rftsim.sand.ruts import Ruts, ruts_for
from rftsim.surface.triangles import Array, Surface

SOLE: Final = 0.05
"""Part of a body's size, from below, whose outline is what presses."""
NARROWEST: Final = 1.0 / 3.0
"""The narrowest that presses, over the second of a body's three extents: a blade's edge tells nothing of its reach."""
COARSEST: Final = 0.22
"""The narrowest that presses, over the second extent of the largest body: cells for less would be too many."""
PRESSING: Final = 0.25
"""Bodies press whose lowest point lies no higher above the lowest of all than this part of the largest body's size."""


def marks_for(data: mujoco.MjData, model: mujoco.MjModel, surfaces: Mapping[str, Surface]) -> Ruts:
    """The ruts of a model's bodies, by the narrowest of those that stand lowest.

    Args:
        data: Its data in the pose in which it starts, with kinematics.
        model: Compiled.
        surfaces: Whole surface of each body that feels the sand, by body name.
    """
    corners = {}
    for name, surface in surfaces.items():
        body = model.body(name).id
        corners[name] = surface.corners @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
    lowest = {name: float(points[:, 2].min()) for name, points in corners.items()}
    reach = PRESSING * max(surface.size for surface in surfaces.values())
    pressing = [name for name, height in lowest.items() if height <= min(lowest.values()) + reach]
    width = min(_width(corners[name]) for name in pressing)
    everything = np.concatenate(list(corners.values()))
    x, y = np.ptp(everything[:, :2], axis=0).tolist()
    largest = max(surfaces.values(), key=lambda surface: surface.size)
    return ruts_for(max(width, COARSEST * _second(largest.corners)), (x, y))


def _width(points: Array) -> float:
    """The narrower side of what lies lowest of a body's corners, along x and y [m]; points in the world, (n, 3)."""
    size = float(np.ptp(points, axis=0).max())
    sole = points[points[:, 2] <= points[:, 2].min() + SOLE * size]
    return max(float(np.ptp(sole[:, :2], axis=0).min()), NARROWEST * _second(points))


def _second(points: Array) -> float:
    """The second of the three extents of points along the axes [m]."""
    return float(np.sort(np.ptp(points, axis=0))[1])
