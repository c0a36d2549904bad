"""A wheel held at a prescribed slip, as in a single-wheel testbed: at a sinkage, or free to sink under its load.

Load, drawbar, torque and sinkage come out.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import Particles, level_bed
from rftsim_mpm.body import Body
from rftsim_mpm.errors import MpmError, check_not_negative
from rftsim_mpm.fields import Frame
from rftsim_mpm.follow import follow
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.reading import averaged
from rftsim_mpm.rim import Rim
from rftsim_mpm.settings import later
from rftsim_mpm.shapes import Shape, drum, extruded
from rftsim_mpm.simulation import SPACING, Simulation, Watch
from rftsim_mpm.wheel import Wheel, omega_of, outline

Array = NDArray[np.float64]

TURN = 1.5
"""Contact lengths by which the rim of a held wheel turns; forces are read in the second half."""
SETTLING = 2.0
"""How many times as long a wheel turns that first has to sink."""
EXPECTED = 0.35
"""Sinkage of such a wheel over its radius, for which it has sand enough [-]."""
ROOM = ((0.5, 1.0), (1.2, 1.8))
"""Sand below and ahead of a held wheel, and of one that sinks under its load, which shears and shoves more [radii]."""
SPARSE = 0.5
"""Distance between the points of a wheel in space [cells]: it has many, and more make no difference."""
LOOK_EVERY = 10
"""Steps between looks at the pressure on the rim."""
PITCHES = 20
"""Pitches of a wheel without grousers: turns of a twentieth are what its noise is told from."""


@dataclasses.dataclass(frozen=True)
class HeldWheel(Wheel):
    """The wheel of `Wheel`: free, held at a slip, or at a slip and a sinkage."""

    prescribed_slip: float | None = None
    """Slip if held, 1 - v / (omega r) [-]."""
    prescribed_sinkage: float | None = None
    """Sinkage of its tips; else it sinks [m]."""
    shift: float = 0.0
    """If held, place on the grid [cells]."""
    calm: float = 0.01
    """If held, as in `Simulation` [s]."""
    dim: int = later(2)
    """2: plane strain; 3: in space, if held."""
    mu_2: float | None = later(None)
    """If held, mu_2 of mu(I), else no rate [-]."""
    grain: float = later(1e-3)
    """Diameter of grains of mu(I) [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_not_negative(self, "calm")
        if self.prescribed_slip is None and self.prescribed_sinkage is not None:
            raise MpmError("a wheel is held at a slip, or at a slip and a sinkage: prescribed_slip is missing")
        if self.shift not in (0.0, 0.5):
            raise MpmError(f"shift must be 0 or 0.5 cells, not {self.shift:g}")
        if self.dim not in (2, 3):
            raise MpmError(f"dim must be 2 or 3, not {self.dim}")
        if not self.held and self.dim == 3:
            raise MpmError("a free wheel is computed in the plane: prescribe its slip in space")
        if not self.held and self.mu_2 is not None:
            raise MpmError("a free wheel is computed without mu_2: prescribe its slip")
        if not self.held:
            return
        slip = float(self.prescribed_slip or 0.0)
        if not -1.0 <= slip <= 1.0:
            raise MpmError(f"prescribed_slip must be in [-1, 1], not {slip:g}")
        if not 0.0 < self.sunk <= 0.5 * self.outer:
            raise MpmError(f"prescribed_sinkage must be in (0, {0.5 * self.outer:g}] m, not {self.sunk:g}")

    @property
    def held(self) -> bool:
        """Whether it is held: whether its slip is prescribed."""
        return self.prescribed_slip is not None

    @property
    def sinks(self) -> bool:
        """Whether it sinks under its load at a prescribed slip."""
        return self.held and self.prescribed_sinkage is None

    @property
    def sunk(self) -> float:
        """Sinkage that is prescribed, or expected [m]."""
        return EXPECTED * self.outer if self.prescribed_sinkage is None else self.prescribed_sinkage

    @property
    def contact(self) -> float:
        """Length of the level surface that the outer circle cuts when held [m]."""
        return 2.0 * math.sqrt(2.0 * self.outer * self.sunk - self.sunk**2)

    @property
    def time(self) -> float:
        """Simulated time, the default filled in; held, that in which the rim turns by TURN contact lengths [s]."""
        if not self.held or self.duration:
            return super().time
        turn = SETTLING * TURN if self.sinks else TURN
        return turn * self.contact / (abs(omega_of(self)) * self.outer)


class Held(NamedTuple):
    """Forces on a held wheel, means over the second half of the run, and the run itself; per metre of breadth.

    In space they are those of the whole wheel over its breadth.
    """

    means: tuple[float, float, float, float]
    """Load, upward [N/m]; drawbar, along the way [N/m]; torque against the spin [N]: of the sand on the wheel; and
    sinkage of its tips [m]."""
    noise: tuple[float, float, float, float]
    """Standard errors of these, from the means over single pitches of the grousers."""
    sinking: float
    """By how much it goes on sinking in the time of the means [m]."""
    rear: float
    """How far below the level surface the sand leaves the rim behind, where the pressure vanishes [m]."""
    time: Array
    """Times of the whole run, (n,) [s]."""
    forces: Array
    """Load, drawbar [N/m] and torque [N] at these times, (n, 3)."""
    sinkages: Array
    """Sinkage at these times, (n,) [m]."""
    frame: Frame
    """The sand at the end."""

    @property
    def series(self) -> dict[str, Any]:
        """The forces over time as files keep them, in means over neighbouring averages."""
        return averaged(time_s=self.time, forces_N_m=self.forces, sinkages_m=self.sinkages)

    @property
    def report(self) -> dict[str, Any]:
        """The means as JSON has them, by name and unit."""
        names = "load_N_m", "drawbar_N_m", "torque_N", "sinkage_m"
        noises = (f"{name}_noise" for name in names)
        means = dict(zip((*names, *noises), (*self.means, *self.noise), strict=True))
        return {**means, "sinking_m": self.sinking, "rear_m": self.rear}


def hold(study: HeldWheel, watch: Watch | None = None) -> Held:
    """Turn and move a held wheel in a level bed, and return the forces on it and its sinkage.

    Raises:
        MpmError: The wheel is free, or the run too short for means.
    """
    if not study.held:
        raise MpmError("a wheel that is held needs prescribed_slip, and may have prescribed_sinkage")
    pitch = 60.0 / abs(study.rpm) / (study.grousers or PITCHES)
    count = math.floor(0.5 * study.time / pitch)
    if count < 2:
        raise MpmError(f"half of {study.time:g} s must hold two pitches of {pitch:g} s: a longer duration, or more rpm")
    sim = _prepared(study)
    first = sim.bodies[0].position[-1]
    way = math.copysign(1.0, study.rpm)
    rim, first_read = Rim(way), study.time - count * pitch

    def look(sim: Simulation, share: float) -> None:
        if sim.time >= first_read and sim.steps % LOOK_EVERY == 0:
            rim.look(sim)
        if watch is not None:
            watch(sim, share)

    track = follow(sim, study.time, look)
    torque = track.moment[:, 0, 0 if study.dim == 2 else 1]
    forces = np.column_stack([track.force[:, 0, -1], way * track.force[:, 0, 0], -way * torque])
    if study.dim == 3:
        forces *= 2.0 / study.breadth
    sinkages = _first_sinkage(study) + first - track.position[:, 0, -1]
    late = track.time >= first_read
    table = np.column_stack([forces, sinkages])[late]
    parts = np.array([part.mean(axis=0) for part in np.array_split(table, count)])
    noise = parts.std(axis=0, ddof=1) / math.sqrt(count)
    sinking = count * pitch * float(np.polyfit(track.time[late], sinkages[late], 1)[0])
    means = tuple(parts.mean(axis=0).tolist())
    rear = means[3] - study.outer * (1.0 - math.cos(rim.rear))
    return Held(means, tuple(noise.tolist()), sinking, rear, track.time, forces, sinkages, track.frames[-1])


def _first_sinkage(study: HeldWheel) -> float:
    """Sinkage at the start [m]: what is prescribed, or next to none."""
    return 0.5 * study.height if study.prescribed_sinkage is None else study.prescribed_sinkage


def _prepared(study: HeldWheel) -> Simulation:
    """The bed with the wheel at its sinkage, in the place of the sand that was there."""
    omega, outer, dx = omega_of(study), study.outer, study.dx
    speed = (1.0 - float(study.prescribed_slip or 0.0)) * omega * outer
    below, before = ROOM[study.sinks]
    behind, ahead = 0.5 * study.contact + 0.4 * outer, 0.5 * study.contact + before * outer
    length = math.ceil((behind + ahead + abs(speed) * study.time) / dx) * dx
    depth = math.ceil((study.sunk + below * outer) / dx) * dx
    young = stiffness(study.rho, study.gravity, 0.3 * outer, study.mu_int)
    material = Material.of_density(study.mu_int, study.rho, young, study.mu_2, study.grain)
    level = depth - study.shift * dx
    start = behind if omega >= 0.0 else length - behind
    across = [] if study.dim == 2 else [math.ceil((0.5 * study.breadth + outer) / dx) * dx]
    bed = level_bed(material, (length, *across, depth), dx, gravity=study.gravity)
    _lower(bed, study.shift * dx)
    body = _wheel(study, (start + study.shift * dx, level + outer - _first_sinkage(study)), speed)
    friction = np.full((study.dim, 2), study.mu_int)
    friction[1:-1, 0] = 0.0  # the plane of symmetry
    sim = Simulation(
        material, bed, dx, (length, *across, level + 3.0 * outer), bodies=[body], gravity=study.gravity,
        wall_friction=friction, xpic=study.xpic, calm=study.calm, spacing=SPACING if study.dim == 2 else SPARSE,
    )  # fmt: skip
    sim.clear_bodies()
    return sim


def _wheel(study: HeldWheel, place: tuple[float, float], speed: float) -> Body:
    """The wheel, its axle at a place along and up [m], at a speed along [m/s]."""
    plane, omega = study.dim == 2, omega_of(study)
    middle = [] if plane else [0.0]
    mass, load = np.full(study.dim, math.inf), np.zeros(study.dim)
    if study.sinks:
        mass[-1] = study.mass_z / study.breadth if plane else 0.5 * study.mass_z
        load[-1] = -mass[-1] * study.gravity
    return Body(
        outline(study) if plane else _solid(study), np.array([place[0], *middle, place[1]]),
        np.array([speed, *middle, 0.0]), study.mu_surf, spin=np.array([omega] if plane else [0.0, omega, 0.0]),
        mass=mass, load=load,
    )  # fmt: skip


def _solid(study: HeldWheel) -> Shape:
    """The whole wheel, about the middle of its axle."""
    return extruded(outline(study), study.breadth) if study.grousers else drum(study.radius, study.breadth)


def _lower(bed: Particles, by: float) -> None:
    """Lower a bed by whole layers of particles [m], the lowest of which go."""
    bed.x[:, -1] -= by
    bed.select(bed.x[:, -1] > 0.0)
