"""The hard cases on Warp, beside the engine plugin's and what they converge to."""

from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import mujoco
import mujoco_warp as mjw
import warp as wp

from rftsim.bench.hard_cases import CASES
from rftsim.bench.trials import Judged, Trial
from rftsim.warp.sand import Worlds, compile_coupled, put

STEPS: Final = (2e-3, 5e-3)
"""Time steps that are played [s]."""
CONVERGED: Final = 2e-4
"""Time step of the engine plugin's answers that both are held against [s]."""
STATE: Final = ("qpos", "qvel", "act", "ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat")
"""What a script may set, and mujoco_warp is told before it steps."""

wp.config.log_level = wp.LOG_WARNING


class Played(NamedTuple):
    """A quantity of a hard case, measured on Warp and by the engine plugin."""

    case: str
    quantity: str
    h: float
    """Time step [s]."""
    warp: float
    plugin: float
    wanted: float
    """The exact or converged value; where nought is wanted, the limit."""
    judged: Judged


class Stepper:
    """Takes the steps of a trial on Warp: a stand-in for `mujoco.mj_step`."""

    def __init__(self, spec: mujoco.MjSpec, iterations: int) -> None:
        """Make it for a spec with sand."""
        self._spec, self._iterations = spec, iterations
        self._worlds: Worlds | None = None

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, nstep: int = 1) -> None:
        """Take steps from the state of data, and bring it up to date."""
        if self._worlds is None:
            own = compile_coupled(self._spec)
            self._worlds = put(own, iterations=self._iterations, njmax=200, nconmax=100)
        m, d, *_ = self._worlds
        for name in STATE:
            if getattr(data, name).size:
                getattr(d, name).assign(getattr(data, name)[None].astype("f4"))
        for _ in range(nstep):
            mjw.step(m, d)
        for name in STATE[:3]:
            if getattr(data, name).size:
                getattr(data, name)[:] = getattr(d, name).numpy()[0]
        data.time += nstep * model.opt.timestep
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)


def play(names: Iterable[str], iterations: int, report: Callable[[str], Any]) -> list[Played]:
    """Play hard cases on Warp and by the engine plugin at STEPS, and by the latter at CONVERGED.

    Args:
        names: Names of hard cases.
        iterations: Linearisations of the implicit force in a step.
        report: Called with what was played.
    """
    rows = []
    for name in names:
        case = CASES[name]
        converged = case.play(case.build(CONVERGED, "implicit"))
        for h in STEPS:
            trial: Trial = case.build(h, "implicit")
            trial.advance = Stepper(trial.spec, iterations)
            on_warp, by_plugin = case.play(trial), case.play(case.build(h, "implicit"))
            for quantity, judged in case.judged.items():
                exact = converged[quantity] if judged.exact is None else judged.exact
                wanted = exact if judged.limit is None else judged.limit
                rows.append(Played(name, quantity, h, on_warp[quantity], by_plugin[quantity], wanted, judged))
            report(name)
    return rows
