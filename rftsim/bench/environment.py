"""The cost that sand adds to MuJoCo's step: one simulation and many side by side, with sand and without, in turn."""

import functools
import math
import statistics
import time
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.subjects import SUBJECTS, in_motion, put
from rftsim.errors import RftsimError
from rftsim.law.layout import HEADER, record
from rftsim.model.readout import instances, work
from rftsim.surface.triangles import Array

try:
    from mujoco.batch import Batch
except ModuleNotFoundError:  # which MuJoCo has since 3.17
    Batch = None

Ground = Literal["none", "explicit", "implicit"]
"""No sand, or sand with a kind of force."""
Timers = dict[Ground, Callable[[], float]]
"""Functions that each time a step once [s], by ground."""
GROUNDS: Final[tuple[Ground, ...]] = ("none", "explicit", "implicit")
"""Every ground; the first is the one that the others are compared with."""
CASES: Final = (("wheel", "drft2d"), ("wheel", "rft2d"), ("runner", "drft2d"), ("hexapod", "rft3d"))
"""Subjects and laws that are timed."""
LIMITS: Final[dict[Ground, float]] = {"none": math.inf, "explicit": 2.0, "implicit": 3.0}
"""Largest cost that the wheel's step was asked to keep, over the one without sand; batches may lose as much."""
WINDOW: Final = 0.2
"""Time that is simulated in each repetition [s]."""
SIMULATIONS: Final = 256
"""Simulations of a batch."""
BATCH_STEPS: Final = 40
"""Steps in each repetition of a batch."""
THREADS: Final = (1, 2)
"""Numbers of threads that batches are stepped by."""
DRAWN: Final = {"xi_n": (0.5, 2.0), "zeta": (0.5, 2.0), "mu_surf": (0.7, 1.3), "rho_c": (0.8, 1.2)}
"""Ranges of the factors that the sand's parameters are multiplied by in each simulation of a batch."""


class Timed(NamedTuple):
    """The cost of a step of one subject under one law, with one kind of sand or none."""

    subject: str
    """The subject's name."""
    law: str
    """The law's name."""
    sand: Ground
    """No sand, or the sand's force."""
    triangles: int
    """Triangles that feel the sand, of all bodies."""
    seconds: float
    """Processor time of a step [s]; the median of the repetitions."""
    ratio: float
    """Time of a step over that without sand; the median of the repetitions' ratios."""
    realtime: float
    """Simulated over processor time."""
    evaluations: float
    """Evaluations of the force in each step, in the mean."""
    derivatives: float
    """Evaluations of its derivative in each step, in the mean."""
    batch: dict[int, tuple[float, float]]
    """Steps per second of all simulations, and their share of those without sand, by the number of threads."""


def measure(rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    """Time every case; `report` is called with what was done, `repetitions(rounds)` times.

    Raises:
        RftsimError: This MuJoCo has no batches.
    """
    if Batch is None:
        raise RftsimError(f"this needs mujoco.batch, which mujoco>=3.17 has and {mujoco.__version__} has not")
    return [timed for name, law in CASES for timed in _case(name, law, rounds, report)]


def repetitions(rounds: int) -> int:
    """The number of times that `measure` reports in so many rounds."""
    return len(CASES) * rounds * (1 + len(THREADS))


def models(name: str, law: str) -> dict[Ground, mujoco.MjModel]:
    """Compile a subject without sand, and with both forces under a law."""
    subject = SUBJECTS[name]
    bare: dict[Ground, mujoco.MjModel] = {"none": subject.bare().compile()}
    return bare | {force: subject.stage(law, force=force).model for force in GROUNDS if force != "none"}


def randomised(model: mujoco.MjModel, batch: Batch, seed: int) -> None:
    """Give each simulation of a batch a sand of its own."""
    rng, numbers = np.random.default_rng(seed), batch.expand("numeric_data")
    for bed in instances(model):
        beds = bed.beds_in(numbers)
        for field, ends in DRAWN.items():
            low, high = np.log(ends)
            beds[field] *= np.exp(rng.uniform(low, high, size=len(numbers)))


def _case(name: str, law: str, rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    """Time a subject under a law on every ground, one simulation at a time and in batches."""
    moving, found = in_motion(name, law), models(name, law)
    singles = {ground: mujoco.MjData(model) for ground, model in found.items()}
    steps = round(WINDOW / moving.model.opt.timestep)
    timers: Timers = {ground: functools.partial(_single, data, moving, steps) for ground, data in singles.items()}
    times = _in_turn(timers, rounds, lambda: report(f"{name}, {law}"))
    batches = {}
    for threads in THREADS:
        timers = {ground: _many(model, moving, threads) for ground, model in found.items()}
        batches[threads] = _in_turn(timers, rounds, lambda: report(f"{name}, {law}, {SIMULATIONS} at once"))
    rows = []
    for ground, model in found.items():
        seconds = statistics.median(times[ground])
        shares = {n: (1.0 / statistics.median(own[ground]), 1.0 / _ratio(own, ground)) for n, own in batches.items()}
        triangles = sum(int(record(one, HEADER).ntri) for bed in instances(model) for one in bed.bodies.values())
        costs = seconds, _ratio(times, ground), model.opt.timestep / seconds
        rows.append(Timed(name, law, ground, triangles, *costs, *_work_per_step(singles[ground]), shares))
    return rows


def _work_per_step(data: mujoco.MjData) -> tuple[float, float]:
    """Evaluations of the force and of its derivative in each step, in the mean; none without sand."""
    if not instances(data.model):
        return 0.0, 0.0
    spent = work(data.model, data)
    return spent.evaluations / max(spent.steps, 1), spent.derivatives / max(spent.steps, 1)


def _in_turn(timers: Timers, rounds: int, report: Callable[[], Any]) -> dict[Ground, list[float]]:
    """Each timer's times in every round; all in turn, so that a busy machine slows all."""
    for once in timers.values():
        once()
    times: dict[Ground, list[float]] = {ground: [] for ground in timers}
    for _ in range(rounds):
        for ground, once in timers.items():
            times[ground].append(once())
        report()
    return times


def _ratio(times: dict[Ground, list[float]], ground: Ground) -> float:
    """Median over the rounds of a ground's time over that without sand."""
    return statistics.median(own / bare for own, bare in zip(times[ground], times["none"], strict=True))


def _single(data: mujoco.MjData, moving: mujoco.MjData, steps: int) -> float:
    """Processor time of a step of one simulation [s]: elapsed time counts others' turns on a busy machine, too."""
    put(data, moving)
    mujoco.mj_forward(data.model, data)
    started = time.thread_time()
    mujoco.mj_step(data.model, data, nstep=steps)
    return (time.thread_time() - started) / steps


def _many(model: mujoco.MjModel, moving: mujoco.MjData, threads: int) -> Callable[[], float]:
    """Make a timer of a step of one simulation in a batch [s]: elapsed time over the steps of all."""
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
