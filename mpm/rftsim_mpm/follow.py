"""Run a simulation for a while and keep what its bodies did."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.fields import Camera, Frame
from rftsim_mpm.reading import AVERAGE
from rftsim_mpm.simulation import MOST_STEPS, Simulation, Watch

Array = NDArray[np.float64]


def part(watch: Watch | None, index: int, count: int) -> Watch | None:
    """Return a watch of one run out of several, which tells `watch` the share of all that is done."""
    return None if watch is None else lambda sim, share: watch(sim, (index + share) / count)


def stage(sim: Simulation, duration: float, whole: float, watch: Watch | None = None) -> "Track":
    """Run a simulation further by a duration, and return what its bodies did in it; `whole` is the time at its end [s].

    `watch` is told the share of the whole that is done.
    """
    end = sim.time + duration
    return follow(sim, end, None if watch is None else lambda sim, done: watch(sim, min(1.0, done * end / whole)))


class Track(NamedTuple):
    """Averages over AVERAGE of the bodies' places, velocities and forces, and frames of the sand."""

    time: Array
    """End of each average, (n,) [s]."""
    position: Array
    """Place of each body, (n, nbody, dim) [m]."""
    velocity: Array
    """Velocity of each body, (n, nbody, dim) [m/s]."""
    force: Array
    """Force of the sand on each body, (n, nbody, dim) [N, in the plane N/m]."""
    moment: Array
    """Moment of the sand about each body's origin, (n, nbody, 1 or 3) [N m, in the plane N]."""
    frames: list[Frame]
    """Frames at the times asked for, and at the end."""

    def after(self, time: float) -> "Track":
        """Return the part of the track from a time [s] on, with all frames."""
        keep = self.time >= time
        averages = ("time", "position", "velocity", "force", "moment")
        return self._replace(**{name: getattr(self, name)[keep] for name in averages})


def follow(sim: Simulation, duration: float, watch: Watch | None = None, shots: Sequence[float] = ()) -> Track:
    """Run a simulation to a time and return what its bodies did.

    Args:
        sim: Stepped in place.
        duration: Simulated time to run to [s].
        watch: Called after each step with the simulation and the share that is done.
        shots: When to take frames [s]; rates in them are means over the 2 % of the run before.
    """
    if not duration <= MOST_STEPS * sim.dt:
        raise MpmError(f"{duration:g} s are more than {MOST_STEPS:g} time steps of {sim.dt:.3g} s")
    due = [*sorted(shots), duration]
    cameras: list[Camera | None] = [None] * len(due)
    frames: list[Frame] = []
    rows: list[Array] = []
    pending: list[Array] = []
    until = sim.time + AVERAGE
    while sim.time < duration:
        sim.step()
        moved = [part for body in sim.bodies for part in (body.position, body.velocity)]
        pending.append(np.concatenate([sim.force.ravel(), sim.moment.ravel(), *moved]))
        if sim.time >= until:
            rows.append(np.concatenate([[sim.time], np.mean(pending, axis=0)]))
            pending.clear()
            until = sim.time + AVERAGE
        for i, time in enumerate(due):
            if cameras[i] is None and sim.time >= time - 0.02 * duration:
                cameras[i] = Camera(sim)
        if len(frames) < len(due) and sim.time >= due[len(frames)]:
            camera = cameras[len(frames)]
            assert camera is not None
            frames.append(camera.shoot(sim))
        if watch is not None:
            watch(sim, min(1.0, sim.time / duration))
    bodies, dim = len(sim.bodies), sim.particles.dim
    table = np.array(rows).reshape(len(rows), -1)
    forces, moments, ways = np.split(table[:, 1:], np.cumsum([sim.force.size, sim.moment.size]), axis=1)
    placed = ways.reshape(len(rows), bodies, 2, dim)
    forces, moments = (x.reshape(len(rows), *of.shape) for x, of in ((forces, sim.force), (moments, sim.moment)))
    return Track(table[:, 0], placed[:, :, 0], placed[:, :, 1], forces, moments, frames)
