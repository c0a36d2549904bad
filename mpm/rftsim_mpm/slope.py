"""A flat plate moved through a slope: which depth and which "up" a force law should take there.

The bed stays along the grid and gravity leans instead. All angles are those of `Plate`, from the surface and its
normal; a plate on level ground (slope 0) at the same angles has the same place in the sand, and one turned back by the
slope has the same place to gravity.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm import plate
from rftsim_mpm.course import Course
from rftsim_mpm.errors import MpmError
from rftsim_mpm.plate import Plate, PlateForce
from rftsim_mpm.simulation import Watch

Array = NDArray[np.float64]
GRAVITY = 9.81
"""Strength of gravity [m/s^2]."""


@dataclasses.dataclass(frozen=True)
class Slope(Plate):
    """One plate that moves in a slope; SI and degrees, from the surface."""

    slope: float = 20.0
    """Fall of the surface along the motion [deg]."""
    mu_int: float = 0.5
    """Friction of the sand, above the slope [-]."""
    depth: float | None = 0.04
    """Depth of the reading, along the normal [m]."""
    softness: float = 0.01
    """Strain of the sand, rho g z N_q / E."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.psi:
            raise MpmError(f"a slope falls along the plate's motion: psi must be zero, not {self.psi:g}")
        if not math.tan(math.radians(abs(self.slope))) < self.mu_int:
            raise MpmError(
                f"sand of mu_int {self.mu_int:g} does not stand at {self.slope:g} degrees: the slope must be below "
                f"{math.degrees(math.atan(self.mu_int)):.1f}"
            )

    @property
    def gravity(self) -> Array:
        """Acceleration in the surface's axes, shape (dim,) [m/s^2]."""
        t = math.radians(self.slope)
        along, across = GRAVITY * math.sin(t), -GRAVITY * math.cos(t)
        return np.array([along, across] if self.dim == 2 else [along, 0.0, across])

    @property
    def as_to_surface(self) -> "Slope":
        """The same plate on level ground, as it lies and moves to the surface."""
        return dataclasses.replace(self, slope=0.0)

    @property
    def as_to_gravity(self) -> "Slope":
        """The same plate on level ground, as it lies and moves to gravity; mirrored if it would move backward."""
        beta, gamma = self.beta - self.slope, self.gamma + self.slope
        if self.turned_back:
            beta, gamma = -beta, math.copysign(180.0, gamma) - gamma
        beta += 0.0 - 180.0 * round(beta / 180.0 - 1e-9)  # never minus zero, nor minus 90
        return dataclasses.replace(self, beta=beta, gamma=gamma, slope=0.0)

    @property
    def turned_back(self) -> bool:
        """Whether the plate moves backward along the level, so that its image stands for it."""
        return abs(self.gamma + self.slope) > 90.0


def course(job: Slope) -> Course:
    """Return the plate's way through the slope: always the same travel, and sand that sticks to floor and walls.

    Where a wall is a mirror in the middle of the plate, it does not.
    """
    way = plate.course(job)
    friction = np.full((job.dim, 2), math.inf)
    friction[1:-1, 0] = 0.0 if way.mirrors[-1] else math.inf
    return dataclasses.replace(
        way,
        approach=job.buried * job.length,
        mirrors=(False, *way.mirrors[1:]),
        gravity=job.gravity,
        wall_friction=friction,
    )


def measure(job: Slope, watch: Watch | None = None) -> PlateForce:
    """Move the plate to a little beyond the reading and return the force on it, in the surface's axes."""
    return plate.reading(job, course(job), watch)
