"""Cost of the sand in mujoco_warp by the number of worlds, over the bare step and beside mujoco.batch."""

import os
import statistics
import time
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import mujoco
import mujoco_warp as mjw
import warp as wp

from rftsim.bench.cases import FORCES, GROUNDS, Ground, Span
from rftsim.bench.environment import SIMULATIONS, batch_timer
from rftsim.bench.quadruped import QUADRUPED, trotting
from rftsim.warp.sand import put, without_plugin

wp.config.log_level = wp.LOG_WARNING

WORLDS: Final = (1, 64, 512, 2048, 4096, 8192)
"""Numbers of worlds on a GPU."""
FEW: Final = (1, 16, 64)
"""Numbers of worlds on a processor, where Warp is for tests."""
STEPS: Final = 20
"""Steps in each repetition."""


class Row(NamedTuple):
    """The cost of a step of a number of worlds on a ground."""

    worlds: int
    ground: Ground
    seconds: float
    """Elapsed time of a step of all worlds [s], the median over the repetitions."""
    ratio: float
    """Median over the repetitions of that over the bare step's."""
    memory: float
    """Memory of the device that the worlds take [bytes]; nan where the device does not tell."""


def device() -> str:
    """The device that Warp computes on, in words."""
    return str(wp.get_device().name)


def counts(quick: bool) -> tuple[int, ...]:
    """Numbers of worlds that are timed on this device."""
    return FEW[: 2 if quick else None] if wp.get_device().is_cpu else WORLDS[: 3 if quick else None]


def measure(numbers: Iterable[int], rounds: int, iterations: int, report: Callable[[str], Any]) -> list[Row]:
    """Time the trotting quadruped on every ground in numbers of worlds, in turn.

    Args:
        numbers: Numbers of worlds.
        rounds: Repetitions.
        iterations: Linearisations of the implicit force in a step.
        report: Called with what was timed.
    """
    rows = []
    for worlds in numbers:
        made = {ground: _worlds(ground, worlds, iterations) for ground in GROUNDS}
        for once, _ in made.values():
            once()
        times: dict[Ground, list[float]] = {ground: [] for ground in GROUNDS}
        for _ in range(rounds):
            for ground, (once, _) in made.items():
                times[ground].append(once())
            report(f"{worlds} worlds")
        for ground, own in times.items():
            ratio = statistics.median(a / b for a, b in zip(own, times["none"], strict=True))
            rows.append(Row(worlds, ground, statistics.median(own), ratio, made[ground][1]))
    return rows


def measure_batch(rounds: int, report: Callable[[str], Any]) -> dict[Ground, float]:
    """Steps a second of the same in mujoco.batch, on all processors: its bare step and the engine plugin's."""
    threads, rates = os.cpu_count() or 1, {}
    for ground in GROUNDS:
        once = batch_timer(_model(ground), trotting(), [Span(trotting().ctrl.copy(), STEPS)], threads)
        rates[ground] = 1.0 / statistics.median(once() for _ in range(rounds))
        report(f"{SIMULATIONS} in mujoco.batch")
    return rates


def _model(ground: Ground) -> mujoco.MjModel:
    return QUADRUPED.bare().compile() if ground not in FORCES else QUADRUPED.stage("rft3d", force=ground).model


def _worlds(ground: Ground, worlds: int, iterations: int) -> tuple[Callable[[], float], float]:
    """A timer of a step of worlds on a ground [s], and the memory that they take [bytes]."""
    model, free = _model(ground), _free()
    sizes = {"nworld": worlds, "njmax": 64, "nconmax": 32}
    if ground in FORCES:
        m, d, *_ = put(model, _start(model), iterations=iterations, **sizes)
    else:
        m, d = mjw.put_model(model), mjw.put_data(model, _start(model), **sizes)
    begun = [(array, wp.clone(array)) for array in (d.qpos, d.qvel, d.ctrl, d.act)]
    mjw.step(m, d)
    graph = _captured(m, d)

    def once() -> float:
        for array, first in begun:
            wp.copy(array, first)
        wp.synchronize()
        started = time.perf_counter()
        for _ in range(STEPS):
            wp.capture_launch(graph) if graph else mjw.step(m, d)
        wp.synchronize()
        return (time.perf_counter() - started) / STEPS

    return once, free - _free()


def _start(model: mujoco.MjModel) -> mujoco.MjData:
    """Data of a model in the trot, as mujoco_warp takes it."""
    data = mujoco.MjData(without_plugin(model))
    for name in ("qpos", "qvel", "ctrl", "act"):
        getattr(data, name)[:] = getattr(trotting(), name)
    mujoco.mj_forward(data.model, data)
    return data


def _captured(m: Any, d: Any) -> Any:
    """A step as a graph of the device's, where it has graphs."""
    if wp.get_device().is_cpu:
        return None
    with wp.ScopedCapture() as capture:
        mjw.step(m, d)
    return capture.graph


def _free() -> float:
    """Free memory of the device [bytes]; nan where it does not tell."""
    return float("nan") if wp.get_device().is_cpu else float(wp.get_device().free_memory)
