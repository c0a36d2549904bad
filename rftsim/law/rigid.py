"""The force of sand on one rigid surface, without MuJoCo: on each triangle at one pose, or as a whole at many."""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import RftsimError
from rftsim.law import evaluate, layout
from rftsim.law.laws import Law, get_law
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array, Surface

ROTATION_ERROR: Final = 1e-6
"""Largest error of a rotation, in the lengths of its rows and in the third as the product of the others."""
_SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "position": (3,),
    "rotation": (3, 3),
    "velocity": (3,),
    "angular_velocity": (3,),
}
_REST: Final = (0.0, 0.0, 0.0)
_UPRIGHT: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


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
    """Submerged, leading, and not parallel to the plane of motion of a 2D law, shape (ntri,)."""
    power: float
    """Power of the sand on the body [W]; negative where it resists."""


class Wrench(NamedTuple):
    """The sand's action on a whole surface; world frame. For n poses in one call each shape begins with n."""

    force: Array
    """[N], shape (3,) or (n, 3)."""
    moment: Array
    """About the body's origin [N m], shape (3,) or (n, 3)."""


class Intruder:
    """A rigid surface and the sand around it, packed once for compiled code, which then takes any number of poses.

    Each pose and motion stands for itself: the sand remembers nothing.
    """

    def __init__(
        self,
        surface: Surface,
        sand: Sand,
        law: "str | Law" = "rft3d",
        *,
        plane: ArrayLike = (0.0, 1.0, 0.0),
        terrain: FreeSurface | Terrain | None = None,
    ) -> None:
        """Pack a surface and the sand around it.

        Args:
            surface: Triangles in the body frame.
            sand: The medium.
            law: A law, its name, or `rft3d:FILE.toml`, see `get_law`.
            plane: Normal of the plane of motion of the 2D laws; horizontal.
            terrain: The sand's surface, by default level at height zero.

        Raises:
            SandError: The law reads a parameter that is unknown of the sand.
            ValueError: There is no such law, or the plane's normal is not horizontal.
        """
        self.surface, self.sand, self.law = surface, sand, get_law(law)
        self.terrain: FreeSurface | Terrain = FreeSurface() if terrain is None else terrain
        self._bed = layout.pack_bed(sand, self.law, self.terrain, plane)
        self._packed = layout.pack_surface(surface.clustered(layout.BLOCK))

    def wrench(
        self,
        position: ArrayLike = _REST,
        rotation: ArrayLike = _UPRIGHT,
        velocity: ArrayLike = _REST,
        angular_velocity: ArrayLike = _REST,
    ) -> Wrench:
        """The sand's force and moment at a pose and motion, or at n of them.

        Arguments of n poses go with single ones, which count for each. Many are shared out over the processors.

        Args:
            position: The body's origin [m], shape (3,) or (n, 3).
            rotation: Body to world, shape (3, 3) or (n, 3, 3).
            velocity: Of the body's origin [m/s], shape (3,) or (n, 3).
            angular_velocity: World frame [rad/s], shape (3,) or (n, 3).

        Raises:
            RftsimError: A number is not finite, a rotation turns nothing, or shapes do not fit one another.
        """
        many, motion = _motions(position, rotation, velocity, angular_velocity)
        out = evaluate.wrenches_of(self._bed, self._packed, motion)
        return Wrench(out[:, :3], out[:, 3:]) if many else Wrench(out[0, :3], out[0, 3:])


def surface_force(
    surface: Surface,
    sand: Sand,
    law: "str | Law" = "rft3d",
    *,
    position: ArrayLike = _REST,
    rotation: ArrayLike = _UPRIGHT,
    velocity: ArrayLike = _REST,
    angular_velocity: ArrayLike = _REST,
    plane: ArrayLike = (0.0, 1.0, 0.0),
    terrain: FreeSurface | Terrain | None = None,
) -> SurfaceForce:
    """Force of sand on a surface that moves as a rigid body, with that on each triangle; for many poses, `Intruder`.

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

    Raises:
        SandError: The law reads a parameter that is unknown of the sand.
        ValueError: There is no such law, the plane's normal is not horizontal, or a number of the pose or the motion is
            not finite.
    """
    bed = layout.pack_bed(sand, get_law(law), terrain or FreeSurface(), plane)
    many, motion = _motions(position, rotation, velocity, angular_velocity)
    if many:
        raise RftsimError("surface_force takes one pose: Intruder(surface, sand, law).wrench(...) takes many")
    place, turn, v, omega = motion[:3], motion[3:12].reshape(3, 3), motion[12:15], motion[15:]
    stress, depth = evaluate.triangle_stresses(bed, layout.pack_surface(surface), place, turn, v, omega)
    force = stress.T @ surface.areas
    moment = np.cross(surface.centres, stress).T @ surface.areas
    active = evaluate.acts(bed, surface.normals, turn, stress, depth)
    force, moment, stress = turn @ force, turn @ moment, stress @ turn.T
    return SurfaceForce(force, moment, stress, depth, active, power=float(force @ v + moment @ omega))


def _motions(*given: ArrayLike) -> tuple[bool, Array]:
    """Whether there are many poses, and the numbers of all, as `evaluate.wrenches_of` takes them.

    Raises:
        RftsimError: Positions, rotations, velocities and spins do not have the right shapes, or are none.
    """
    arrays = [np.asarray(value, dtype=float) for value in given]
    many = {}
    for (name, shape), array in zip(_SHAPES.items(), arrays, strict=True):
        if array.shape != shape:
            if array.ndim != len(shape) + 1 or array.shape[1:] != shape:
                raise RftsimError(f"{name} must have the shape {shape}, or (n, ...) for n poses, not {array.shape}")
            many[name] = len(array)
    if many:
        if len(set(many.values())) > 1:
            said = ", ".join(f"{count} of {name}" for name, count in many.items())
            raise RftsimError(f"of poses and motions there must be as many each, or one, not {said}")
        shapes = zip(arrays, _SHAPES.values(), strict=True)
        arrays = [np.broadcast_to(array, (next(iter(many.values())), *shape)) for array, shape in shapes]
    motion = np.concatenate([array.ravel() for array in arrays])
    if not math.isfinite(motion.sum()):
        for name, array in zip(_SHAPES, arrays, strict=True):
            if not np.isfinite(array).all():
                raise RftsimError(f"{name} must be finite, and one number is {array[~np.isfinite(array)][0]}")
    if given[1] is not _UPRIGHT and motion.size:
        turns = arrays[1].reshape(-1, 9)
        error = np.max(_rotation_errors(*(turns.T if many else turns[0].tolist())))
        if not error < ROTATION_ERROR:
            raise RftsimError(f"rotation must be orthogonal and right-handed, from which one is {error:.1e} off")
    return bool(many), motion


def _rotation_errors(a0: Any, a1: Any, a2: Any, b0: Any, b1: Any, b2: Any, c0: Any, c1: Any, c2: Any) -> list[Any]:
    """How far rows a, b and c are from unit length, and c from a x b; of one rotation, or of arrays of them."""
    return [
        abs(a0 * a0 + a1 * a1 + a2 * a2 - 1.0),
        abs(b0 * b0 + b1 * b1 + b2 * b2 - 1.0),
        abs(c0 * c0 + c1 * c1 + c2 * c2 - 1.0),
        abs(a1 * b2 - a2 * b1 - c0),
        abs(a2 * b0 - a0 * b2 - c1),
        abs(a0 * b1 - a1 * b0 - c2),
    ]
