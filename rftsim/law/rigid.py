"""The force of sand on one rigid surface, without MuJoCo."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rftsim.law import evaluate, layout
from rftsim.law.laws import Law, get_law
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, Surface


class SurfaceForce(NamedTuple):
    """The sand's action on a surface; world frame."""

    force: Array
    """[N], shape (3,)."""
    moment: Array
    """About the body's origin [N m], shape (3,)."""
    stress: Array
    """Traction on each triangle [Pa], shape (ntri, 3)."""
    depth: Array
    """Effective depth of each centroid [m], shape (ntri,): less the drop behind a wheel; negative above the sand."""
    active: "np.ndarray[tuple[int], np.dtype[np.bool_]]"
    """Submerged and leading, shape (ntri,)."""
    power: float
    """Power of the sand on the body [W]; negative where it resists."""


def surface_force(
    surface: Surface,
    sand: Sand,
    law: "str | Law" = "rft3d",
    *,
    position: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    plane: ArrayLike = (0.0, 1.0, 0.0),
    terrain: FreeSurface | None = None,
) -> SurfaceForce:
    """Force of sand on a surface that moves as a rigid body.

    Args:
        surface: Triangles in the body frame.
        sand: The medium.
        law: A law, its name, or `rft3d:FILE.toml`, see `get_law`.
        position: The body's origin [m].
        rotation: Body to world, shape (3, 3).
        velocity: Of the body's origin [m/s].
        angular_velocity: World frame [rad/s].
        plane: Normal of the plane of motion of the 2D laws; horizontal.
        terrain: By default level at height zero.
    """
    bed = layout.pack_bed(sand, get_law(law), terrain or FreeSurface(), plane)
    rotation, velocity, omega = (np.array(x, dtype=float) for x in (rotation, velocity, angular_velocity))
    pose = np.array(position, dtype=float), rotation.ravel()
    stress, depth = evaluate.triangle_stresses(bed, layout.pack_surface(surface), *pose, velocity, omega)
    force = stress.T @ surface.areas
    moment = np.cross(surface.centres, stress).T @ surface.areas
    force, moment, stress = rotation @ force, rotation @ moment, stress @ rotation.T
    active = (depth > 0.0) & stress.any(axis=1)
    return SurfaceForce(force, moment, stress, depth, active, power=float(force @ velocity + moment @ omega))
