"""The wheel and the runner of [Agarwal] chapter 4 over their imposed rates, under four laws: `rftsim demo`."""

import concurrent.futures
import contextlib
import math
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np

from rftsim.run.run import STEADY, run
from rftsim.run.scenes import stage

LAWS: Final = ("rft2d", "drft2d", "rft3d", "drft3d")
"""Names of the laws that are compared."""
RATES: Final = {
    "grouser-wheel": (10, 30, 45, 60, 75, 90),
    "four-flap-runner": (20, 60, 100, 150, 200, 300),
}
"""Imposed rates of each scene [revolutions per minute]."""
SHORTEST: Final = 3.0
"""Simulated time of a run [s], at least."""


class Point(NamedTuple):
    """One run of the demonstration, in the thesis's dimensionless numbers."""

    scene: str
    """Name of the scene."""
    law: str
    """Name of the law."""
    rpm: float
    """Imposed rate [revolutions per minute]."""
    spin: float
    """Rate omega / sqrt(g / l), l the outer diameter [-]."""
    speed: float
    """Speed v / sqrt(g l) [-]."""
    sinkage: float
    """Sinkage over l [-]."""
    slip: float
    """Slip 1 - v / (R omega) [-]; NaN where there is none."""
    realtime_factor: float
    """Simulated over elapsed time, of the steps alone."""


def points() -> list[tuple[str, str, float]]:
    """Every scene, law and rate [revolutions per minute] of the demonstration, longest runs first."""
    return [(scene, law, rpm) for scene, rates in RATES.items() for rpm in rates for law in LAWS]


def measure(scene: str, law: str, rpm: float, sand: str | None = None) -> Point:
    """Run one point of the demonstration, on other sand than the scene's if so asked."""
    turn = 60 / rpm
    averaged = max(math.ceil(SHORTEST * STEADY / turn), 1) * turn  # whole turns, so that no lug counts twice
    staged = stage(scene, sand=sand, law=law, settings={"rpm": str(rpm)}, duration=averaged / STEADY)
    finished = run(staged)
    radius = staged.measured.wheel_radius
    assert radius is not None, "the demonstration's scenes are wheels"
    g, length = float(np.linalg.norm(staged.model.opt.gravity)), 2 * radius
    steady = finished.steady
    return Point(
        scene,
        law,
        rpm,
        spin=steady.rate / math.sqrt(g / length),
        speed=steady.speed / math.sqrt(g * length),
        sinkage=steady.sinkage / length,
        slip=steady.slip if steady.slip is not None else math.nan,
        realtime_factor=finished.realtime_factor,
    )


@contextlib.contextmanager
def _deaf_children() -> Iterator[None]:
    """Let processes that are started in the block not hear Ctrl-C, which the terminal sends to each: ours ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def measure_all(processes: int, report: Callable[[Point], None]) -> list[Point]:
    """Run every point of the demonstration, `processes` at a time; `report` is called with each as it ends."""
    context = multiprocessing.get_context("spawn")
    jobs, others = points(), set(multiprocessing.active_children())
    with concurrent.futures.ProcessPoolExecutor(processes, mp_context=context) as pool:
        with _deaf_children():
            futures = {pool.submit(measure, *job): job for job in jobs}
        done = {}
        try:
            for future in concurrent.futures.as_completed(futures):
                done[futures[future]] = future.result()
                report(done[futures[future]])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
    return [done[job] for job in jobs]
