"""Cases of the study of the environment: how each is made without sand and with it, how it starts, and is moved."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Final, Literal, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.quadruped import QUADRUPED, RENEWED, trot, trotting
from rftsim.bench.subjects import SUBJECTS, in_motion
from rftsim.model.add_sand import Force
from rftsim.surface.triangles import Array

Ground = Literal["none", "explicit", "training", "implicit"]
"""No sand, or sand with a kind of force; `training` is the implicit one, solved as exactly as training needs."""
GROUNDS: Final[tuple[Ground, ...]] = ("none", "explicit", "implicit")
"""Every ground but `training`; the first is the one that the others are compared with."""
FORCES: Final[tuple[Force, ...]] = ("explicit", "implicit")
"""Every kind of force."""
WINDOW: Final = 0.2
"""Time that is simulated in each repetition, of what moves on as it does [s]."""


class Span(NamedTuple):
    """A number of steps with the same controls."""

    ctrl: Array
    """The controls, (nu,)."""
    steps: int
    """Number of steps."""


class Prepared(NamedTuple):
    """A case that is ready to be timed: its models, and where each begins."""

    models: dict[Ground, mujoco.MjModel]
    """The compiled models, by ground."""
    begun: dict[Ground, mujoco.MjData]
    """Data of a model of the case in motion, or settled, by ground."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot or bodies whose step is timed on every ground.

    Attributes:
        name: Its name.
        law: The law of its sand.
        prepare: Makes its models and takes them to where the timing begins.
        move: Makes the controls of some steps from the data at their start.
        window: Time that is simulated in each repetition [s].
        batched: Whether many simulations are timed, too.
        quick: Whether it is among the cases of a quick study.
    """

    name: str
    law: str
    prepare: Callable[[], Prepared]
    move: Callable[[mujoco.MjData, int], list[Span]]
    window: float = WINDOW
    batched: bool = True
    quick: bool = True


def hold(data: mujoco.MjData, steps: int) -> list[Span]:
    """The controls that the data have, for some steps."""
    return [Span(data.ctrl.copy(), steps)]


def _of_subject(name: str, law: str, *, quick: bool = True) -> Case:
    def prepare() -> Prepared:
        subject = SUBJECTS[name]
        models: dict[Ground, mujoco.MjModel] = {"none": subject.bare().compile()}
        models |= {force: subject.stage(law, force=force).model for force in FORCES}
        return Prepared(models, dict.fromkeys(GROUNDS, in_motion(name, law)))

    return Case(name, law, prepare, hold, quick=quick)


def _prepare_quadruped() -> Prepared:
    models: dict[Ground, mujoco.MjModel] = {"none": QUADRUPED.bare().compile()}
    models |= {force: QUADRUPED.stage("rft3d", force=force).model for force in FORCES}
    return Prepared(models, dict.fromkeys(GROUNDS, trotting()))


def _trot(data: mujoco.MjData, steps: int) -> list[Span]:
    """Controls of the quadruped's trot, from where it is in it."""
    h = data.model.opt.timestep
    each = round(RENEWED / h)
    return [Span(trot(data.model, data.time + k * h), min(each, steps - k)) for k in range(0, steps, each)]


OWN: Final[Mapping[tuple[str, str], Case]] = {
    (case.name, case.law): case
    for case in (
        _of_subject("wheel", "drft2d"),
        _of_subject("wheel", "rft2d", quick=False),
        _of_subject("runner", "drft2d", quick=False),
        _of_subject("hexapod", "rft3d"),
        Case("quadruped", "rft3d", _prepare_quadruped, _trot),
    )
}
"""The cases with shipped models, by name and law."""


def draw_controls(data: mujoco.MjData, steps: int, *, every: int = 10, share: float = 0.2, seed: int = 0) -> list[Span]:
    """Controls around those of the data, drawn anew after some steps.

    Args:
        data: The data at the start.
        steps: Number of steps.
        every: Number of steps between two draws.
        share: Largest change, over the control's range.
        seed: The seed, the same on every ground.
    """
    model, random = data.model, np.random.default_rng(seed)
    low, high = np.where(model.actuator_ctrllimited[:, None].astype(bool), model.actuator_ctrlrange, [-1.0, 1.0]).T
    spans = []
    for k in range(0, steps, every):
        drawn = data.ctrl + share * (high - low) * random.uniform(-1.0, 1.0, model.nu)
        spans.append(Span(np.clip(drawn, low, high), min(every, steps - k)))
    return spans
