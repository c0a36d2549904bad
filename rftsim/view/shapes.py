"""Shapes and colours of a recording: the sand, the geoms, and the skins that feel the sand."""

from typing import Final

import mujoco
import numpy as np
import rerun as rr

from rftsim.errors import SceneError
from rftsim.model.geometry import geom_triangles
from rftsim.surface.triangles import Array
from rftsim.view.frames import Plane

SAND: Final = (0.76, 0.70, 0.50, 0.2)
"""Colour and opacity of the drawn sand."""
GRID_CELLS: Final = 16
"""Cells of the grid along each side of the drawn sand."""


def snapped(place: Array, plane: Plane, cell: float) -> Array:
    """The corners of the sand's grid that are nearest to places, both (n, 3) [m]."""
    corners: Array = plane.offset * plane.up + sum(
        cell * np.rint(place @ axis / cell)[:, None] * axis for axis in (plane.along, plane.across)
    )
    return corners


def sand_shapes(plane: Plane, cell: float) -> tuple[rr.Mesh3D, rr.LineStrips3D]:
    """Make a translucent square about the origin, for the sand, and the grid on it, whose cells have a side [m]."""
    along, across = plane.along, plane.across
    half = GRID_CELLS / 2 * cell
    corners = [half * (i * along + j * across) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    grid = [
        [offset * one - half * other, offset * one + half * other]
        for one, other in ((along, across), (across, along))
        for offset in np.linspace(-half, half, GRID_CELLS + 1)
    ]
    mesh = rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 1, 2], [0, 2, 3]], albedo_factor=SAND)
    return mesh, rr.LineStrips3D(grid, colors=SAND, radii=rr.Radius.ui_points(0.5))


def geom_mesh(model: mujoco.MjModel, geom: int, opacity: float) -> rr.Mesh3D | None:
    """Make the mesh of a geom in its body's frame, or None where the geom is invisible or endless."""
    rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
    if material >= 0 and (rgba == (0.5, 0.5, 0.5, 1.0)).all():  # MuJoCo's rule: the default gives way
        rgba = model.mat_rgba[material]
    try:
        vertices, faces = geom_triangles(model, geom)
    except SceneError:
        return None
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    placed = vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom]
    return triangle_mesh(placed[faces], rgba * [1.0, 1.0, 1.0, opacity]) if rgba[3] else None


def triangle_mesh(triangles: Array, rgba: Array | None = None) -> rr.Mesh3D:
    """Make a mesh of triangles, (n, 3, 3), that share no corners: shaded flat, and each can have its colour."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3), vertex_normals=np.repeat(normals, 3, axis=0), albedo_factor=rgba
    )
