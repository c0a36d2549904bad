"""A solid pushed through deep sand in one direction: [Agarwal] section 5.9, what force laws are tested on."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.course import Course
from rftsim_mpm.errors import MpmError, check_not_negative, check_positive
from rftsim_mpm.intruders import intruder, is_its_own_image
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.reading import History
from rftsim_mpm.shapes import Shape
from rftsim_mpm.simulation import Watch

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Push:
    """One solid, its motion and its sand; SI and degrees."""

    shape: str = "sphere"
    """One of section 5.9's solids, or a closed mesh's file [m]."""
    theta: float = 0.0
    """Direction of motion in the x-z plane: 0 horizontal, 90 straight down, negative upward [deg]."""
    depth: float = 0.27
    """Depth of the centroid at the reading [m]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.4
    """Friction between sand and solid [-]."""
    rho: float = 3000.0
    """Critical density of the sand [kg/m^3]."""
    speed: float = 0.2
    """Speed of the solid [m/s]."""
    dx: float = 0.0125
    """Size of a cell [m]."""
    softness: float = 0.02
    """Strain of the sand under the bearing pressure of the reading's depth, rho g z N_q / E."""
    travel: float = 0.04
    """Travel before the reading [m]."""
    bed: float = 1.0
    """Factor on the sand beside and below the solid: two and a half times its radius."""

    def __post_init__(self) -> None:
        if not -180.0 <= self.theta <= 180.0:
            raise MpmError(f"theta must be in [-180, 180] degrees, not {self.theta:g}")
        check_positive(self, "depth", "mu_int", "rho", "speed", "dx", "softness", "travel", "bed")
        check_not_negative(self, "mu_surf")

    @property
    def quick(self) -> "Push":
        """The same with coarser cells, and less sand around: a look, not a measurement."""
        return dataclasses.replace(self, dx=1.6 * self.dx, bed=0.5 * self.bed)

    @property
    def direction(self) -> Array:
        """Unit vector along which the solid moves, shape (3,)."""
        t = math.radians(self.theta)
        return np.array([math.cos(t), 0.0, -math.sin(t)]).round(15)


class PushForce(NamedTuple):
    """Force and moment on one solid at the reading and along its way, and what it cost to compute."""

    force: Array
    """Force of the sand on the solid at the reading, (3,) [N]."""
    moment: Array
    """Moment about its centroid, (3,) [N m]."""
    noise: float
    """Noise of averages over 0.5 ms, relative [-]."""
    history: History
    """Averages along the way."""
    particles: int
    """Particles of the bed, without what the solid displaced at its start."""
    steps: int
    """Time steps of the whole run."""
    seconds: float
    """Time that the computation took [s]."""

    @property
    def report(self) -> dict[str, Any]:
        """The numbers at the reading as JSON has them, by name and unit."""
        return {
            "force": self.force.tolist(),
            "moment_N_m": self.moment.tolist(),
            "noise": self.noise,
            "particles": self.particles,
            "steps": self.steps,
            "seconds": round(self.seconds, 2),
        }

    @property
    def series(self) -> dict[str, Any]:
        """The force along the way as files keep it, thinned."""
        return self.history.series


def course(push: Push, shape: Shape) -> Course:
    """Return the solid's way through the sand; a half is modelled where the rest is its mirror image."""
    young = stiffness(push.rho, 9.81, push.depth, push.mu_int, push.softness)
    window = 0.1 * push.travel
    margin = 2.5 * push.bed * shape.radius
    down = push.direction[2] * (push.travel if push.direction[2] > 0.0 else -window)  # of the lowest place on the way
    return Course(
        shape=shape,
        rotation=np.eye(3),
        direction=push.direction,
        speed=push.speed,
        friction=push.mu_surf,
        material=Material.of_density(push.mu_int, push.rho, young),
        depth=push.depth,
        approach=push.travel,
        window=window,
        margin=margin,
        bed=push.depth + down - float(shape.vertices[:, 2].min()) + margin,
        dx=push.dx,
        mirrors=(False, is_its_own_image(shape)),
    )


def measure(push: Push, watch: Watch | None = None) -> PushForce:
    """Push the solid to a little beyond the reading and return the force on it; `watch` as in `Course.run`."""
    found = course(push, intruder(push.shape)).run(watch)
    return PushForce(
        found.force, found.moment, found.noise, found.history, len(found.sim.particles), found.sim.steps, found.seconds
    )
