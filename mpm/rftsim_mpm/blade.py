"""An upright blade dragged at constant depth: how the heap ahead of it grows, and the drag with it."""

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
from rftsim_mpm.reading import averaged
from rftsim_mpm.relief import Relief, read_relief
from rftsim_mpm.shapes import box
from rftsim_mpm.simulation import Simulation, Watch

Array = NDArray[np.float64]

SHARES = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Shares of the way after which the surface is read [-]."""


@dataclasses.dataclass(frozen=True)
class Blade:
    """An upright blade whose top stays above the sand, dragged through a level bed, in plane strain."""

    depth: float = 0.03
    """Depth of its lower edge [m]."""
    thickness: float = 0.012
    """Thickness of the blade [m]."""
    travel: float = 0.24
    """Length of the way [m]."""
    speed: float = 0.1
    """Speed of the blade [m/s]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and blade [-]."""
    rho: float = 1512.0
    """Critical density of the sand [kg/m^3]."""
    cells: float = 10.0
    """Cells per depth of the blade."""
    softness: float = 0.01
    """Strain of the sand under the bearing pressure of the blade's depth and its heap's height, rho g z N_q / E."""
    calm: float = 0.005
    """As in `Simulation` [s]."""
    bed: float = 1.0
    """Factor on the sand behind, ahead and below."""

    def __post_init__(self) -> None:
        check_positive(self, "depth", "thickness", "travel", "speed", "mu_int", "rho", "softness", "bed")
        check_not_negative(self, "mu_surf", "calm")
        if not 4.0 <= self.cells <= 200.0:
            raise MpmError(f"cells must be in [4, 200], not {self.cells:g}")
        if self.thickness < 1.06 * self.dx:
            raise MpmError(f"a blade of {self.thickness:g} m is too thin for cells of {self.dx:g} m: use smaller ones")

    @property
    def quick(self) -> "Blade":
        """The same with four cells, and half as far: a look, not a measurement."""
        return dataclasses.replace(self, cells=4.0, travel=0.5 * self.travel)

    @property
    def dx(self) -> float:
        """Size of a cell of the grid [m]."""
        return self.depth / self.cells

    @property
    def heap(self) -> float:
        """Height of a heap that holds all that the blade sweeps, and slopes as steeply as sand can [m]."""
        return math.sqrt(2.0 * self.depth * self.travel * self.mu_int)

    @property
    def level(self) -> float:
        """Depth of the bed, in whole cells [m]."""
        return math.ceil(self.depth * (1.0 + 4.0 * self.bed) / self.dx) * self.dx


class Heap(NamedTuple):
    """Drag of a blade along its way, and the surface after parts of it."""

    travel: Array
    """Distance moved, (n,) [m]."""
    force: Array
    """Force of the sand on the blade, along its way and upward, (n, 2) [N/m]."""
    reliefs: list[Relief]
    """The surface after each of SHARES of the way; x from the blade's leading face."""

    def drag(self, low: float, high: float) -> float:
        """Return the mean drag from one share of the way to another [N/m]."""
        way = self.travel / self.travel[-1]
        return -float(self.force[(way >= low) & (way <= high), 0].mean())

    @property
    def growth(self) -> tuple[float, float]:
        """Drag without a heap [N/m], and growth with the travel [N/m^2], of a line through the first half of the way.

        Its first twentieth, in which the sand only begins to yield, is left out.
        """
        way = self.travel / self.travel[-1]
        own = (way >= 0.05) & (way <= 0.5)
        slope, start = np.polyfit(self.travel[own], -self.force[own, 0], 1)
        return float(start), float(slope)

    @property
    def report(self) -> dict[str, Any]:
        """The numbers as JSON has them, by name and unit; lists are for each of SHARES."""
        ahead = [relief.part(0.0, math.inf) for relief in self.reliefs]
        start, slope = self.growth
        return {
            "start_N_m": start,
            "growth_N_m2": slope,
            "travel_m": [share * float(self.travel[-1]) for share in SHARES],
            "drag_N_m": [self.drag(share - 0.05, share) for share in SHARES],
            "heap_m": [float(relief.height.max()) for relief in ahead],
            "front_deg": [relief.front_slope() for relief in ahead],
            "raised_m2": [relief.raised for relief in ahead],
            "missed": [relief.missed for relief in self.reliefs],
        }

    @property
    def series(self) -> dict[str, Any]:
        """Drag and surfaces as files keep them."""
        return {
            **averaged(way_m=self.travel, force_N_m=self.force),
            "surfaces": [relief.kept() for relief in self.reliefs],
        }


def plow(study: Blade, watch: Watch | None = None) -> Heap:
    """Drag the blade, which begins at its depth in level sand."""
    sim = _prepared(study)
    start = float(sim.bodies[0].position[0])
    total = study.travel / study.speed
    tracks, reliefs = [], []
    for share, before in zip(SHARES, (0.0, *SHARES), strict=False):
        tracks.append(stage(sim, (share - before) * total, total, watch))
        face = float(sim.bodies[0].position[0]) + 0.5 * study.thickness
        relief = read_relief(sim, study.level)
        reliefs.append(relief._replace(x=relief.x - face))
    travel = np.concatenate([track.position[:, 0, 0] for track in tracks]) - start
    return Heap(travel, np.concatenate([track.force[:, 0] for track in tracks]), reliefs)


def _prepared(study: Blade) -> Simulation:
    """The level bed, with the blade at its depth in the place of the sand that was there."""
    dx = study.dx
    behind = study.bed * 4.0 * study.depth
    ahead = study.travel + study.heap / study.mu_int + behind
    width = math.ceil((behind + study.thickness + ahead) / dx) * dx
    young = stiffness(study.rho, 9.81, study.depth + study.heap, study.mu_int, study.softness)
    material = Material.of_density(study.mu_int, study.rho, young)
    height = study.depth + 1.5 * study.heap
    place = np.array([behind + 0.5 * study.thickness, study.level - study.depth + 0.5 * height])
    blade = Body(box(study.thickness, height), place, np.array([study.speed, 0.0]), study.mu_surf)
    friction = np.array([[0.0, 0.0], [study.mu_int, 0.0]])
    bed = level_bed(material, (width, study.level), dx)
    size = (width, study.level + height + 4.0 * dx)
    sim = Simulation(material, bed, dx, size, bodies=[blade], wall_friction=friction, calm=study.calm)
    sim.clear_bodies()
    return sim
