"""Height fields of a model as terrain: the heights of a geom with its place and its rotation about z."""

from typing import Final

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.model.draft import shown
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array

UPRIGHT: Final = 1e-6
"""Sine of the tilt of a height field, or of its turn from a quarter turn, that is rounding."""


def field_terrain(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> "Terrain | FreeSurface":
    """The surface through the points of a height field; a plane where they are level.

    Turned by other than quarter turns it is sampled anew, as a terrain's values lie along x and y: not coarser than it
    was, over the rectangle around it, on which it levels off.

    Args:
        model: Compiled.
        data: Its data after mj_kinematics.
        geom: Id of its geom.

    Raises:
        SceneError: The geom is tilted, or can move.
    """
    body = int(model.geom_bodyid[geom])
    if model.body_weldid[body] != 0 or model.body_mocapid[model.body_rootid[body]] >= 0:
        raise SceneError(
            f"{shown(model.geom(geom).name)} is a height field that moves with body {model.body(body).name}: sand "
            "takes the relief of one that stays where it is; or say where the sand lies (terrain=)"
        )
    rotation, origin = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    tilt = float(np.hypot(rotation[2, 0], rotation[2, 1]))
    if tilt > UPRIGHT or rotation[2, 2] < 0.0:
        angle = np.degrees(np.arccos(np.clip(rotation[2, 2], -1.0, 1.0)))
        raise SceneError(
            f"{shown(model.geom(geom).name)} is a height field tilted by {angle:.3g} degrees: sand takes the relief of "
            "one that is only turned about z; or say where the sand lies (terrain=)"
        )
    field = int(model.geom_dataid[geom])
    heights = float(origin[2]) + field_heights(model, field)
    if not np.ptp(heights):
        return FreeSurface(float(heights[0, 0]))
    half = np.array(model.hfield_size[field][:2])
    return _turned(heights, half, np.array(origin[:2]), float(np.arctan2(rotation[1, 0], rotation[0, 0])))


def field_heights(model: mujoco.MjModel, field: int) -> Array:
    """Heights of a height field over its origin [m], rows along y, shape (nrow, ncol)."""
    rows, columns, start = model.hfield_nrow[field], model.hfield_ncol[field], model.hfield_adr[field]
    heights = model.hfield_data[start : start + rows * columns].reshape(rows, columns).astype(float)
    return heights * float(model.hfield_size[field][2])  # type: ignore[no-any-return]


def _turned(heights: Array, half: Array, centre: Array, angle: float) -> Terrain:
    """A terrain of half a size [m] about a centre, turned about it by an angle [rad]."""
    quarters = round(2.0 * angle / np.pi)
    if abs(np.sin(angle - quarters * np.pi / 2.0)) <= UPRIGHT:
        heights, half = np.rot90(heights, -quarters), half[::-1] if quarters % 2 else half
        spacing = 2.0 * half / (np.array(heights.shape[::-1]) - 1)
        return Terrain(
            heights, (float(spacing[0]), float(spacing[1])), (float(centre[0] - half[0]), float(centre[1] - half[1]))
        )
    straight = _turned(heights, half, np.zeros(2), 0.0)
    cos, sin = np.cos(angle), np.sin(angle)
    around = np.array([abs(cos) * half[0] + abs(sin) * half[1], abs(sin) * half[0] + abs(cos) * half[1]])
    return Terrain.from_function(
        lambda x, y: straight.height_at(
            cos * (x - centre[0]) + sin * (y - centre[1]), cos * (y - centre[1]) - sin * (x - centre[0])
        ),
        2.0 * around,
        min(straight.spacing),
        centre=(float(centre[0]), float(centre[1])),
    )
