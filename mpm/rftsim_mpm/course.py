"""A body's straight way through a bed, and the force on it at one place of the way."""

import dataclasses
import math
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import level_bed
from rftsim_mpm.body import Body, speeding_up
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.reading import AVERAGE, FEWEST, History, Log, read
from rftsim_mpm.shapes import Shape
from rftsim_mpm.simulation import COURANT, MOST_STEPS, Simulation, Watch

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Course:
    """A body, its straight way through a level bed, and the cells that it is computed with."""

    shape: Shape
    """The body's surface, about the origin of its own frame."""
    rotation: Array
    """Rotation from the shape's frame to the world, (dim, dim)."""
    direction: Array
    """Unit vector along which the body moves, (dim,); without a component along y."""
    speed: float
    """Speed of the body [m/s]."""
    friction: float
    """Friction between sand and body [-]."""
    material: Material
    """Parameters of the sand."""
    depth: float
    """Depth of the shape's origin at the reading [m]."""
    approach: float
    """Travel before the reading [m]."""
    window: float
    """Half of the travel over which the force is read [m]."""
    margin: float
    """Sand beside the body's way, up to each wall [m]."""
    bed: float
    """Depth of the sand [m]."""
    dx: float
    """Size of a cell [m]."""
    mirrors: tuple[bool, ...]
    """For each horizontal axis, whether only the half beyond the shape's origin is there, the rest being its image."""
    courant: float = COURANT
    """Time step, in cells per wave."""
    ppc: int = 2
    """Particles per cell along each axis."""
    xpic: int = 0
    """Order of XPIC; 0 is FLIP."""
    calm: float = 0.0
    """As in `Simulation` [s]."""
    shift: tuple[float, ...] = (0.0, 0.0)
    """Place of the body on the grid, along each horizontal axis [cells]."""
    gravity: Array | float = 9.81
    """Acceleration, (dim,), or the strength of one along -z [m/s^2]."""
    wall_friction: Array | float = 0.0
    """Friction of the lower and upper wall across each axis, (dim, 2), or of all; infinite where sand sticks [-]."""
    run_up: float = 0.0
    """Travel in which the body evenly speeds up [m]."""
    absorb: float = 0.0
    """Width of the layers before the floor and those walls that are no mirrors in which waves die down [m]."""

    @property
    def level(self) -> float:
        """Height of the sand's surface at rest, above the floor [m]."""
        return math.ceil(self.bed / self.dx) * self.dx

    def prepare(self) -> Simulation:
        """Return the bed with the body at the start of its way.

        Raises:
            MpmError: The bed is too large, or the way too slow or too fast to be read.
        """
        if 2.0 * self.window < (FEWEST - 1) * AVERAGE * self.speed:
            raise MpmError(
                f"at {self.speed:g} m/s the {2e3 * self.window:g} mm that are read hold fewer than {FEWEST} averages "
                f"of {AVERAGE * 1e3:g} ms: go slower"
            )
        dx, dim = self.dx, self.shape.dim
        reach = np.abs(self.shape.vertices @ self.rotation.T).max(axis=0)
        beside = [math.ceil((self.margin + r) / dx) for r in reach[: dim - 1]]  # cells from the body's middle to a wall
        path = math.ceil(abs(self.direction[0]) * (self.approach + self.window) / dx)
        width = [(1 if mirror else 2) * n for mirror, n in zip(self.mirrors, beside, strict=True)]
        width[0] += path
        start = np.array([*((n + s) * dx for n, s in zip(beside, self.shift, strict=False)), self.level - self.depth])
        if self.direction[0] < 0.0:
            start[0] += path * dx
        start[: dim - 1][np.array(self.mirrors)] = 0.0
        start[-1] -= self.approach * self.direction[-1]
        end = start[-1] + (self.approach + self.window) * self.direction[-1]
        top = max(self.level, start[-1] + reach[-1], end + reach[-1]) + reach.max() + 2.0 * dx
        body = Body(
            self.shape, start, (0.0 if self.run_up else self.speed) * self.direction, self.friction, self.rotation,
            steer=speeding_up(self.speed * self.direction, self.run_up) if self.run_up else None,
        )  # fmt: skip
        filled = (*(n * dx for n in width), self.level)
        bed = level_bed(self.material, filled, dx, gravity=self.gravity, ppc=self.ppc)
        dt = self.courant * dx / self.material.wave_speed
        if not (self.approach + self.run_up + self.window) / self.speed <= MOST_STEPS * dt:
            raise MpmError(f"the way takes more than {MOST_STEPS:g} time steps of {dt:.3g} s: go faster, or less far")
        box = (*(n * dx for n in width), top)
        sim = Simulation(
            self.material, bed, dx, box, bodies=[body], dt=dt, xpic=self.xpic, calm=self.calm,
            gravity=self.gravity, wall_friction=self.wall_friction, absorb=self._layers,
        )  # fmt: skip
        sim.clear_bodies()
        return sim

    @property
    def _layers(self) -> Array:
        """Widths of the layers in which waves die down, (dim, 2) [m]: none at a mirror, nor at the top."""
        layers = np.full((self.shape.dim, 2), self.absorb)
        layers[-1, 1] = 0.0
        layers[:-1, 0][np.array(self.mirrors)] = 0.0
        return layers

    def run(self, watch: Watch | None = None) -> "Passage":
        """Move the body to a little beyond the reading.

        Args:
            watch: Called after each step with the simulation and the share of the way that is done.
        """
        sim = self.prepare()
        copies = 2 ** sum(self.mirrors)  # of the part that is modelled, in the whole body
        first = sim.bodies[0].position.copy()
        log, traction, steps = Log(), np.zeros_like(sim.traction[0]), 0
        began, travel = time.perf_counter(), 0.0
        while travel < self.approach + self.window:
            sim.step()
            travel = float((sim.bodies[0].position - first) @ self.direction)
            depth = self.depth - (travel - self.approach) * float(self.direction[-1])
            log.add(sim.time, travel, depth, copies * sim.force[0], copies * sim.moment[0])
            if abs(travel - self.approach) <= self.window:
                traction += sim.traction[0]
                steps += 1
            if watch is not None:
                watch(sim, min(1.0, travel / (self.approach + self.window)))
        history = log.history(self.shape.dim)
        for axis, mirror in enumerate(self.mirrors):
            if mirror:  # the image's share cancels it
                history.force[:, axis] = 0.0
                history.moment[:, [i for i in range(history.moment.shape[1]) if i != axis]] = 0.0
        force, noise = read(history, self.approach, self.window)
        near = np.abs(history.travel - self.approach) <= self.window
        seconds = time.perf_counter() - began
        return Passage(sim, history, force, history.moment[near].mean(axis=0), noise, traction / steps, seconds)


class Passage(NamedTuple):
    """Force and moment on a body along its way and at the reading, and the simulation at the end."""

    sim: Simulation
    """The simulation as it was at the end."""
    history: History
    """Averages along the way."""
    force: Array
    """Force of the sand on the body at the reading, (dim,) [N, in the plane N/m]."""
    moment: Array
    """Moment about the shape's origin, mean while reading, (1,) or (3,) [N m, in the plane N]."""
    noise: float
    """Noise of averages over 0.5 ms, relative [-]."""
    traction: Array
    """Mean traction while reading, as `Simulation.traction` has it."""
    seconds: float
    """Time that the computation took [s]."""
