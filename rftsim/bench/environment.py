"""The cost that sand adds to MuJoCo's step: one simulation and many side by side, with sand and without, in turn."""

import copy
import functools
import math
import statistics
import time
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.bench import others
from rftsim.bench.cases import GROUNDS, OWN, Case, Ground, Span
from rftsim.bench.subjects import put
from rftsim.bench.trials import is_lost
from rftsim.errors import RftsimError
from rftsim.law.layout import HEADER, record
from rftsim.model.readout import instances, work
from rftsim.surface.triangles import Array

try:
    from mujoco.batch import Batch
except ModuleNotFoundError:  # which MuJoCo has since 3.17
    Batch = None

Timers = dict[Ground, Callable[[], float]]
"""Functions that each time a step once [s], by ground."""
Times = dict[Ground, list[float]]
"""Times of a step in every round [s], by ground."""
LIMITS: Final[dict[Ground, float]] = {"none": math.inf, "explicit": 2.0, "training": math.inf, "implicit": 3.0}
"""Largest cost that the wheel's step was asked to keep, over the one without sand; batches may lose as much."""
TIMED: Final[tuple[Ground, ...]] = (*GROUNDS, "training")
"""Every ground that is timed."""
TRAINING: Final = 0.03
"""Tolerance that the environments train with, by `rftsim bench pareto --cases tolerance`."""
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
    h: float
    """Time step [s]."""
    triangles: int
    """Triangles that feel the sand, of all bodies."""
    seconds: float
    """Processor time of a step [s]; the median of the repetitions."""
    ratio: float
    """Time of a step over that without sand; the median of the repetitions' ratios."""
    over_explicit: float
    """Time of a step over that with the explicit force; likewise."""
    realtime: float
    """Simulated over processor time."""
    evaluations: float
    """Evaluations of the force in each step, in the mean."""
    derivatives: float
    """Evaluations of its derivative in each step, in the mean."""
    lost: bool
    """Whether MuJoCo lost the simulation meanwhile, and timed what it was reset to."""
    batch: dict[int, tuple[float, float]]
    """Steps per second of all simulations, and their share of those without sand, by the number of threads; none where
    only one simulation is timed."""


def choose(names: Iterable[str], quick: bool) -> tuple[list[Case], list[str]]:
    """The cases of the study, and the robots that are not there.

    Args:
        names: Names of cases; none for all, or for those of a quick study.
        quick: Leave out what takes long to load or to step, unless it is named.

    Raises:
        RftsimError: There is no such case, or its robot is not installed.
    """
    found, missing = others.robots()
    cases, wanted = [*OWN.values(), *others.spheres(), *found], set(names)
    known = dict.fromkeys(case.name for case in cases)
    for name in sorted(wanted - set(known)):
        raise RftsimError(f"no case {name!r}; cases are {', '.join(known)}; not found: {', '.join(missing) or 'none'}")
    if wanted:
        return [case for case in cases if case.name in wanted], []
    return [case for case in cases if case.quick or not quick], [] if quick else missing


def measure(cases: list[Case], rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    """Time cases; `report` is called with what was done, `repetitions(cases, rounds)` times.

    Raises:
        RftsimError: This MuJoCo has no batches.
    """
    if Batch is None:
        raise RftsimError(f"this needs mujoco.batch, which mujoco>=3.17 has and {mujoco.__version__} has not")
    return [timed for case in cases for timed in _time(case, rounds, report)]


def repetitions(cases: list[Case], rounds: int) -> int:
    """The number of times that `measure` reports in so many rounds."""
    return rounds * sum(1 + case.batched * len(THREADS) for case in cases)


def randomised(model: mujoco.MjModel, batch: Batch, seed: int) -> None:
    """Give each simulation of a batch a sand of its own."""
    rng, numbers = np.random.default_rng(seed), batch.expand("numeric_data")
    for bed in instances(model):
        beds = bed.beds_in(numbers)
        for field, ends in DRAWN.items():
            low, high = np.log(ends)
            beds[field] *= np.exp(rng.uniform(low, high, size=len(numbers)))


def _time(case: Case, rounds: int, report: Callable[[str], Any]) -> list[Timed]:
    """Time a case on every ground, one simulation at a time and in batches."""
    found, begun = case.prepare()
    found["training"], begun["training"] = _for_training(found["implicit"]), begun["implicit"]
    singles = {ground: mujoco.MjData(model) for ground, model in found.items()}
    steps = round(case.window / found["none"].opt.timestep)
    timers: Timers = {
        ground: functools.partial(_single, data, begun[ground], case.move(begun[ground], steps))
        for ground, data in singles.items()
    }
    times = _in_turn(timers, rounds, lambda: report(f"{case.name}, {case.law}"))
    batches = {}
    for threads in THREADS if case.batched else ():
        timers = {
            ground: batch_timer(model, begun[ground], case.move(begun[ground], BATCH_STEPS), threads)
            for ground, model in found.items()
        }
        batches[threads] = _in_turn(timers, rounds, lambda: report(f"{case.name}, {case.law}, {SIMULATIONS} at once"))
    return [
        _timed(case, ground, singles[ground], times, {n: _shares(own, ground) for n, own in batches.items()})
        for ground in TIMED
    ]


def _for_training(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of a model whose implicit force is solved as exactly as training needs."""
    other = copy.copy(model)
    for bed in instances(other):
        bed.bed.tolerance = TRAINING
    return other


def _timed(
    case: Case, ground: Ground, data: mujoco.MjData, times: Times, batch: dict[int, tuple[float, float]]
) -> Timed:
    model, seconds = data.model, statistics.median(times[ground])
    evaluations, derivatives = _work_per_step(data)
    return Timed(
        subject=case.name,
        law=case.law,
        sand=ground,
        h=model.opt.timestep,
        triangles=sum(int(record(one, HEADER).ntri) for bed in instances(model) for one in bed.bodies.values()),
        seconds=seconds,
        ratio=_ratio(times, ground, "none"),
        over_explicit=_ratio(times, ground, "explicit"),
        realtime=model.opt.timestep / seconds,
        evaluations=evaluations,
        derivatives=derivatives,
        lost=is_lost(data),
        batch=batch,
    )


def _shares(times: Times, ground: Ground) -> tuple[float, float]:
    """Steps per second, and their share of those without sand."""
    return 1.0 / statistics.median(times[ground]), 1.0 / _ratio(times, ground, "none")


def _work_per_step(data: mujoco.MjData) -> tuple[float, float]:
    """Evaluations of the force and of its derivative in each step, in the mean; none without sand."""
    if not instances(data.model):
        return 0.0, 0.0
    spent = work(data.model, data)
    return spent.evaluations / max(spent.steps, 1), spent.derivatives / max(spent.steps, 1)


def _in_turn(timers: Timers, rounds: int, report: Callable[[], Any]) -> Times:
    """Each timer's times in every round; all in turn, so that a busy machine slows all."""
    for once in timers.values():
        once()
    times: Times = {ground: [] for ground in timers}
    for _ in range(rounds):
        for ground, once in timers.items():
            times[ground].append(once())
        report()
    return times


def _ratio(times: Times, ground: Ground, other: Ground) -> float:
    """Median over the rounds of a ground's time over that of another."""
    return statistics.median(own / base for own, base in zip(times[ground], times[other], strict=True))


def _single(data: mujoco.MjData, begun: mujoco.MjData, spans: list[Span]) -> float:
    """Processor time of a step of one simulation [s]: elapsed time counts others' turns on a busy machine, too."""
    put(data, begun)
    mujoco.mj_forward(data.model, data)
    seconds = 0.0
    for span in spans:
        data.ctrl[:] = span.ctrl
        started = time.thread_time()
        mujoco.mj_step(data.model, data, nstep=span.steps)
        seconds += time.thread_time() - started
    return seconds / sum(span.steps for span in spans)


def batch_timer(model: mujoco.MjModel, begun: mujoco.MjData, spans: list[Span], threads: int) -> Callable[[], float]:
    """Make a timer of a step of one simulation in a batch [s]: elapsed time over the steps of all."""
    batch = Batch(model, SIMULATIONS, threads)
    if model.nnumeric:
        randomised(model, batch, seed=0)

    def once() -> float:
        batch.reset(range(SIMULATIONS), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        states: dict[str, Array] = {name: getattr(begun, name) for name in ("qpos", "qvel", "ctrl")}
        for name, value in states.items():
            batch.bind(name)[:] = value
        started = time.perf_counter()
        for span in spans:
            batch.bind("ctrl")[:] = span.ctrl
            batch.rollout(span.steps)
        return (time.perf_counter() - started) / (SIMULATIONS * sum(span.steps for span in spans))

    return once
