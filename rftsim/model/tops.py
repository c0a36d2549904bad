"""Tops of static geoms: the faces, level or sloped, that a body could stand on, as heights over places."""

import functools
from collections.abc import Callable
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.errors import SurfaceError
from rftsim.model.geometry import hull_triangles
from rftsim.model.height_field import field_heights
from rftsim.surface.triangles import Array

_GEOM = mujoco.mjtGeom
LEVEL: Final = 0.82
"""Cosine of the tilt from which on a face is a wall: 35 degrees, about the steepest that sand lies."""
FLAT: Final = (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_BOX, _GEOM.mjGEOM_CYLINDER, _GEOM.mjGEOM_MESH, _GEOM.mjGEOM_HFIELD)
"""Kinds of geoms that have a top to stand on; round ones are obstacles."""
POINTS: Final = 33
"""Most points along a side of a height field that are looked at."""


class Top(NamedTuple):
    """The face of a geom at a place."""

    height: float
    """Height of the face there [m]."""
    normal: Array
    """Upward unit normal there, shape (3,)."""


def top_at(model: mujoco.MjModel, data: mujoco.MjData, geom: int, place: Array) -> Top | None:
    """The top of a geom over or under a place, None where it has none there: walls, and beyond its edges.

    Args:
        model: Compiled.
        data: Its data after mj_kinematics.
        geom: The geom's id.
        place: World frame [m], of which x and y count, shape (3,).
    """
    return _tops(model, data, geom)(place)


def _tops(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Callable[[Array], Top | None]:
    """What gives the top of a geom over a place; arguments as of `top_at`."""
    kind = _GEOM(model.geom_type[geom])
    if kind not in FLAT:
        return lambda place: None
    rotation, origin = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    if kind == _GEOM.mjGEOM_HFIELD:
        return functools.partial(_field_top, model, geom, rotation, origin)
    try:
        normals, offsets = _halfspaces(model, geom, kind)
    except SurfaceError:  # a flat mesh, which carries nothing in MuJoCo
        return lambda place: None
    normals, offsets = normals @ rotation.T, offsets + normals @ rotation.T @ origin
    return functools.partial(_upper, normals, offsets)


def top_points(model: mujoco.MjModel, data: mujoco.MjData, geom: int, places: Array) -> Array:
    """Points of a geom's top over places where it has one; of a height field those of its own grid; shape (n, 3) [m].

    Args:
        model: Compiled.
        data: Its data after mj_kinematics.
        geom: The geom's id.
        places: World frame [m], of which x and y count, shape (n, 3).
    """
    if model.geom_type[geom] != int(_GEOM.mjGEOM_HFIELD):
        tops = map(_tops(model, data, geom), places)
        found = [[*place[:2], top.height] for place, top in zip(places, tops, strict=True) if top is not None]
        return np.array(found).reshape(-1, 3)
    field, rotation = int(model.geom_dataid[geom]), data.geom_xmat[geom].reshape(3, 3)
    if rotation[2, 2] < LEVEL:
        return np.empty((0, 3))
    heights, half = field_heights(model, field), model.hfield_size[field][:2]
    row, column = (np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(int)) for n in heights.shape)
    x, y = (
        end * (2.0 * at / (n - 1) - 1.0) for end, at, n in zip(half, (column, row), heights.shape[::-1], strict=True)
    )
    grid = np.stack([*np.meshgrid(x, y), heights[np.ix_(row, column)]], axis=-1).reshape(-1, 3)
    points: Array = grid @ rotation.T + data.geom_xpos[geom]
    return points


def _halfspaces(model: mujoco.MjModel, geom: int, kind: mujoco.mjtGeom) -> tuple[Array, Array]:
    """Outward normals, (n, 3), and offsets [m], (n,), of the planes that bound a convex geom, in its frame."""
    size = model.geom_size[geom]
    if kind == _GEOM.mjGEOM_PLANE:
        return np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    if kind == _GEOM.mjGEOM_BOX:
        return np.vstack([np.eye(3), -np.eye(3)]), np.tile(size, 2)
    if kind == _GEOM.mjGEOM_CYLINDER:
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        side = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(24)])
        return np.vstack([side, [[0, 0, 1], [0, 0, -1]]]), np.append(np.full(24, size[0]), [size[1], size[1]])
    corners = hull_triangles(model, int(model.geom_dataid[geom]))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return normals, np.einsum("ij,ij->i", normals, corners[:, 0])


def _field_top(model: mujoco.MjModel, geom: int, rotation: Array, origin: Array, place: Array) -> Top | None:
    """The top of a height field, whose heights are taken at the nearest of its points."""
    field = int(model.geom_dataid[geom])
    half = model.hfield_size[field][:2]
    along = (rotation.T @ [place[0] - origin[0], place[1] - origin[1], 0.0])[:2]
    if (np.abs(along) > half).any() or rotation[2, 2] < LEVEL:
        return None
    heights = field_heights(model, field)
    column, row = np.rint((along + half) / (2.0 * half) * (np.array(heights.shape[::-1]) - 1)).astype(int)
    return Top(float(origin[2] + heights[row, column]), rotation[:, 2].copy())


def _upper(normals: Array, offsets: Array, place: Array) -> Top | None:
    """Where a vertical line leaves a convex solid upward, and the face there; None where it misses it, or at a wall."""
    slope, level = normals[:, 2], offsets - normals[:, :2] @ place[:2]
    upright = np.abs(slope) < 1e-9
    if (level[upright] < 0.0).any():
        return None
    upper, lower = slope >= 1e-9, slope <= -1e-9
    if not upper.any():
        return None
    leaves = level[upper] / slope[upper]
    face = int(np.argmin(leaves))
    height, normal = float(leaves[face]), normals[upper][face]
    if (lower.any() and height < (level[lower] / slope[lower]).max()) or normal[2] < LEVEL:
        return None
    return Top(height, normal)
