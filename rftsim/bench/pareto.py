"""The accuracy that speed costs: laws, triangles and time steps, against the finest mesh at a small step.

Each law is held against itself: its own wrench and trajectory with every triangle of a fine mesh, at a step of 0.1 ms.
How far the laws are from one another is told beside that.
"""

import math
import statistics
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from rftsim.bench import paths, quadruped, subjects, tolerances
from rftsim.bench.memory import remember
from rftsim.bench.paths import REFERENCE_STEP, Followed, distance, follow
from rftsim.bench.subjects import SUBJECTS, Subject
from rftsim.bench.tolerances import Solved
from rftsim.bench.trials import Force
from rftsim.model.reach import sampled_reach
from rftsim.model.readout import instances
from rftsim.reduction import facets, measure, reduce, samples
from rftsim.run.scenes import Staged
from rftsim.surface.triangles import Array

STEPS: Final = (5e-4, 1e-3, 2e-3, 5e-3, 1e-2)
"""Time steps that are tried [s]."""
REPEATS: Final = 3
"""Repetitions of all runs in turn; the median of a run's times counts."""
LESS: Final = 0.7
"""Largest share of another's error that counts as better."""
SEED: Final = 7
"""Seed of the poses and motions at which wrenches are compared; economies were sought at others."""
MODULES: Final = (subjects, quadruped, paths, tolerances, facets, measure, reduce, samples)
"""What measurements depend on, beside this module and what is compiled."""
Mesh = Literal["fine", "shipped", "1 %", "3 %", "10 %"]
MESHES: Final[tuple[Mesh, ...]] = ("fine", "shipped", "1 %", "3 %", "10 %")
"""Every triangle of the fine mesh; the model's own; the fewest facets found of the fine mesh within a tolerance."""


class Tried(NamedTuple):
    """One way to step a subject: a law, a mesh, a force and a time step, with their error and cost."""

    subject: str
    """The subject's name."""
    law: str
    """The law's name."""
    mesh: Mesh
    """The mesh that feels the sand."""
    elements: int
    """Triangles or facets, of all bodies."""
    wrench_error: float
    """Largest error of a body's wrench over poses and motions, see `measure.errors`."""
    force: Force
    """The sand's force."""
    h: float
    """Time step [s]."""
    error: float
    """Largest distance from the reference's path, over that path's length; infinite where the simulation was lost."""
    seconds: float
    """Processor time of a step [s]."""

    @property
    def cost(self) -> float:
        """Processor time of a step over the time that it simulates."""
        return self.seconds / self.h


class Compared(NamedTuple):
    """Everything that was tried of one subject under one law."""

    tried: list[Tried]
    """Every mesh, force and time step."""
    path: Array
    """Positions of the reference [m], shape (n, 3)."""


class Study:
    """The study, remembered in a file, so that it can be stopped and taken up again.

    Args:
        path: The file; what was measured with these sources on this MuJoCo is not measured again.
        quick: Each subject's own law, its own mesh and 10 %, at 1 and 5 ms; three tolerances at 5 ms.
    """

    def __init__(self, path: Path, quick: bool) -> None:
        self.kept = remember(path, *MODULES, sys.modules[__name__])
        self.quick = quick

    def laws(self, name: str) -> tuple[str, ...]:
        """The laws that a subject is tried under."""
        return SUBJECTS[name].laws[: 1 if self.quick else None]

    def compared(self, name: str, law: str) -> Compared:
        """A subject under a law, measured now or before."""
        meshes: tuple[Mesh, ...] = ("shipped", "10 %") if self.quick else MESHES
        steps = (1e-3, 5e-3) if self.quick else STEPS
        key = f"{name}/{law}{'/quick' if self.quick else ''}"
        tried, path = self.kept.get(key, lambda: _compare(name, law, meshes, steps))
        return Compared([Tried(*one) for one in tried], np.array(path))

    def solved(self, name: str) -> list[Solved]:
        """A subject at every tolerance of the implicit force, measured now or before."""
        ways = (tolerances.QUICK, tolerances.QUICK_STEPS) if self.quick else (tolerances.TOLERANCES, tolerances.STEPS)
        key = f"tolerance/{name}{'/quick' if self.quick else ''}"
        return [Solved(*one) for one in self.kept.get(key, lambda: tolerances.measure(name, *ways))]


def run(study: Study, names: Iterable[str], report: Callable[[str], Any]) -> list[Compared]:
    """Every subject under every law; `report` is called with what was done."""
    found = []
    for name in names:
        for law in study.laws(name):
            found.append(study.compared(name, law))
            report(f"{name}, {law}")
    return found


def run_tolerances(study: Study, names: Iterable[str], report: Callable[[str], Any]) -> list[Solved]:
    """Every subject at every tolerance; `report` is called with what was done."""
    found = []
    for name in names:
        found += study.solved(name)
        report(f"{name}, tolerances")
    return found


def front(tried: Iterable[Tried]) -> list[Tried]:
    """Choose those that nothing cheaper comes near, see LESS; the cheapest first."""
    least, found = math.inf, []
    for one in sorted(tried, key=lambda one: (one.cost, one.error)):
        if one.error < LESS * least:
            least = one.error
            found.append(one)
    return found


def laws_apart(compared: list[Compared]) -> dict[tuple[str, str], float]:
    """Distance of each law's path from that of the subject's own law, over that one's length, by subject and law."""
    own: dict[str, Array] = {}
    found = {}
    for each in compared:
        first = each.tried[0]
        path = own.setdefault(first.subject, each.path)
        found[first.subject, first.law] = distance(each.path, path)
    return found


def _compare(name: str, law: str, meshes: Iterable[Mesh], steps: Iterable[float]) -> tuple[list[Tried], Any]:
    """Try meshes and time steps of a subject under a law; returns them, and the reference's path as JSON has it."""
    subject = SUBJECTS[name]
    fine = _staged(subject, law, "fine", "implicit")
    path = follow(subject, fine, REFERENCE_STEP).path
    kinds: list[tuple[Mesh, Force]] = [(mesh, "implicit") for mesh in meshes]
    ways = {(mesh, force): _staged(subject, law, mesh, force) for mesh, force in [*kinds, ("shipped", "explicit")]}
    paths: dict[tuple[Mesh, Force, float], list[Followed]] = {}
    for _ in range(REPEATS):
        for (mesh, force), staged in ways.items():
            for h in steps:
                paths.setdefault((mesh, force, h), []).append(follow(subject, staged, h))
    tried = []
    for (mesh, force), staged in ways.items():
        elements = sum(surface.ntri for surface in staged.bed.surfaces.values())
        wrong = _wrench_error(fine, staged)
        for h in steps:
            runs = paths[mesh, force, h]
            seconds = statistics.median(run.seconds for run in runs)
            tried.append(Tried(name, law, mesh, elements, wrong, force, h, distance(runs[0].path, path), seconds))
    return tried, path.tolist()


def _staged(subject: Subject, law: str, mesh: Mesh, force: Force) -> Staged:
    if mesh == "shipped":
        return subject.stage(law, force=force)
    if mesh == "fine":
        return subject.stage(law, force=force, max_edge=subject.fine)
    return subject.stage(law, force=force, max_edge=subject.fine, reduction=float(mesh.removesuffix(" %")) / 100)


def _wrench_error(fine: Staged, staged: Staged) -> float:
    """Largest error of any body's wrench."""
    (bed,) = instances(fine.model)
    found = []
    for name, surface in fine.bed.surfaces.items():
        reach = sampled_reach(fine.model, fine.model.body(name).id, surface, SEED)
        drawn = samples.draw(surface, bed.packed, reach, samples.DEPTHS, SEED)
        whole, reduced = (measure.scaled_wrenches(s, bed.packed, drawn) for s in (surface, staged.bed.surfaces[name]))
        found.append(measure.errors(whole, reduced, drawn.depth).max())
    return float(max(found))
