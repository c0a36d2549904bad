"""Trials: models on sand that are hard to step, the scripts played on them, and how what they measured is judged."""

import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, Literal, NamedTuple

import mujoco
import numpy as np

from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.sand.medium import Sand

SAND: Final = Sand(rho_c=3000.0, mu_int=0.4, mu_surf=0.4, xi_n=0.92e6)
"""The sand that all trials stand in."""
RESTING: Final = 10.0
"""Time that bodies are left alone for where rest is judged [s]."""

Force = Literal["explicit", "implicit"]
"""The sand's force: at the velocity of the moment, or at the end of the step."""
Quantities = Mapping[str, float]
"""The values that a case measured, by name."""


class Judged(NamedTuple):
    """A measured quantity's unit, and the limit or the exact value that it is judged by."""

    unit: str
    limit: float | None = None
    """Largest value, where the exact one is zero; None where the value is compared with the exact or converged one."""
    exact: float | None = None
    """The exact value, where there is one; None for the converged one."""


class Trial:
    """One case at one time step under one force: the simulation, and the time that its steps took.

    Args:
        spec: The model without sand.
        h: Time step [s].
        force: The sand's force.
        **options: Those of `add_sand`.

    Attributes:
        resting: Time that bodies are left alone for where rest is judged [s].
        h: Time step [s].
        spec: The model with sand, as it was before it was compiled.
        model: The model with sand.
        data: Its data.
        seconds: Elapsed time of the steps taken [s].
        steps: Number of steps taken.
        advance: Takes its steps, as `mujoco.mj_step` does.
    """

    resting = RESTING

    def __init__(self, spec: mujoco.MjSpec, h: float, force: Force, **options: Any) -> None:
        spec.option.timestep = h
        sand = options.pop("sand", SAND)
        add_sand(spec, sand, options.pop("law", "rft3d"), force=force, draw=False, **{**WHOLE, **options})
        self.h = h
        self.spec = spec
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.seconds = 0.0
        self.steps = 0
        self.advance: Callable[..., None] = mujoco.mj_step

    def run(self, duration: float, before: Callable[[mujoco.MjData], Any] | None = None) -> None:
        """Advance by a duration [s]; `before` is called with the data ahead of each step."""
        total = max(round(duration / self.h), 1)
        if before is None:
            self._step(total)
        else:
            for _ in range(total):
                before(self.data)
                self._step(1)
        self.steps += total

    def _step(self, count: int) -> None:
        started = time.perf_counter()
        self.advance(self.model, self.data, nstep=count)
        self.seconds += time.perf_counter() - started

    @property
    def failed(self) -> bool:
        """Whether MuJoCo reset the simulation, or would have."""
        return is_lost(self.data)


def is_lost(data: mujoco.MjData) -> bool:
    """Whether MuJoCo reset a simulation, or would have: a position, velocity or acceleration was not finite or huge."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[kind].number for kind in bad)


@dataclasses.dataclass(frozen=True)
class HardCase:
    """A case that is hard to step: its model, its script, and how what it measures is judged.

    Attributes:
        says: A line that says what happens.
        build: Makes a trial from a time step [s] and a force.
        play: Plays the script on a trial, and measures.
        judged: The measured quantities by name.
    """

    says: str
    build: Callable[[float, Force], Trial]
    play: Callable[[Trial], Quantities]
    judged: Mapping[str, Judged]


REST: Final = {
    "drift": Judged("mm", limit=0.05),
    "speed": Judged("m/s", limit=1e-4),
    "spin": Judged("rad/s", limit=1e-3),
}
"""How a body that is left alone is judged."""


def leave_alone(trial: Trial) -> dict[str, float]:
    """Measure drift, speed and spin of the first free body after it was left alone, as REST judges them."""
    before = trial.data.qpos[:3].copy()
    trial.run(trial.resting)
    velocity = trial.data.qvel
    return {
        "drift": 1e3 * float(np.linalg.norm(trial.data.qpos[:3] - before)),
        "speed": float(np.linalg.norm(velocity[:3])),
        "spin": float(np.linalg.norm(velocity[3:6])),
    }


def make_spec(world: str, rest: str = "", integrator: str = "Euler") -> mujoco.MjSpec:
    """Make a model from the XML of its world body, and of what else there is beside that."""
    return mujoco.MjSpec.from_string(
        f'<mujoco><option integrator="{integrator}"/><worldbody>{world}</worldbody>{rest}</mujoco>'
    )


def free_body(inside: str, pos: str) -> str:
    """The XML of a free body called `body` at a position, with its geoms and sites inside."""
    return f'<body name="body" pos="{pos}"><freejoint/>{inside}</body>'


def plate(mass: float) -> str:
    """The XML of a flat plate of 100 x 100 x 10 mm with a mass [kg]."""
    return f'<geom type="box" size=".05 .05 .005" mass="{mass}"/>'


def sphere(mass: float) -> str:
    """The XML of a sphere of radius 50 mm with a mass [kg]."""
    return f'<geom size=".05" mass="{mass}"/>'
