"""A foot pressed twice into the same place: how much weaker the second push is, and what print the first one leaves."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import level_bed
from rftsim_mpm.body import Body
from rftsim_mpm.errors import MpmError, check_not_negative, check_positive
from rftsim_mpm.follow import stage
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.plate import spread
from rftsim_mpm.reading import averaged
from rftsim_mpm.relief import Relief, read_relief
from rftsim_mpm.shapes import box
from rftsim_mpm.simulation import Simulation, Watch

Array = NDArray[np.float64]

SHARES = (0.2, 0.4, 0.6, 0.8, 0.95)
"""Shares of the first push's depth at which both are compared [-]."""


@dataclasses.dataclass(frozen=True)
class Footprint:
    """A flat foot, upright walls above it, pressed into a level bed, lifted out, and pressed again, in plane strain."""

    length: float = 0.05
    """Length of the foot [m]."""
    depth: float = 0.03
    """How deep its base is pressed first [m]."""
    again: float = 0.045
    """How deep its base is pressed the second time [m]."""
    speed: float = 0.1
    """Speed of the foot, down and up [m/s]."""
    rest: float = 0.3
    """Time for the print's walls to slide, after the foot has left [s]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and foot [-]."""
    rho: float = 1512.0
    """Critical density of the sand [kg/m^3]."""
    cells: float = 10.0
    """Cells per length of the foot."""
    softness: float = 0.01
    """Strain of the sand under the bearing pressure of the greatest depth, rho g z N_q / E."""
    calm: float = 0.01
    """As in `Simulation` [s]."""
    bed: float = 1.0
    """Factor on the sand beside and below the foot."""

    def __post_init__(self) -> None:
        check_positive(self, "length", "depth", "again", "speed", "rest", "mu_int", "rho", "softness", "bed")
        check_not_negative(self, "mu_surf", "calm")
        if not 4.0 <= self.cells <= 200.0:
            raise MpmError(f"cells must be in [4, 200], not {self.cells:g}")

    @property
    def quick(self) -> "Footprint":
        """The same with six cells, and less sand around: a look, not a measurement."""
        return dataclasses.replace(self, cells=6.0, bed=0.7 * self.bed)

    @property
    def dx(self) -> float:
        """Size of a cell of the grid [m]."""
        return self.length / self.cells

    @property
    def height(self) -> float:
        """Height of the foot [m]: its top stays above the sand."""
        return max(self.depth, self.again) + 0.5 * self.length

    @property
    def clear(self) -> float:
        """How high above the undisturbed sand the base is lifted [m]."""
        return 0.4 * self.length

    @property
    def level(self) -> float:
        """Depth of the bed, in whole cells [m]."""
        return math.ceil((max(self.depth, self.again) + 0.6 * self.margin) / self.dx) * self.dx

    @property
    def margin(self) -> float:
        """Width of the sand beside the foot [m]."""
        return self.bed * spread(self.mu_int) * self.length


class Prints(NamedTuple):
    """Two pushes into one place, and the surface between them."""

    first: tuple[Array, Array]
    """Depth of the base below the undisturbed surface [m] and upward force [N/m] of the first push, (n,) each."""
    second: tuple[Array, Array]
    """The same of the second push."""
    pressed: Relief
    """The surface when the foot is as deep as it goes at first; x from its middle, here and in the next two."""
    left: Relief
    """The surface that the foot has left, walls slid."""
    end: Relief
    """The surface at the end of the second push."""
    length: float
    """Length of the foot [m]."""

    def ratio(self, depth: Array) -> Array:
        """Return the second push's force over the first's at depths below the undisturbed surface, (n,) [m].

        Forces are means over a twentieth of the first push's depth to either side.
        """
        window = 0.05 * float(self.first[0][-1])
        found = [[force[np.abs(z - d) <= window].mean() for d in depth] for z, force in (self.second, self.first)]
        ratio: Array = np.array(found[0]) / np.array(found[1])
        return ratio

    @property
    def touch(self) -> float:
        """Depth at which the second push first feels a twentieth of the first push's last force [m]."""
        feels = self.second[1] > 0.05 * self.first[1][-20:].mean()
        return float(self.second[0][int(feels.argmax())])

    @property
    def report(self) -> dict[str, Any]:
        """The numbers as JSON has them, by name and unit; ratios are the second push's force over the first's.

        The depth of the print is its mean over the middle half of the foot.
        """
        depths = np.array(SHARES) * float(self.first[0][-1])
        return {
            "depths_m": depths.tolist(),
            "ratios": self.ratio(depths).tolist(),
            "touch_m": self.touch,
            "print_m": -float(self.left.part(0.0, 0.25 * self.length).height.mean()),
            "rim_m": float(self.left.height.max()),
            "rim_over_print": self.left.raised / self.left.hollow,
            "wall_deg": self.left.wall_slope(),
            "missed": self.left.missed,
        }

    @property
    def series(self) -> dict[str, Any]:
        """The pushes and the surfaces as files keep them."""
        pushes = {
            name: averaged(depth_m=push[0], force_N_m=push[1])
            for name, push in (("first", self.first), ("second", self.second))
        }
        surfaces = {name: getattr(self, name).kept() for name in ("pressed", "left", "end")}
        return pushes | surfaces


def press(study: Footprint, watch: Watch | None = None) -> Prints:
    """Press the foot in, lift it out, let the sand come to rest, and press it in again; a half of it is modelled."""
    sim = _prepared(study)
    foot = sim.bodies[0]
    away = study.depth + study.clear
    ways = [(-study.speed, study.depth / study.speed), (study.speed, away / study.speed), (0.0, study.rest),
            (-study.speed, (study.clear + study.again) / study.speed)]  # fmt: skip
    total = sum(duration for _, duration in ways)
    pushes, reliefs = [], []
    for velocity, duration in ways:
        foot.velocity = np.array([0.0, velocity])
        track = stage(sim, duration, total, watch)
        pushes.append((study.level + 0.5 * study.height - track.position[:, 0, 1], 2.0 * track.force[:, 0, 1]))
        reliefs.append(read_relief(sim, study.level))
    return Prints(pushes[0], pushes[3], reliefs[0], reliefs[2], reliefs[3], study.length)


def _prepared(study: Footprint) -> Simulation:
    """The bed's half beside a mirror, the foot's base on it."""
    dx = study.dx
    width = math.ceil((0.5 * study.length + study.margin) / dx) * dx
    depth = max(study.depth, study.again)
    material = Material.of_density(
        study.mu_int, study.rho, stiffness(study.rho, 9.81, depth, study.mu_int, study.softness)
    )
    foot = Body(
        box(study.length, study.height),
        np.array([0.0, study.level + 0.5 * study.height]),
        np.zeros(2),
        study.mu_surf,
    )
    friction = np.array([[0.0, 0.0], [study.mu_int, 0.0]])
    size = (width, study.level + study.clear + study.height + 4.0 * dx)
    bed = level_bed(material, (width, study.level), dx)
    return Simulation(material, bed, dx, size, bodies=[foot], wall_friction=friction, calm=study.calm)
