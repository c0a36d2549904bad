"""A driven grousered wheel, free to travel and to sink: [Agarwal] section 4.3, Tables 4.1 and 4.2."""

import dataclasses
import math
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import level_bed
from rftsim_mpm.body import Body
from rftsim_mpm.errors import MpmError, check_positive
from rftsim_mpm.follow import Track, follow
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.reading import thinned
from rftsim_mpm.shapes import Shape, disc, wheel
from rftsim_mpm.simulation import Simulation, Watch

Array = NDArray[np.float64]

SIDES = 120
"""Sides of a wheel without grousers."""


@dataclasses.dataclass(frozen=True)
class Wheel:
    """The wheel of Table 4.1 on the poppy seeds of Table 4.2, in plane strain."""

    rpm: float = 30.0
    """Spin, to +x above 0 [1/min]."""
    duration: float | None = None
    """Simulated time; else 1 s and half a turn [s]."""
    entry: float = 0.8
    """Speed at the start over omega r [-]."""
    radius: float = 0.094
    """Radius without grousers [m]."""
    grousers: int = 20
    """How many grousers, or 0."""
    height: float = 0.012
    """Height of a grouser [m]."""
    width: float = 0.006
    """Width of one along the rim [m]."""
    breadth: float = 0.14
    """Breadth, divides all forces [m]."""
    mass_x: float = 23.0
    """Inertia along [kg]."""
    mass_z: float = 6.3
    """Inertia and load across [kg]."""
    push: float = 4.0
    """Forward force [N]."""
    mu_int: float = 0.56
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and wheel [-]."""
    rho: float = 638.0
    """Critical density [kg/m^3]."""
    dx: float = 0.004
    """Cell, less than a grouser [m]."""
    xpic: int = 0
    """Order of XPIC; 0 is FLIP."""
    gravity: float = 9.81
    """Acceleration of gravity [m/s^2]."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rpm) and self.rpm != 0.0):
            raise MpmError(f"rpm must be finite and not zero, not {self.rpm:g}")
        check_positive(
            self, "duration", "radius", "height", "width", "breadth", "mass_x", "mass_z", "mu_int", "rho", "dx"
        )
        if not 2 <= (self.grousers or 2) <= 1000 or self.grousers * self.width >= 2.0 * math.pi * self.radius:
            raise MpmError(
                f"{self.grousers} grousers of {self.width:g} m do not fit on the wheel; none, or 2 to 1000, may"
            )
        if self.xpic < 0:
            raise MpmError(f"xpic must be zero or more, not {self.xpic}")
        if self.grousers and self.width < 1.06 * self.dx:
            raise MpmError(f"grousers {self.width:g} m wide are too thin for cells of {self.dx:g} m: use smaller ones")

    @property
    def quick(self) -> Self:
        """The same with coarser cells, and shorter: a look, not a measurement."""
        return dataclasses.replace(self, dx=min(1.25 * self.dx, self.width / 1.06), duration=min(self.time, 0.5))

    @property
    def outer(self) -> float:
        """Radius of the wheel with its grousers, if it has any [m]."""
        return self.radius + (self.height if self.grousers else 0.0)

    @property
    def time(self) -> float:
        """Simulated time, the default filled in [s]."""
        return self.duration or 1.0 + 30.0 / abs(self.rpm)


class Rolling(NamedTuple):
    """How a wheel rolled: means over the last 40 % of the run, and the run itself."""

    speed: float
    """Mean forward speed [m/s]."""
    sinkage: float
    """Mean sinkage of the outer circle below the level surface [m]."""
    slip: float
    """1 - v / (omega r), r with grousers [-]."""
    drop: float
    """How much lower the surface is behind the wheel than ahead at the end [m]."""
    drift: float
    """Change of the speed over that time, relative: how far from steady the wheel still is [-]."""
    time: Array
    """Times of the whole run, (n,) [s]."""
    speeds: Array
    """Speed at these times, (n,) [m/s]."""
    sinkages: Array
    """Sinkage at these times, (n,) [m]."""
    track: Track
    """The run as it was followed, with a frame of its end."""

    @property
    def report(self) -> dict[str, Any]:
        """The means as JSON has them, by name and unit."""
        return {
            "speed_m_s": self.speed,
            "sinkage_m": self.sinkage,
            "slip": self.slip,
            "surface_drop_m": self.drop,
            "drift": self.drift,
        }

    @property
    def series(self) -> dict[str, Any]:
        """Speed and sinkage over time as files keep them, thinned."""
        return thinned(time_s=self.time, speeds_m_s=self.speeds, sinkages_m=self.sinkages)


def roll(study: Wheel, watch: Watch | None = None) -> Rolling:
    """Lower the wheel onto a bed, spin it and let it go, and return how it rolled."""
    sim = prepare(study)
    track = follow(sim, study.time, watch)
    level = bed_depth(study)
    speeds, sinkages = track.velocity[:, 0, 0], level + study.outer - track.position[:, 0, 1]
    late = track.time >= 0.6 * study.time
    speed, sinkage = float(speeds[late].mean()), float(sinkages[late].mean())
    slope = float(np.polyfit(track.time[late], speeds[late], 1)[0])
    slip, drift = 1.0 - speed / (omega_of(study) * study.outer), 0.4 * study.time * slope / speed
    drop = _drop(study, track.frames[-1].surface, float(sim.bodies[0].position[0]))
    return Rolling(speed, sinkage, slip, drop, drift, track.time, speeds, sinkages, track)


def prepare(study: Wheel) -> Simulation:
    """The bed, a half of a grouser's height into which the wheel has sunk, at its speed of entry."""
    omega, outer, dx = omega_of(study), study.outer, study.dx
    depth = bed_depth(study)
    before = 2.5 * outer
    length = math.ceil((2.0 * before + abs(omega) * outer * study.time) / dx) * dx
    young = stiffness(study.rho, study.gravity, 0.3 * outer, study.mu_int, 0.01)
    material = Material.of_density(study.mu_int, study.rho, young)
    weight = study.mass_z * study.gravity
    body = Body(
        outline(study),
        np.array([before if omega >= 0.0 else length - before, depth + outer - 0.5 * study.height]),
        np.array([study.entry * omega * outer, 0.0]),
        study.mu_surf,
        spin=np.array([omega]),
        mass=np.array([study.mass_x, study.mass_z]) / study.breadth,
        load=np.array([math.copysign(study.push, omega), -weight]) / study.breadth,
    )
    sim = Simulation(
        material,
        level_bed(material, (length, depth), dx, gravity=study.gravity),
        dx,
        (length, depth + 3.0 * outer),
        bodies=[body],
        gravity=study.gravity,
        wall_friction=study.mu_int,
        xpic=study.xpic,
    )
    sim.clear_bodies()
    return sim


def omega_of(study: Wheel) -> float:
    """Return the spin of the wheel [rad/s]."""
    return study.rpm * 2.0 * math.pi / 60.0


def outline(study: Wheel) -> Shape:
    """Return the wheel's outline, about its axle."""
    if not study.grousers:
        return disc(study.radius, SIDES)
    return wheel(study.radius, study.grousers, study.height, study.width)


def bed_depth(study: Wheel) -> float:
    """Depth of the bed, in whole cells [m]."""
    return math.ceil(1.5 * study.outer / study.dx) * study.dx


def _drop(study: Wheel, surface: Array, middle: float) -> float:
    """How much lower the surface is behind the wheel than ahead, each from one to two radii from its middle [m]."""
    outer, way = study.outer, math.copysign(1.0, study.rpm)
    behind, ahead = (
        surface[(way * s * (surface[:, 0] - middle) > outer) & (way * s * (surface[:, 0] - middle) < 2.0 * outer)]
        for s in (-1.0, 1.0)
    )
    return float(ahead[:, 1].mean() - behind[:, 1].mean())
