"""Running a staged scene: steps, what is measured on the way, and the steady state."""

import math
import time
from collections.abc import Callable, Generator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from rftsim.errors import RftsimError
from rftsim.model.ground import ground
from rftsim.model.readout import work, wrenches
from rftsim.run.robot import Robot, against_gravity, measure, sinkages
from rftsim.run.scenes import Staged
from rftsim.run.start import begin
from rftsim.run.validity import Validity, validity
from rftsim.surface.triangles import Array

STEADY = 0.4
"""Share of a run, at its end, that counts as its steady state."""
SAMPLES = 500
"""Samples that a run keeps."""
_CHECKS = 10


class History(NamedTuple):
    """The measurements of a run at evenly spaced times, arrays of shape (n,) unless said otherwise."""

    time: Array
    """Simulated time [s]."""
    speed: Array
    """Horizontal speed of the measured body [m/s]: along x, or in any direction for a robot's trunk."""
    sinkage: Array
    """Sinkage [m]: outer radius less axle height for a wheel, depth of the deepest corner of any body for a robot, and
    of the measured body otherwise."""
    rate: Array
    """Angular velocity of the measured body about y [rad/s]."""
    force: Array
    """Force of the sand on the measured body, or on all of a robot's [N], shape (n, 3)."""
    power: Array
    """Power of the sand on all bodies [W]."""


class Steady(NamedTuple):
    """The means over the last 40 % of a run, its steady state."""

    speed: float
    """Horizontal speed of the measured body [m/s], see `History`."""
    sinkage: float
    """Sinkage [m], see `History`."""
    slip: float | None
    """1 - v / (R omega) of a wheel; None elsewhere, or where it does not turn."""
    rate: float
    """Angular velocity of the measured body about y [rad/s]."""


class Run(NamedTuple):
    """A finished run: its measurements and how far they can be trusted."""

    history: History
    """The measurements on the way."""
    steady: Steady
    """Their means at the end."""
    realtime_factor: float
    """Simulated over elapsed time, of the steps alone."""
    doubts: tuple[str, ...]
    """Where the run left the theory's range, with numbers."""
    last: mujoco.MjData
    """MuJoCo's data at the end."""
    robot: Robot | None
    """A robot's measures at the end, what the sand carries as a mean over the steady state; None of other scenes."""


class RunError(RftsimError):
    """Error of a run that MuJoCo could not continue, because it diverged."""


def run(staged: Staged, observe: Callable[[mujoco.MjData], Any] | None = None) -> Run:
    """Run a staged scene from its start.

    Args:
        staged: The scene.
        observe: Called with the data after each sample.

    Raises:
        RunError: The simulation diverged; MuJoCo would have reset it silently.
    """
    runner = steps(staged)
    while True:
        try:
            data = next(runner)
        except StopIteration as end:
            finished: Run = end.value
            return finished
        if observe is not None:
            observe(data)


def steps(staged: Staged) -> Generator[mujoco.MjData, None, Run]:
    """The run of a staged scene as an iterator over the data at its samples, whose return value is the `Run`."""
    model = staged.model
    data = begin(staged)
    total = max(round(staged.duration / model.opt.timestep), 1)
    every = max(total // SAMPLES, 1)
    rows: list[tuple[Any, ...]] = []
    checks: list[Validity] = []
    elapsed = 0.0
    for first in range(0, total, every):
        started = time.perf_counter()
        mujoco.mj_step(model, data, nstep=min(every, total - first))
        elapsed += time.perf_counter() - started
        refuse_warnings(data)
        rows.append(_row(staged, data))
        if (first // every) % max(SAMPLES // _CHECKS, 1) == 0:
            checks += validity(model, data, staged.bed.sand.grain_diameter)
        yield data
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    history = History(*columns)
    doubts = tuple(dict.fromkeys([*_worst(checks), *_unsolved(model, data)]))
    steady = _steady(history, staged.measured.wheel_radius)
    return Run(history, steady, staged.duration / elapsed, doubts, data, _robot(staged, data, history))


def _row(staged: Staged, data: mujoco.MjData) -> tuple[Any, ...]:
    """The measurements of one moment, in the order of `History`."""
    model, measured = staged.model, staged.measured
    body = model.body(measured.body).id
    wrench = wrenches(model, data)
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
    if measured.robot:
        deepest = next(iter(sinkages(model, data).values()))
        speed = math.hypot(velocity[3], velocity[4])
        return data.time, speed, deepest, velocity[1], wrench.force.sum(axis=0), float(wrench.power.sum())
    surface = ground(model, data, staged.bed.name)
    if measured.wheel_radius is not None:
        sinkage = measured.wheel_radius + float(surface.depth(data.xpos[body]))
    else:
        corners = staged.bed.surfaces[measured.body].corners @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
        sinkage = float(surface.depth(corners).max())
    return data.time, velocity[3], sinkage, velocity[1], wrench.force[body].copy(), float(wrench.power.sum())


def _robot(staged: Staged, data: mujoco.MjData, history: History) -> Robot | None:
    """The measures of a robot at the end of its run."""
    if not staged.measured.robot:
        return None
    lift = against_gravity(staged.model, history.force[_last(history)].mean(axis=0))
    return measure(staged.model, data, staged.measured.body, lift)


def _last(history: History) -> slice:
    """The samples of the steady state."""
    return slice(int(len(history.time) * (1 - STEADY)), None)


def _steady(history: History, radius: float | None) -> Steady:
    last = _last(history)
    speed, sinkage, rate = (float(np.mean(x[last])) for x in (history.speed, history.sinkage, history.rate))
    slip = None if radius is None or rate == 0.0 else 1.0 - speed / (radius * rate)
    return Steady(speed, sinkage, slip, rate)


def refuse_warnings(data: mujoco.MjData) -> None:
    """Refuse the data of a simulation that diverged.

    Raises:
        RunError: It did; MuJoCo has reset it.
    """
    for kind in ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC", "mjWARN_BADCTRL"):
        if data.warning[getattr(mujoco.mjtWarning, kind)].number:
            raise RunError(
                f"the simulation diverged by {data.time:.4g} s ({kind[7:].lower()}): take a smaller timestep"
            )


def _unsolved(model: mujoco.MjModel, data: mujoco.MjData) -> list[str]:
    """The doubt about equations of the implicit force that were not solved, if any."""
    spent = work(model, data)
    if not spent.unsolved:
        return []
    return [
        f"{spent.unsolved} equations of the implicit force in {spent.steps} steps were not solved to their "
        f"tolerance: compare with a shorter timestep than {model.opt.timestep:g} s, or more iterations"
    ]


def _worst(checks: list[Validity]) -> list[str]:
    """The doubts about the bodies at their worst moments, one of each kind: that of the body of which it is truest."""
    kinds: dict[str, dict[str, tuple[float, str]]] = {}
    for check in checks:
        for kind, value, sentence in check.doubts():
            own = kinds.setdefault(kind, {})
            own[check.body] = max(own.get(check.body, (0.0, "")), (value, sentence))
    found = []
    for bodies in kinds.values():
        name = max(bodies, key=lambda body: bodies[body][0])
        more = f" (and {len(bodies) - 1} more)" if len(bodies) > 1 else ""
        found.append(f"body {name}{more}: {bodies[name][1]}")
    return found
