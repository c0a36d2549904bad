"""The solids of [Agarwal] section 5.9, each about its centroid, x along the motion and z up.

The text gives their sizes and turns; how the prisms lie is to be seen in Fig. 5-8 only, and here our own choice. The
tenth, a head from a drawing program, is not here: any closed mesh can take its place by its file's name.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.body import turned
from rftsim_mpm.errors import MpmError
from rftsim_mpm.shapes import Shape, box, mesh
from rftsim_mpm.silhouette import read_mesh

Array = NDArray[np.float64]


def _hull(points: Array, name: str) -> Shape:
    import trimesh  # slow to import

    body = trimesh.convex.convex_hull(points)
    return mesh(np.array(body.vertices) - body.center_mass, np.array(body.faces), name)


def _ellipsoid(axes: tuple[float, float, float], name: str, keep: tuple[bool, bool] = (False, False)) -> Shape:
    """An ellipsoid [semi-axes, m], or its half or quarter with x > 0, y > 0 or both."""
    import trimesh

    points = np.array(trimesh.creation.icosphere(subdivisions=3).vertices)
    angle = 2.0 * np.pi * np.arange(64) / 64
    nothing = 0.0 * angle
    for axis, cut in enumerate(keep):
        if cut:
            rim = np.insert(np.column_stack([np.cos(angle), np.sin(angle)]), axis, nothing, axis=1)
            points = np.concatenate([points, rim])
    for axis, cut in enumerate(keep):
        if cut:
            points = points[points[:, axis] >= -1e-9]
    return _hull(points * axes, name)


def _cube(about_y: float, about_z: float, name: str) -> Shape:
    """An edge of 75 mm, turned about y and then about z [rad]."""
    cube = box(0.075, 0.075, 0.075)
    rotation = turned(turned(np.eye(3), np.array([0.0, about_y, 0.0])), np.array([0.0, 0.0, about_z]))
    return mesh(cube.vertices @ rotation.T, cube.faces, name)


def _prism(side: float, width: float, name: str) -> Shape:
    """A right-angled isosceles triangle, its equal sides along x and z, as wide as given along y [m]."""
    corners = [(0.0, 0.0), (side, 0.0), (0.0, side)]
    return _hull(np.array([(x, y * width, z) for x, z in corners for y in (-0.5, 0.5)]), name)


SEMI_AXES = (0.075, 0.045, 0.045)
"""Half the ellipsoid's extent along x, y and z [m]."""
INTRUDERS: dict[str, Callable[[], Shape]] = {
    "sphere": lambda: _ellipsoid((0.05, 0.05, 0.05), "sphere"),
    "ellipsoid": lambda: _ellipsoid(SEMI_AXES, "ellipsoid"),
    "cube-edge-on": lambda: _cube(0.0, math.pi / 4, "cube-edge-on"),
    "cube-60-45": lambda: _cube(math.pi / 3, math.pi / 4, "cube-60-45"),
    "cube-30-60": lambda: _cube(math.pi / 6, math.pi / 3, "cube-30-60"),
    "prism-wide": lambda: _prism(0.075, 0.105, "prism-wide"),
    "quarter-ellipsoid": lambda: _ellipsoid(SEMI_AXES, "quarter-ellipsoid", (True, True)),
    "prism-tall": lambda: _prism(0.105, 0.075, "prism-tall"),
    "half-ellipsoid": lambda: _ellipsoid(SEMI_AXES, "half-ellipsoid", (False, True)),
}
"""The solids by name, in the source's order."""


def intruder(name: str) -> Shape:
    """Return one of INTRUDERS, or a closed mesh from a file [m], about its centroid.

    Raises:
        MpmError: There is none of that name, and no such file; or the mesh is not closed.
    """
    if name in INTRUDERS:
        return INTRUDERS[name]()
    if not Path(name).suffix:
        raise MpmError(f"there is no intruder {name!r}: take {', '.join(INTRUDERS)}, or a mesh's file")
    body = read_mesh(Path(name))
    solid = mesh(np.array(body.vertices), np.array(body.faces), Path(name).name)
    return Shape(solid.name, solid.vertices - body.center_mass, solid.faces)


def is_its_own_image(shape: Shape) -> bool:
    """Whether a mirror at y = 0 leaves the shape as it is."""
    corners = np.round(shape.vertices, 9) + 0.0
    image = np.round(corners * [1.0, -1.0, 1.0], 9) + 0.0
    return {tuple(c) for c in corners.tolist()} == {tuple(c) for c in image.tolist()}
