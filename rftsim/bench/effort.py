"""The effort of the implicit force, step by step: how often it was evaluated, and the work that its sand did."""

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.trials import is_lost
from rftsim.engine.block import read_block
from rftsim.model.readout import instances
from rftsim.solver.steps import DERIVATIVE

_TOTALS = ("steps", "all_evaluations", "all_derivatives", "all_unsolved")


class Effort(NamedTuple):
    """The implicit force's effort in one simulation."""

    steps: int
    """Number of steps, up to the one in which MuJoCo lost it."""
    evaluations: int
    """Evaluations of every body's force, over all steps."""
    derivatives: int
    """Evaluations of its derivative, over all steps."""
    worst: float
    """Evaluations' worth of the costliest step: each derivative counts as two, see `steps.DERIVATIVE`."""
    unsolved: int
    """Equations that were not solved to their tolerance."""
    gain: float
    """Largest work of the sand in one step [J]; negative or zero where it never adds energy."""
    share: float
    """That work over the largest kinetic energy of the simulation; zero where it never adds energy."""
    lost: bool
    """Whether MuJoCo reset the simulation, or would have, or its positions are not finite."""
    lost_bare: bool
    """Whether the same is so without sand."""
    bare_from: tuple[float, float] | None = None
    """Where it is lost with sand alone: when it first was in a state from which it is lost without, too [s], and its
    kinetic energy then over that at the start; None where it never was."""


class Meter:
    """Steps simulations on sand one after the other, and adds up what the implicit force takes."""

    def __init__(self) -> None:
        self.lost = False
        self._totals = np.zeros(4, dtype=int)
        self._worst, self._gain, self._peak = 0.0, -math.inf, 0.0
        self._model: mujoco.MjModel | None = None
        self._beds: list[int] = []

    def advance(self, model: mujoco.MjModel, data: mujoco.MjData, nstep: int = 1) -> None:
        """Take steps as `mujoco.mj_step` does; none once a simulation is lost."""
        for _ in range(nstep):
            if not self.lost:
                self._step(model, data)

    def effort(self, *, lost: bool = False, lost_bare: bool = False) -> Effort:
        """The effort up to now; `lost` adds that what came of it is not finite."""
        steps, evaluations, derivatives, unsolved = self._totals.tolist()
        gain = self._gain if steps else 0.0
        share = gain / self._peak if gain > 0.0 and self._peak > 0.0 else 0.0
        counts = steps, evaluations, derivatives, self._worst, unsolved
        return Effort(*counts, gain, share, self.lost or lost, lost_bare)

    def _step(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if model is not self._model:  # as it takes longer to find the beds than to step a small model
            self._model, self._beds = model, [bed.id for bed in instances(model)]
        before, spent = data.qvel.copy(), self._spent(data)
        mujoco.mj_step(model, data)
        self.lost = is_lost(data) or not np.isfinite(data.qpos).all()
        if self.lost:
            return
        self._totals += self._spent(data) - spent
        self._worst = max(self._worst, self._worth(data))
        sand = data.qfrc_passive - data.qfrc_spring - data.qfrc_damper - data.qfrc_gravcomp - data.qfrc_fluid
        done = 0.5 * model.opt.timestep * float(sand @ (before + data.qvel))
        self._peak = max(self._peak, kinetic_energy(model, data, before), kinetic_energy(model, data, data.qvel))
        self._gain = max(self._gain, done)

    def _spent(self, data: mujoco.MjData) -> Any:
        """The numbers of `rftsim.work`, summed over the beds."""
        return np.array([[int(one[name]) for name in _TOTALS] for one in self._counters(data)]).sum(axis=0)

    def _worth(self, data: mujoco.MjData) -> float:
        """The evaluations' worth of the last step, summed over the beds."""
        return math.fsum(one["evaluations"] + DERIVATIVE * one["derivatives"] for one in self._counters(data))

    def _counters(self, data: mujoco.MjData) -> list[Any]:
        return [read_block(data.plugin_data, data._address, bed).counters for bed in self._beds]


def kinetic_energy(model: mujoco.MjModel, data: mujoco.MjData, velocity: Any) -> float:
    """Kinetic energy of a velocity with the inertia at the start of the step [J]."""
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, velocity)
    return 0.5 * float(velocity @ momentum)
