"""The size of everything in a model that can move, to which views and arrows are scaled."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.surface.triangles import Array


def corners(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Corners of the boxes around the geoms that can move [m], shape (n, 3); of all that end, where none can move."""
    ends = model.geom_aabb[:, 3:].any(axis=1)
    geoms = ends & _moving(model)[model.geom_bodyid]
    geoms = geoms if geoms.any() else ends
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, 8).T
    middle, half = model.geom_aabb[geoms, None, :3], model.geom_aabb[geoms, None, 3:]
    turned = np.einsum("gij,gcj->gci", data.geom_xmat[geoms].reshape(-1, 3, 3), middle + signs * half)
    found: Array = (data.geom_xpos[geoms, None] + turned).reshape(-1, 3)
    return found


def bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, float]:
    """Centre, shape (3,), and longest side of a box around everything that can move [m]; MuJoCo's if nothing ends."""
    points = corners(model, data)
    if not len(points):
        return model.stat.center.copy(), float(model.stat.extent)
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), float((high - low).max())


def _moving(model: mujoco.MjModel) -> "NDArray[np.bool_]":
    """Whether each body can move, shape (nbody,)."""
    moving: NDArray[np.bool_] = model.body_weldid != 0
    return moving
