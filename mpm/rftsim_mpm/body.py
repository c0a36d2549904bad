"""Rigid intruders: where they are, and how forces move them."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.shapes import Shape

Array = NDArray[np.float64]


def speeding_up(velocity: Array, way: float) -> Callable[[float], tuple[Array, Array]]:
    """Return the `steer` of a body that comes evenly from rest to a velocity [m/s] over a way [m], without spin."""
    spin = np.zeros(1 if velocity.size == 2 else 3)
    duration = 2.0 * way / float(np.linalg.norm(velocity))
    return lambda time: (velocity if time >= duration else time / duration * velocity, spin)


@dataclasses.dataclass
class Body:
    """A shape with a motion, which infinite mass or inertia prescribes, along each axis on its own.

    In the plane, rotation is about y (into the page with x to the right and z up), so a positive spin rolls towards +x.
    """

    shape: Shape
    """The body's surface, about the origin of its own frame."""
    position: Array
    """Place of the shape's origin, (dim,) [m]."""
    velocity: Array
    """Velocity of the shape's origin, (dim,) [m/s]."""
    friction: float = 0.0
    """mu_surf between the surface and the sand [-]."""
    rotation: Array = dataclasses.field(default_factory=lambda: np.zeros(0))
    """Rotation from the shape's frame to the world, (dim, dim); the identity if not given."""
    spin: Array = dataclasses.field(default_factory=lambda: np.zeros(0))
    """Angular velocity: (1,) about y in the plane, (3,) in space [rad/s]; zero if not given."""
    mass: Array | float = math.inf
    """Mass for each axis or for all [kg, in the plane kg/m]: carriages have different inertia along and across."""
    inertia: Array | float = math.inf
    """Inertia, (3, 3) in the shape's frame in space, a number in the plane [kg m^2, in the plane kg m]."""
    load: Array | float = 0.0
    """External force, weight included, for each axis or for all [N, in the plane N/m]."""
    steer: Callable[[float], tuple[Array, Array]] | None = None
    """Velocity and spin as functions of time, instead of the constant ones."""

    def __post_init__(self) -> None:
        dim = self.shape.dim
        self.position = np.array(self.position, float)
        self.velocity = np.array(self.velocity, float)
        self.rotation = np.eye(dim) if self.rotation.size == 0 else np.array(self.rotation, float)
        self.spin = np.zeros(1 if dim == 2 else 3) if self.spin.size == 0 else np.array(self.spin, float)
        if self.position.shape != (dim,) or self.velocity.shape != (dim,):
            raise MpmError(f"{self.shape.name} needs {dim} components of position and velocity")
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise MpmError(f"friction of {self.shape.name} must be zero or positive, not {self.friction:g}")
        if (np.asarray(self.mass) <= 0.0).any():
            raise MpmError(f"mass of {self.shape.name} must be positive")

    @property
    def vertices(self) -> Array:
        """Corners of the shape in the world, shape (n, dim) [m]."""
        found: Array = self.position + self.shape.vertices @ self.rotation.T
        return found

    def to_world(self, points: Array) -> Array:
        """Return points of the shape's frame in the world, shape (n, dim) [m]."""
        found: Array = self.position + points @ self.rotation.T
        return found

    def to_local(self, points: Array) -> Array:
        """Return points of the world in the shape's frame, shape (n, dim) [m]."""
        found: Array = (points - self.position) @ self.rotation
        return found

    def advance(self, force: Array, moment: Array, time: float, dt: float) -> None:
        """Move by one step under the sand's force [N] and moment about the origin [N m]: velocity first, then place."""
        if self.steer is not None:
            self.velocity, self.spin = self.steer(time)
        else:
            self.velocity = self.velocity + dt * (force + self.load) / self.mass
            self.spin = self.spin + dt * self._angular_acceleration(moment)
        self.position = self.position + dt * self.velocity
        if self.spin.any():
            self.rotation = turned(self.rotation, self.spin * dt)

    def _angular_acceleration(self, moment: Array) -> Array:
        if np.ndim(self.inertia) == 0:
            return moment / self.inertia
        tensor = self.rotation @ np.asarray(self.inertia) @ self.rotation.T
        found: Array = np.linalg.solve(tensor, moment - np.cross(self.spin, tensor @ self.spin))
        return found


def plane_rotation(angle: float) -> Array:
    """Return the rotation by an angle [rad] about y of places (x, z), shape (2, 2)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def turned(rotation: Array, angle: Array) -> Array:
    """Return a rotation turned further by a rotation vector in the world, (1,) or (3,) [rad]: Rodrigues' formula."""
    if angle.size == 1:
        return plane_rotation(float(angle[0])) @ rotation
    size = float(np.linalg.norm(angle))
    k = np.array([[0.0, -angle[2], angle[1]], [angle[2], 0.0, -angle[0]], [-angle[1], angle[0], 0.0]])
    found: Array = (
        np.eye(3) + np.sinc(size / np.pi) * k + 0.5 * np.sinc(size / (2.0 * np.pi)) ** 2 * (k @ k)
    ) @ rotation
    return found
