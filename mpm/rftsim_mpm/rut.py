"""A driven wheel's second pass in its own rut: how deep it sinks and how much it slips, beside the first."""

import copy
import dataclasses
import math
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.body import Body
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
    def whole(self) -> float:
        """Simulated time of both passes and what follows each [s]."""
        return 2.0 * (self.time + self.rest)

    @property
    def quick(self) -> Self:
        """The same with coarser cells, and hardly further than is compared: a look, not a measurement."""
        return dataclasses.replace(self, dx=self.width / 1.06, duration=48.0 / abs(self.rpm) * 0.75, rest=0.1)


class Pass(NamedTuple):
    """Speed and sinkage of a wheel along one pass."""

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
    """The surface that the first pass leaves; x from where the wheel began, the way that it goes, here and below."""
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
    began = copy.copy(sim.bodies[0])
    first = _drive(sim, study, began, watch)
    if not first.travel[-1] > FEWEST_RADII * study.outer:
        raise MpmError(
            f"the wheel came {first.travel[-1]:.2g} m far; two passes are compared from {FEWEST_RADII:g} radii of "
            f"{study.outer:g} m on: a longer duration, or another rpm"
        )
    left = _left(sim, study, began, watch)
    began.position[1] = bed_depth(study) + _rest_height(left, study.outer)
    sim.bodies[0] = copy.copy(began)
    second = _drive(sim, study, began, watch)
    end = _left(sim, study, began, watch)
    far = min(float(first.travel[-1]) - study.outer, float(second.travel[-1]))
    return Passes(first, second, left, end, (ENTRY * float(first.travel[-1]), far), abs(omega_of(study)) * study.outer)


def _drive(sim: Simulation, study: Rut, began: Body, watch: Watch | None) -> Pass:
    """Let the wheel roll for the study's time, from where it is."""
    track, way = stage(sim, study.time, study.whole, watch), np.sign(study.rpm)
    away = way * (track.position[:, 0, 0] - began.position[0])
    sunk = bed_depth(study) + study.outer - track.position[:, 0, 1]
    return Pass(away, way * track.velocity[:, 0, 0], sunk)


def _left(sim: Simulation, study: Rut, began: Body, watch: Watch | None) -> Relief:
    """Take the wheel up, clear of all sand, hold it there until the walls have slid, and read the surface."""
    wheel = sim.bodies[0]
    wheel.position = np.array([wheel.position[0], sim.size[1] - study.outer - 2.0 * study.dx])
    wheel.velocity, wheel.spin, wheel.mass = np.zeros(2), np.zeros(1), math.inf
    stage(sim, study.rest, study.whole, watch)
    relief, way = read_relief(sim, bed_depth(study)), 1 if study.rpm > 0.0 else -1
    return relief._replace(x=(way * (relief.x - began.position[0]))[::way], height=relief.height[::way])


def _rest_height(relief: Relief, radius: float) -> float:
    """Height of the centre of a circle about x = 0 that touches a surface from above [m]."""
    below = relief.part(-radius, radius)
    return float((below.height + np.sqrt(radius**2 - below.x**2)).max())
