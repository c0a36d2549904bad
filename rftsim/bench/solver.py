"""The effort of the implicit force's solver, at four steps: hard cases, environments, articulated scenes at random."""

import math
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

from rftsim.bench import articulated, effort, random_trees, stability
from rftsim.bench.effort import Effort, Meter
from rftsim.bench.hard_cases import CASES
from rftsim.bench.memory import remember

STEPS: Final = (1e-3, 2e-3, 5e-3, 1e-2)
"""Time steps that everything is played at [s]."""
SCENES: Final = 300
"""Number of scenes that are drawn at random."""
DURATION: Final = 1.0
"""Time that each of these is simulated for [s]."""
PLAYED_WITH: Final = (*stability.PLAYED_WITH, random_trees, articulated, effort, sys.modules[__name__])
"""The modules that the study plays with."""


class Group(NamedTuple):
    """Simulations of one kind, and how the effort in one of them is measured."""

    name: str
    """The kind's name."""
    members: tuple[str, ...]
    """The simulations' names."""
    measure: Callable[[str, float], Effort]
    """The effort in one of them at a time step [s]."""


class Played(NamedTuple):
    """A simulation played at one time step, and its effort."""

    group: str
    """The name of its kind."""
    member: str
    """Its own name."""
    h: float
    """Time step [s]."""
    effort: Effort
    """The effort in it."""


class Summary(NamedTuple):
    """The effort in all simulations of one kind at one time step."""

    group: str
    """The kind's name."""
    h: float
    """Time step [s]."""
    simulations: int
    """Number of simulations."""
    evaluations: float
    """Evaluations of the force per step, in the mean over all steps."""
    derivatives: float
    """Evaluations of its derivative per step, in the mean over all steps."""
    worst: float
    """Evaluations' worth of the costliest step: each derivative counts as two."""
    unsolved: float
    """Unsolved equations over steps."""
    gain: float
    """Largest work of the sand in one step [J]; negative or zero where it never adds energy."""
    share: float
    """Largest of that work over the largest kinetic energy of its simulation."""
    lost: int
    """Simulations that are lost with sand, though not without."""
    lost_bare: int
    """Simulations that are lost without sand."""


def hard_cases(names: Iterable[str] = ()) -> Group:
    """The hard cases, by default all; none of them is lost without sand."""
    return Group("hard cases", tuple(names) or tuple(CASES), _play_case)


def scenes(count: int) -> Group:
    """Articulated scenes at random, by their seeds."""
    return Group("scenes", tuple(map(str, range(count))), _play_scene)


class Study:
    """The whole study, remembered in a file, so that it can be stopped and taken up again.

    Args:
        path: The file; what was measured with this source on this MuJoCo is not measured again.
        *modules: Modules that other kinds of simulations are played with.
    """

    def __init__(self, path: Path, *modules: ModuleType) -> None:
        self.kept = remember(path, *PLAYED_WITH, *modules)

    def play(self, group: Group, steps: Iterable[float], report: Callable[[str], Any]) -> list[Played]:
        """Play all of one kind at every step, now or before; `report` is called with the name of each when it ends."""
        played = []
        for h in steps:
            for member in group.members:
                played.append(Played(group.name, member, h, self._effort(group, member, h)))
                report(f"{member}, {1e3 * h:g} ms")
        return played

    def _effort(self, group: Group, member: str, h: float) -> Effort:
        return Effort(*self.kept.get(f"{group.name}/{member}/{h:g}", lambda: group.measure(member, h)))


def summarise(played: list[Played]) -> list[Summary]:
    """Sum up the efforts by kind and time step."""
    keys = dict.fromkeys((one.group, one.h) for one in played)
    return [_sum_up(*key, [one.effort for one in played if (one.group, one.h) == key]) for key in keys]


def _sum_up(group: str, h: float, efforts: list[Effort]) -> Summary:
    steps = max(sum(one.steps for one in efforts), 1)
    return Summary(
        group,
        h,
        len(efforts),
        sum(one.evaluations for one in efforts) / steps,
        sum(one.derivatives for one in efforts) / steps,
        max(one.worst for one in efforts),
        sum(one.unsolved for one in efforts) / steps,
        max(one.gain for one in efforts),
        max(one.share for one in efforts),
        sum(one.lost and not one.lost_bare for one in efforts),
        sum(one.lost_bare for one in efforts),
    )


def hardest(played: list[Played], measure: Callable[[Effort], float], count: int = 5) -> list[Played]:
    """The simulations in which something is largest, each at the time step at which it is."""
    found: dict[tuple[str, str], Played] = {}
    for one in sorted(played, key=lambda one: measure(one.effort), reverse=True):
        found.setdefault((one.group, one.member), one)
    return list(found.values())[:count]


def lost(played: list[Played]) -> list[Played]:
    """The simulations that are lost with sand, though not without."""
    return [one for one in played if one.effort.lost and not one.effort.lost_bare]


def _play_case(case: str, h: float) -> Effort:
    trial, meter = CASES[case].build(h, "implicit"), Meter()
    trial.advance = meter.advance
    measured = CASES[case].play(trial)
    return meter.effort(lost=not all(math.isfinite(value) for value in measured.values()))


def _play_scene(seed: str, h: float) -> Effort:
    scene, meter = articulated.articulated(int(seed)), Meter()
    model = scene.sandy(h)
    data, states = scene.start(model), []
    for _ in range(round(DURATION / h)):
        if meter.lost:
            break
        states.append(articulated.state_of(model, data))
        scene.move(data)
        meter.advance(model, data)
    effort = meter.effort(lost_bare=scene.lost(h, DURATION))
    if not effort.lost or effort.lost_bare:
        return effort
    return effort._replace(bare_from=scene.lost_from(h, states, DURATION))
