"""The cost of terrain and of ruts: of the force, of steps of shipped models, and of many simulations, in turn."""

import statistics
import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.subjects import SUBJECTS, in_motion
from rftsim.errors import RftsimError
from rftsim.law.rigid import Intruder
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.sand.terrain import Terrain
from rftsim.surface import shapes
from rftsim.surface.triangles import Surface

try:
    from mujoco.batch import Batch
except ModuleNotFoundError:  # which MuJoCo has since 3.17
    Batch = None

SAND: Final = Sand(rho_c=1500.0, mu_int=0.4, mu_surf=0.4)
WAVE: Final = 3.2
"""Length of the dunes' waves [m]."""
SPACING: Final = 0.05
"""Distance between their heights [m]."""
HEIGHT: Final = 0.02
"""Half the height of the dunes that steps are taken on [m]."""
BODIES: Final[dict[str, Callable[[], Surface]]] = {
    "box": lambda: shapes.box((0.1, 0.08, 0.05)),
    "sphere": lambda: shapes.sphere(0.1, max_edge=0.02),
}
"""Bodies whose force is timed, by name."""
POSES: Final = 100
"""Poses in each call."""
STEPPED: Final = (("wheel", "drft2d"), ("wheel", "rft3d"), ("hexapod", "rft3d"))
"""Models whose steps are timed, and their laws."""
WARMING: Final = 0.5
"""Time that they move before they are timed [s]."""
WINDOW: Final = 0.2
"""Time that is simulated in each repetition [s]."""
SIMULATIONS: Final = 64
"""Simulations of a batch."""


class Row(NamedTuple):
    """A cost on one kind of ground, and over that on a plane."""

    what: str
    """What is timed, and under which law."""
    ground: str
    """Plane, terrain, ruts, or both."""
    seconds: float
    """Time of one evaluation, step, or step of one simulation of a batch [s]; the median of the repetitions."""
    ratio: float
    """The same over that on a plane; the median of the repetitions' ratios."""
    memory: int
    """Bytes that one simulation remembers."""


def dunes(height: float) -> Terrain:
    """Waves along x of half a height [m], which repeat."""
    x = np.arange(round(WAVE / SPACING)) * SPACING
    return Terrain(np.tile(height * np.sin(2.0 * np.pi * x / WAVE), (8, 1)), (SPACING, SPACING), repeat=True)


def measure(rounds: int, report: Callable[[str], Any]) -> list[Row]:
    """Time all; `report` is called with what was done, `repetitions(rounds)` times.

    Raises:
        RftsimError: This MuJoCo has no batches.
    """
    if Batch is None:
        raise RftsimError(f"this needs mujoco.batch, which mujoco>=3.17 has and {mujoco.__version__} has not")
    rows = []
    for name, make in BODIES.items():
        rows += _compare(f"force on a {name}, rft3d", _forces(make()), {}, rounds, report)
    for name, law in STEPPED:
        timers, memory = _steps(name, law)
        rows += _compare(f"step of the {name}, {law}", timers, memory, rounds, report)
    timers, memory = _batches(*STEPPED[-1])
    return rows + _compare(f"{SIMULATIONS} of the {STEPPED[-1][0]} at once", timers, memory, rounds, report)


def repetitions(rounds: int) -> int:
    """The number of times that `measure` reports in so many rounds."""
    return rounds * (len(BODIES) + len(STEPPED) + 1)


def _compare(
    what: str,
    timers: dict[str, Callable[[], float]],
    memory: dict[str, int],
    rounds: int,
    report: Callable[[str], Any],
) -> list[Row]:
    """Time a thing on every ground in turn; the first is the plane."""
    times: dict[str, list[float]] = {name: [] for name in timers}
    for _ in range(rounds):
        for name, once in timers.items():
            times[name].append(once())
        report(what)
    plane = next(iter(times.values()))
    return [
        Row(
            what,
            name,
            statistics.median(own),
            statistics.median(a / b for a, b in zip(own, plane, strict=True)),
            memory.get(name, 0),
        )
        for name, own in times.items()
    ]


def _forces(surface: Surface) -> dict[str, Callable[[], float]]:
    """Timers of one evaluation of the force on a body that is half or wholly in the sand."""
    low = np.linspace(-0.1, 0.02, POSES)
    places = np.column_stack([low, 0.0 * low, low])

    def timer(terrain: FreeSurface | Terrain) -> Callable[[], float]:
        body = Intruder(surface, SAND, "rft3d", terrain=terrain)

        def once() -> float:
            started = time.thread_time()
            body.wrench(places, velocity=(0.1, 0.0, -0.1), angular_velocity=(0.0, 0.5, 0.0))
            return (time.thread_time() - started) / POSES

        return once

    return {"plane": timer(FreeSurface()), "terrain": timer(dunes(HEIGHT))}


def _options() -> dict[str, dict[str, Any]]:
    hills = {"terrain": dunes(HEIGHT)}
    return {"plane": {}, "terrain": hills, "ruts": {"ruts": True}, "both": {**hills, "ruts": True}}


def _models(name: str, law: str) -> dict[str, mujoco.MjModel]:
    return {kind: SUBJECTS[name].stage(law, **options).model for kind, options in _options().items()}


def _memory(models: dict[str, mujoco.MjModel]) -> dict[str, int]:
    return {kind: 8 * model.npluginstate for kind, model in models.items()}


def _steps(name: str, law: str) -> tuple[dict[str, Callable[[], float]], dict[str, int]]:
    """Timers of a step of a model that moves on, and what it remembers [bytes]."""
    models, ctrl = _models(name, law), in_motion(name, law).ctrl

    def timer(model: mujoco.MjModel) -> Callable[[], float]:
        data, count = SUBJECTS[name].start(model), round(WINDOW / model.opt.timestep)
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data, nstep=round(WARMING / model.opt.timestep))

        def once() -> float:
            started = time.thread_time()
            mujoco.mj_step(model, data, nstep=count)
            return float((time.thread_time() - started) / count)

        return once

    return {kind: timer(model) for kind, model in models.items()}, _memory(models)


def _batches(name: str, law: str) -> tuple[dict[str, Callable[[], float]], dict[str, int]]:
    """Timers of a step of one of many simulations, from their start on, and what each remembers [bytes]."""
    models, ctrl = _models(name, law), in_motion(name, law).ctrl

    def timer(model: mujoco.MjModel) -> Callable[[], float]:
        batch, start = Batch(model, SIMULATIONS, 1), SUBJECTS[name].start(model)
        batch.bind("qpos")[:], batch.bind("ctrl")[:] = start.qpos, ctrl
        batch.rollout(round(WARMING / model.opt.timestep))
        count = round(WINDOW / model.opt.timestep)

        def once() -> float:
            started = time.perf_counter()
            batch.rollout(count)
            return float((time.perf_counter() - started) / (count * SIMULATIONS))

        return once

    return {kind: timer(model) for kind, model in models.items()}, _memory(models)
