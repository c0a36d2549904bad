"""What sand adds to MuJoCo's step: one simulation and many side by side, with sand and without, in turn."""

import functools
import math
import statistics
import time
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from rftsim.bench.subjects import SUBJECTS, in_motion, put
from rftsim.law.layout import SAND_FIELDS
from rftsim.model.readout import instances, work
from rftsim.surface.triangles import Array

Sand = Literal["none", "explicit", "implicit"]
Works = dict[Sand, Callable[[], float]]
SANDS: Final[tuple[Sand, ...]] = ("none", "explicit", "implicit")
CASES: Final = (("wheel", "drft2d"), ("wheel", "rft2d"), ("runner", "drft2d"), ("hexapod", "rft3d"))
"""Subjects and laws."""
LIMITS: Final[dict[Sand, float]] = {"none": math.inf, "explicit": 2.0, "implicit": 3.0}
"""What the wheel's step may cost, over the one without sand; batches may lose as much."""
WINDOW: Final = 0.2
"""Simulated in each repetition [s]."""
SIMULATIONS: Final = 256
BATCH_STEPS: Final = 40
"""In each repetition of a batch."""
THREADS: Final = (1, 2)
DRAWN: Final = {"xi_n": (0.5, 2.0), "zeta": (0.5, 2.0), "mu_surf": (0.7, 1.3), "rho_c": (0.8, 1.2)}
"""Ranges of the factors that the sand's parameters are multiplied by in each simulation of a batch."""


class Timed(NamedTuple):
    """One subject with one kind of sand."""

    subject: str
    law: str
    sand: Sand
    triangles: int
    seconds: float
    """Processor time of a step; the median of the repetitions."""
    ratio: float
    """Over the step without sand; the median of the repetitions' ratios."""
    realtime: float
    """Simulated over processor time."""
    evaluations: float
    """Of the force, in each step."""
    derivatives: float
    batch: dict[int, tuple[float, float]]
    """By threads: steps per second of all simulations, and the share of those without sand."""


def measure(rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    """Time every case; `report` is called with what was done, `repetitions(rounds)` times."""
    return [timed for name, law in CASES for timed in _case(name, law, rounds, report)]


def repetitions(rounds: int) -> int:
    """How often `measure` reports."""
    return len(CASES) * rounds * (1 + len(THREADS))


def models(name: str, law: str) -> dict[Sand, mujoco.MjModel]:
    """A subject without sand, and with both forces."""
    subject = SUBJECTS[name]
    bare: dict[Sand, mujoco.MjModel] = {"none": subject.bare().compile()}
    return bare | {force: subject.staged(law, force=force).model for force in SANDS if force != "none"}


def randomised(model: mujoco.MjModel, batch: Batch, seed: int) -> None:
    """Give each simulation of a batch a sand of its own."""
    rng, numbers = np.random.default_rng(seed), batch.expand("numeric_data")
    for bed in instances(model):
        first = (bed.sand.ctypes.data - model.numeric_data.ctypes.data) // bed.sand.itemsize
        for field, ends in DRAWN.items():
            low, high = np.log(ends)
            numbers[:, first + SAND_FIELDS.index(field)] *= np.exp(rng.uniform(low, high, size=len(numbers)))


def _case(name: str, law: str, rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    moving, found = in_motion(name, law), models(name, law)
    singles = {sand: mujoco.MjData(model) for sand, model in found.items()}
    steps = round(WINDOW / moving.model.opt.timestep)
    taken: Works = {sand: functools.partial(_single, data, moving, steps) for sand, data in singles.items()}
    times = _in_turn(taken, rounds, lambda: report(f"{name}, {law}"))
    batches: dict[int, dict[Sand, list[float]]] = {}
    for threads in THREADS:
        works: Works = {sand: _many(model, moving, threads) for sand, model in found.items()}
        batches[threads] = _in_turn(works, rounds, lambda: report(f"{name}, {law}, {SIMULATIONS} at once"))
    rows = []
    for sand, model in found.items():
        spent = work(model, singles[sand]) if sand != "none" else None
        seconds, total = statistics.median(times[sand]), max(spent.steps if spent else 0, 1)
        shares = {
            threads: (1.0 / statistics.median(own[sand]), 1.0 / _ratio(own, sand)) for threads, own in batches.items()
        }
        triangles = sum(int(surface[14]) for bed in instances(model) for surface in bed.bodies.values())
        evaluations, derivatives = (spent.evaluations / total, spent.jacobians / total) if spent else (0.0, 0.0)
        realtime = model.opt.timestep / seconds
        ratio = _ratio(times, sand)
        rows.append(Timed(name, law, sand, triangles, seconds, ratio, realtime, evaluations, derivatives, shares))
    return rows


def _in_turn(works: dict[Sand, Callable[[], float]], rounds: int, report: Callable[[], Any]) -> dict[Sand, list[float]]:
    """Each work's time in every round; all in turn, so that a busy machine slows all."""
    for once in works.values():
        once()
    times: dict[Sand, list[float]] = {sand: [] for sand in works}
    for _ in range(rounds):
        for sand, once in works.items():
            times[sand].append(once())
        report()
    return times


def _ratio(times: dict[Sand, list[float]], sand: Sand) -> float:
    return statistics.median(own / bare for own, bare in zip(times[sand], times["none"], strict=True))


def _single(data: mujoco.MjData, moving: mujoco.MjData, steps: int) -> float:
    """Processor time of a step of one simulation [s]: elapsed time counts others' turns on a busy machine, too."""
    put(data, moving)
    mujoco.mj_forward(data.model, data)
    started = time.thread_time()
    mujoco.mj_step(data.model, data, nstep=steps)
    return (time.thread_time() - started) / steps


def _many(model: mujoco.MjModel, moving: mujoco.MjData, threads: int) -> Callable[[], float]:
    """What times a step of one simulation in a batch [s]: elapsed time over the steps of all."""
    batch = Batch(model, SIMULATIONS, threads)
    if model.nnumeric:
        randomised(model, batch, seed=0)

    def once() -> float:
        batch.reset(range(SIMULATIONS), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        states: dict[str, Array] = {name: getattr(moving, name) for name in ("qpos", "qvel", "ctrl")}
        for name, value in states.items():
            batch.bind(name)[:] = value
        started = time.perf_counter()
        batch.rollout(BATCH_STEPS)
        return (time.perf_counter() - started) / (BATCH_STEPS * SIMULATIONS)

    return once
