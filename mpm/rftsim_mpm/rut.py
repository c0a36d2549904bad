"""A driven wheel's second pass in its own rut: how deep it sinks and how much it slips, beside the first."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError, check_not_negative, check_positive
from rftsim_mpm.follow import stage
from rftsim_mpm.reading import averaged
from rftsim_mpm.relief import Relief, read_relief
from rftsim_mpm.simulation import Simulation, Watch
from rftsim_mpm.wheel import Wheel, bed_depth, omega_of, prepare

Array = NDArray[np.float64]

ENTRY = 0.4
"""Share of the first pass's way, at its beginning, in which the wheel still finds its depth and speed [-]."""

FEWEST_RADII = 2.5
"""Shortest way, in radii: the last radius of it, where the wheel leaves a heap, is not compared either [-]."""


@dataclasses.dataclass(frozen=True)
class Rut(Wheel):
    """The wheel of `Wheel`, driven over level sand, taken up, put back to where it began, and driven again."""

    rest: float = 0.3
    """Time for the rut's walls to slide, between the passes [s]."""
    calm: float = 0.01
    """As in `Simulation` [s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "rest")
        check_not_negative(self, "calm")

    @property
    def quick(self) -> "Rut":
        """The same with coarser cells, and hardly further than is compared: a look, not a measurement."""
        return dataclasses.replace(self, dx=self.width / 1.06, duration=48.0 / abs(self.rpm) * 0.75, rest=0.1)


class Pass(NamedTuple):
    """One pass along its way."""

    travel: Array
    """Distance from the start, (n,) [m]."""
    speed: Array
    """Forward speed, (n,) [m/s]."""
    sinkage: Array
    """Sinkage of the outer circle below the undisturbed surface, (n,) [m]."""

    def over(self, low: float, high: float) -> tuple[float, float]:
        """Return the mean speed, by distance over time, and the mean sinkage between two places [m/s, m]."""
        own = (self.travel >= low) & (self.travel <= high)
        return 1.0 / float(np.mean(1.0 / self.speed[own])), float(self.sinkage[own].mean())

    def kept(self) -> dict[str, Any]:
        """Return the pass as files keep it, thinned."""
        return averaged(travel_m=self.travel, speed_m_s=self.speed, sinkage_m=self.sinkage)


class Passes(NamedTuple):
    """Two passes over one stretch, and the surface that each leaves."""

    first: Pass
    """The pass over level sand."""
    second: Pass
    """The pass in the rut of the first."""
    left: Relief
    """The surface that the first pass leaves; x from where the wheel began, here and in the next."""
    end: Relief
    """The surface that the second pass leaves."""
    stretch: tuple[float, float]
    """Where the passes are compared [m]."""
    rim: float
    """Speed of the grousers' tips, omega r [m/s]."""

    @property
    def report(self) -> dict[str, Any]:
        """The numbers as JSON has them, by name and unit; of both passes, or surfaces, in this order."""
        (v1, z1), (v2, z2) = (one.over(*self.stretch) for one in (self.first, self.second))
        return {
            "stretch_m": list(self.stretch),
            "slip": [1.0 - v1 / self.rim, 1.0 - v2 / self.rim],
            "sinkage_m": [z1, z2],
            "rut_m": [-float(relief.part(*self.stretch).height.mean()) for relief in (self.left, self.end)],
            "missed": [self.left.missed, self.end.missed],
        }

    @property
    def series(self) -> dict[str, Any]:
        """The passes and the surfaces as files keep them."""
        return {name: getattr(self, name).kept() for name in ("first", "second", "left", "end")}


def follow_rut(study: Rut, watch: Watch | None = None) -> Passes:
    """Drive the wheel over its bed twice."""
    sim = prepare(study)
    sim.calm = study.calm
    wheel, level = sim.bodies[0], bed_depth(study)
    start, rotation, mass = wheel.position.copy(), wheel.rotation.copy(), wheel.mass
    entry, spin = wheel.velocity.copy(), wheel.spin.copy()
    total = 2.0 * (study.time + study.rest)

    def drive() -> Pass:
        track = stage(sim, study.time, total, watch)
        away = np.sign(study.rpm) * (track.position[:, 0, 0] - start[0])
        sunk = level + study.outer - track.position[:, 0, 1]
        return Pass(away, np.sign(study.rpm) * track.velocity[:, 0, 0], sunk)

    def surface() -> Relief:
        relief = read_relief(sim, level)
        return relief._replace(x=relief.x - start[0])

    first = drive()
    if not first.travel[-1] > FEWEST_RADII * study.outer:
        raise MpmError(
            f"the wheel came {first.travel[-1]:.2g} m far; two passes are compared from {FEWEST_RADII:g} radii of "
            f"{study.outer:g} m on: a longer duration, or another rpm"
        )
    _hold(sim, study)
    stage(sim, study.rest, total, watch)
    left = surface()
    wheel.position = np.array([start[0], level + _rest_height(left, study.outer)])
    wheel.rotation, wheel.velocity, wheel.spin, wheel.mass = rotation, entry, spin, mass
    second = drive()
    _hold(sim, study)
    stage(sim, study.rest, total, watch)
    far = min(float(first.travel[-1]) - study.outer, float(second.travel[-1]))
    stretch = ENTRY * float(first.travel[-1]), far
    return Passes(first, second, left, surface(), stretch, abs(omega_of(study)) * study.outer)


def _hold(sim: Simulation, study: Rut) -> None:
    """Take the wheel up, clear of all sand, and hold it there."""
    wheel = sim.bodies[0]
    wheel.position = np.array([wheel.position[0], sim.size[1] - study.outer - 2.0 * study.dx])
    wheel.velocity, wheel.spin, wheel.mass = np.zeros(2), np.zeros(1), math.inf


def _rest_height(relief: Relief, radius: float) -> float:
    """Height of the centre of a circle about x = 0 that touches a surface from above [m]."""
    below = relief.part(-radius, radius)
    return float((below.height + np.sqrt(radius**2 - below.x**2)).max())
