"""Cameras that show everything that can move: for one picture, and for a film."""

import math
from typing import Final, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rftsim.model.bounds import bounds, corners
from rftsim.model.ground import ground
from rftsim.model.readout import instances
from rftsim.surface.triangles import Array

Camera: TypeAlias = int | str | mujoco.MjvCamera
"""Id or name of a camera of the model, or a free camera."""
SIZE: Final = (960, 540)
"""Width and height of a picture [pixels]."""
FILLED: Final = 0.8
"""Share of the picture that the model takes, in height or in width."""
AZIMUTH: Final = 118.0
"""Direction in which a picture's camera looks, from the x axis on [degrees]."""
ELEVATIONS: Final = (-16.0, -24.0, -32.0, -45.0, -60.0)
"""Angles by which it may look up [degrees]; the first from which it is well above the sand."""
ABOVE: Final = 0.4
"""Height over the sand at which it is well above it, over the extent of what can move."""
LAG: Final = 0.15
"""Time by which a camera lags behind what it follows [s]."""


def framing(
    model: mujoco.MjModel, data: mujoco.MjData, aspect: float = SIZE[0] / SIZE[1], more: ArrayLike = ()
) -> mujoco.MjvCamera:
    """Make a free camera that shows everything that can move, from the side and slightly from above.

    Args:
        model: Compiled.
        data: Its data after mj_forward or mj_step.
        aspect: Width over height of the picture.
        more: Further points that it shows [m], shape (n, 3).
    """
    camera = mujoco.MjvCamera()
    camera.azimuth = AZIMUTH
    camera.lookat[:], extent = bounds(model, data)
    tangent = FILLED * np.tan(0.5 * np.radians(model.vis.global_.fovy))
    arms = np.concatenate([corners(model, data), np.reshape(more, (-1, 3))]) - camera.lookat
    for camera.elevation in ELEVATIONS:
        ahead, right, up = _axes(camera)
        wanted = np.maximum(np.abs(arms @ up) / tangent, np.abs(arms @ right) / (tangent * aspect)) - arms @ ahead
        camera.distance = max(float(wanted.max(initial=0.0)), 0.5 * extent)
        if _height(model, data, camera.lookat - camera.distance * ahead) > ABOVE * extent:
            break
    return camera


class Follower:
    """A camera of a film, which keeps its direction and distance and follows the middle of everything that can move.

    Args:
        model: Compiled.
        aspect: Width over height of the pictures.
    """

    def __init__(self, model: mujoco.MjModel, aspect: float = SIZE[0] / SIZE[1]) -> None:
        self._model, self._aspect = model, aspect
        self._camera: mujoco.MjvCamera | None = None
        self._time = 0.0

    def at(self, data: mujoco.MjData) -> mujoco.MjvCamera:
        """The camera at the time of some data after mj_forward or mj_step, which starts anew where time turns back."""
        if self._camera is None or data.time < self._time:
            self._camera = framing(self._model, data, self._aspect)
        else:
            share = 1.0 - math.exp((self._time - data.time) / LAG)
            self._camera.lookat[:] += share * (bounds(self._model, data)[0] - self._camera.lookat)
        self._time = float(data.time)
        return self._camera


def as_free(model: mujoco.MjModel, camera: Camera) -> mujoco.MjvCamera:
    """A camera of a model by its id or name, or the free one that it is, as MuJoCo's scenes take one."""
    if isinstance(camera, mujoco.MjvCamera):
        return camera
    fixed = mujoco.MjvCamera()
    fixed.type, fixed.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(camera).id
    return fixed


def _height(model: mujoco.MjModel, data: mujoco.MjData, place: Array) -> float:
    """Height of a place over the highest sand [m]; infinite where there is none."""
    beds = [ground(model, data, bed.name) for bed in instances(model)]
    return min((float(place[2] - bed.height_at(place[0], place[1])) for bed in beds), default=math.inf)


def _axes(camera: mujoco.MjvCamera) -> tuple[Array, Array, Array]:
    """Unit vectors ahead of a free camera, to its right and up, shape (3,) each."""
    turn, lift = np.radians([camera.azimuth, camera.elevation])
    ahead = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    return ahead, right, np.cross(right, ahead)
