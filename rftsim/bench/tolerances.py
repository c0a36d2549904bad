"""The accuracy that the implicit force's tolerance costs: walkers and a wheel with their own meshes, by time step.

Each is held against its own path at a step of 0.1 ms and the finest tolerance.
"""

import math
import statistics
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from rftsim.bench.paths import REFERENCE_STEP, Followed, distance, follow
from rftsim.bench.quadruped import QUADRUPED
from rftsim.bench.subjects import SUBJECTS, Subject
from rftsim.model.readout import instances
from rftsim.run.scenes import Staged

SOLVED: Final[Mapping[str, Subject]] = {
    "hexapod": SUBJECTS["hexapod"],
    "quadruped": QUADRUPED,
    "wheel": SUBJECTS["wheel"],
}
"""The subjects by name, each under its own law."""
TOLERANCES: Final = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Tolerances that are tried; the first is the finest, and the reference's."""
STEPS: Final = (1e-3, 2e-3, 5e-3)
"""Time steps that they are tried at [s]; the last is that of training."""
QUICK: Final = (1e-4, 3e-3, 1e-1)
"""Tolerances of a quick study."""
QUICK_STEPS: Final = (5e-3,)
"""Time steps of a quick study [s]."""
REPEATS: Final = 25
"""Repetitions of all runs in turn; the median of a run's times counts."""
ALLOWED: Final = 1.5
"""Largest error that is as good as the finest tolerance's, over that one."""


class Solved(NamedTuple):
    """One subject at a time step and a tolerance, with its error and cost."""

    subject: str
    """The subject's name."""
    law: str
    """The law's name."""
    h: float
    """Time step [s]."""
    tolerance: float
    """Tolerance of the implicit force."""
    seconds: float
    """Processor time of a step [s]."""
    evaluations: float
    """Evaluations of the force in each step, in the mean."""
    derivatives: float
    """Evaluations of its derivative in each step, in the mean."""
    unsolved: int
    """Equations that stayed outside the tolerance, over all steps."""
    error: float
    """Largest distance from the reference's path, over that path's length; infinite where the simulation was lost."""


class Advice(NamedTuple):
    """The cheapest tolerance at the longest step that errs as little as the finest does, see ALLOWED."""

    h: float
    """Time step [s]."""
    finest: float
    """The finest tolerance, that the others are held against."""
    each: dict[str, float]
    """Tolerance for each subject."""
    common: float
    """Tolerance that serves all of them: the cheapest in the mean of what serves each."""


def measure(name: str, tolerances: Iterable[float], steps: Iterable[float]) -> list[Solved]:
    """Follow a subject at every time step and tolerance, in turn."""
    subject = SOLVED[name]
    law = subject.laws[0]
    staged = subject.stage(law, force="implicit")
    reference = _followed(subject, staged, REFERENCE_STEP, TOLERANCES[0]).path
    ways = [(h, tolerance) for h in steps for tolerance in tolerances]
    runs: dict[tuple[float, float], list[Followed]] = {way: [] for way in ways}
    for _ in range(REPEATS):
        for way in ways:
            runs[way].append(_followed(subject, staged, *way))
    found = []
    for (h, tolerance), own in runs.items():
        seconds, spent = statistics.median(run.seconds for run in own), own[0].work
        each = (spent.evaluations / spent.steps, spent.derivatives / spent.steps)
        error = distance(own[0].path, reference)
        found.append(Solved(name, law, h, tolerance, seconds, *each, spent.unsolved, error))
    return found


def advise(rows: Iterable[Solved]) -> Advice | None:
    """Choose what the rows recommend for training; None where the finest tolerance loses a simulation."""
    rows = list(rows)
    h = max(row.h for row in rows)
    finest = min(row.tolerance for row in rows)
    served: dict[str, dict[float, float]] = {}
    for name in dict.fromkeys(row.subject for row in rows):
        own = {row.tolerance: row for row in rows if row.subject == name and row.h == h}
        best = own[finest]
        if math.isinf(best.error):
            return None
        served[name] = {
            tolerance: row.seconds / best.seconds for tolerance, row in own.items() if row.error <= ALLOWED * best.error
        }
    each = {name: min(costs, key=lambda tolerance: costs[tolerance]) for name, costs in served.items()}
    shared = set.intersection(*(set(costs) for costs in served.values()))
    common = min(shared, key=lambda tolerance: statistics.mean(costs[tolerance] for costs in served.values()))
    return Advice(h, finest, each, common)


def _followed(subject: Subject, staged: Staged, h: float, tolerance: float) -> Followed:
    """Follow a subject with another tolerance of its sand."""
    (bed,) = instances(staged.model)
    bed.bed.tolerance = tolerance
    return follow(subject, staged, h)
