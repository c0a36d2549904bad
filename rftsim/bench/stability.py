"""Stability against the time step: the hard cases at five steps under both forces, against the right answers."""

import math
import statistics
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.bench import buried_cases, free_cases, hard_cases, joined_cases, trials, wheel_cases
from rftsim.bench.hard_cases import CASES
from rftsim.bench.memory import remember
from rftsim.bench.trials import Force
from rftsim.model.readout import instances, work

STEPS: Final = (1e-4, 1e-3, 2e-3, 5e-3, 1e-2)
"""Time steps that every case is played at [s]."""
CONVERGED: Final = 2e-5
"""Time step of the converged answers, with the implicit force [s]."""
EXACT: Final = 1e-4
"""Tolerance of the implicit force in those."""
FORCES: Final[tuple[Force, ...]] = ("implicit", "explicit")
STARTS_STEP: Final = 5e-3
"""Time step of the random starts [s]."""
LOST: Final = 10.0
"""Relative error from which on a simulation counts as lost in pictures."""
PLAYED_WITH: Final = (trials, free_cases, wheel_cases, buried_cases, joined_cases, hard_cases, sys.modules[__name__])
"""The modules that the study plays cases with."""


class Played(NamedTuple):
    """A hard case played at one time step under one force."""

    case: str
    """The case's name."""
    force: Force
    """The sand's force."""
    h: float
    """Time step [s]."""
    measured: dict[str, float]
    """The measured quantities by name, in the case's units."""
    failed: bool
    """Whether MuJoCo reset it, or anything measured is not finite."""
    cost: float
    """Elapsed over simulated time."""
    evaluations: float
    """Evaluations of the force per step, in the mean."""
    derivatives: float
    """Evaluations of its derivative per step, in the mean."""
    unsolved: int
    """Equations of the implicit force that were not solved to their tolerance."""


class Verdict(NamedTuple):
    """A played case against what is exact, converged, or ought to be zero."""

    error: float
    """Largest relative error of what has an exact or converged value; nan where nothing of that kind is measured."""
    rest: float
    """Largest ratio of what ought to be zero to its limit; nan where nothing of that kind is measured."""


class Starts(NamedTuple):
    """Many random starts of a free body on legs."""

    starts: int
    """Number of starts."""
    failed: int
    """Simulations that MuJoCo reset, or would have."""
    gain: float
    """Largest work of the sand in one step [J]; negative or zero where it never adds energy."""
    evaluations: float
    """Evaluations of the force per step, in the mean."""
    derivatives: float
    """Evaluations of its derivative per step, in the mean."""
    unsolved: int
    """Equations of the implicit force that were not solved to their tolerance."""


def play(case: str, h: float, force: Force, *, resting: float | None = None, tolerance: float | None = None) -> Played:
    """Play a hard case by its name.

    Args:
        case: The name.
        h: Time step [s].
        force: Which force the sand has.
        resting: Time that bodies are left alone [s], where it is not the case's own.
        tolerance: Tolerance of the implicit force, where it is not the default.
    """
    trial = CASES[case].build(h, force)
    if resting is not None:
        trial.resting = resting
    if tolerance is not None:
        for bed in instances(trial.model):
            bed.bed.tolerance = tolerance
    measured = dict(CASES[case].play(trial))
    spent = work(trial.model, trial.data)
    steps = max(spent.steps, 1)
    failed = trial.failed or not all(math.isfinite(value) for value in measured.values())
    cost = trial.seconds / (trial.steps * h)
    return Played(
        case, force, h, measured, failed, cost, spent.evaluations / steps, spent.derivatives / steps, spent.unsolved
    )


def references(case: str) -> dict[str, float]:
    """The exact or converged value of everything that a case measures and that has one."""
    judged = CASES[case].judged
    wanted = [name for name, how in judged.items() if how.limit is None]
    found = {name: how.exact for name, how in judged.items() if how.exact is not None}
    if set(wanted) - set(found):
        converged = play(case, CONVERGED, "implicit", resting=0.0, tolerance=EXACT).measured
        found = {name: converged[name] for name in wanted} | found
    return found


def judge(played: Played, expected: Mapping[str, float]) -> Verdict:
    """Compare a played case with its exact or converged values."""
    if played.failed:
        return Verdict(math.inf, math.inf)
    errors = [abs(played.measured[name] / value - 1.0) for name, value in expected.items()]
    limits = [
        played.measured[name] / how.limit for name, how in CASES[played.case].judged.items() if how.limit is not None
    ]
    return Verdict(max(errors, default=math.nan), max(limits, default=math.nan))


def random_starts(count: int, report: Callable[[], Any] = lambda: None) -> Starts:
    """Throw a body on legs into the sand in `count` random poses and let it move for a second each."""
    trial = hard_cases.legs(STARTS_STEP, "implicit")
    model, data = trial.model, trial.data
    failed, gain, totals = 0, -math.inf, np.zeros(4)
    for seed in range(count):
        mujoco.mj_resetData(model, data)
        move = hard_cases.start_at_random(trial, seed)
        for _ in range(round(1.0 / STARTS_STEP)):
            move(data)
            before = data.qvel.copy()
            mujoco.mj_step(model, data)
            sand = data.qfrc_passive - data.qfrc_spring - data.qfrc_damper - data.qfrc_gravcomp - data.qfrc_fluid
            gain = max(gain, 0.5 * STARTS_STEP * float(sand @ (before + data.qvel)))
        failed += trial.failed or not np.isfinite(data.qpos).all()
        totals += work(model, data)
        report()
    steps, evaluations, derivatives, unsolved = totals
    return Starts(count, failed, gain, evaluations / steps, derivatives / steps, int(unsolved))


class Study:
    """The whole study, remembered in a file, so that it can be stopped and taken up again.

    Args:
        path: The file; what was measured with this source on this MuJoCo is not measured again.
    """

    def __init__(self, path: Path) -> None:
        self.kept = remember(path, *PLAYED_WITH)

    def played(self, case: str, h: float, force: Force) -> Played:
        """A case at a time step [s] under a force, played now or before."""
        return Played(*self.kept.get(f"{case}/{force}/{h:g}", lambda: play(case, h, force)))

    def expected(self, case: str) -> dict[str, float]:
        """The exact or converged values of a case, by quantity."""
        return dict(self.kept.get(f"{case}/expected", lambda: references(case)))

    def starts(self, count: int, report: Callable[[], Any]) -> Starts:
        """The random starts, thrown now or before."""
        return Starts(*self.kept.get(f"starts/{count}", lambda: random_starts(count, report)))


class Row(NamedTuple):
    """A case of the study, played at every time step under both forces."""

    case: str
    """The case's name."""
    says: str
    """A line that says what happens in it."""
    expected: dict[str, float]
    """Its exact or converged values, by quantity."""
    played: dict[tuple[Force, float], Played]
    """The measurements, by force and time step [s]."""
    verdicts: dict[tuple[Force, float], Verdict]
    """How that compares, by force and time step [s]."""


def run(study: Study, cases: Iterable[str], steps: Iterable[float], report: Callable[[str], Any]) -> list[Row]:
    """Play cases at time steps under both forces; `report` is called with the name of each when it ends."""
    rows = []
    for case in cases:
        expected = study.expected(case)
        report(f"{case}, converged")
        played, verdicts = {}, {}
        for force in FORCES:
            for h in steps:
                played[force, h] = study.played(case, h, force)
                verdicts[force, h] = judge(played[force, h], expected)
                report(f"{case}, {force}, {1e3 * h:g} ms")
        rows.append(Row(case, CASES[case].says, expected, played, verdicts))
    return rows


class Summary(NamedTuple):
    """The study in a few numbers; means and medians over the cases."""

    evaluations: dict[float, float]
    """Mean evaluations per step of the implicit force, by time step [s]."""
    derivatives: dict[float, float]
    """Mean evaluations of its derivative per step, by time step [s]."""
    error: dict[Force, dict[float, float]]
    """Median error by force and time step [s], of the cases that have an exact or converged answer."""
    cost_ratio: float
    """Median cost of a second simulated at 5 ms with the implicit force, over one at 1 ms with the explicit one; nan
    where these steps were not taken."""
    nearer: tuple[int, int]
    """The number of these cases in which the former is nearer to the truth, and the number of all."""


def with_answer(rows: list[Row]) -> list[Row]:
    """The cases that have an exact or converged answer."""
    return [row for row in rows if not any(math.isnan(verdict.error) for verdict in row.verdicts.values())]


def summarise(rows: list[Row]) -> Summary:
    """Take the means and medians of a study over its cases."""
    steps, answered = sorted({h for row in rows for _, h in row.played}), with_answer(rows)
    error: dict[Force, dict[float, float]] = {
        force: {h: statistics.median(row.verdicts[force, h].error for row in answered) for h in steps}
        for force in FORCES
        if answered
    }
    ratio, nearer = math.nan, 0
    if {1e-3, 5e-3} <= set(steps):
        ratio = statistics.median(row.played["implicit", 5e-3].cost / row.played["explicit", 1e-3].cost for row in rows)
        nearer = sum(row.verdicts["implicit", 5e-3].error <= row.verdicts["explicit", 1e-3].error for row in answered)
    return Summary(
        {h: statistics.fmean(row.played["implicit", h].evaluations for row in rows) for h in steps},
        {h: statistics.fmean(row.played["implicit", h].derivatives for row in rows) for h in steps},
        error,
        ratio,
        (nearer, len(answered)),
    )
