"""Episodes of a task in n simulations side by side: what single, vector and training environments are made of."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rftsim_envs.ground import Ground, draw
from rftsim_envs.limits import Limits
from rftsim_envs.physics import Array, Flags, Physics
from rftsim_envs.scan import Scan
from rftsim_envs.start import Placer
from rftsim_envs.task import ConfigError, Moment, Task

Observation = NDArray[np.float32]


class Outcome(NamedTuple):
    """Outcome of a control step of n simulations."""

    observation: Observation
    """Observations at the step's end, (n, nobservation)."""
    reward: Array
    """Rewards of the step, (n,); zero where MuJoCo gave a simulation up."""
    terminated: Flags
    """Whether the episode ended early: in failure, in success or because MuJoCo gave it up, (n,)."""
    truncated: Flags
    """Whether the episode ended because its time was up, (n,)."""
    info: dict[str, NDArray[np.generic]]
    """Terms of the reward as `reward/NAME`, what the task measures, and what all tasks tell, (n,) each."""


class Episodes:
    """Episodes of a task in all simulations of a physics.

    Args:
        task: The task, whose robot is in the physics' model.
        physics: The simulations.

    Attributes:
        nobservation: Number of numbers in an observation.

    Raises:
        ConfigError: The model has no keyframe.
    """

    def __init__(self, task: Task, physics: Physics) -> None:
        if not physics.model.nkey:
            name = type(task).__name__
            raise ConfigError(f"the model of {name} has no keyframe: the first one is where an episode starts")
        task.prepare(physics.model)
        self.task, self.physics, n = task, physics, physics.n
        self.ground = Ground(physics, task.config)
        self._limits, self._scan = Limits(physics, self.ground.relief), Scan(task)
        self._placer = None if self.ground.relief.is_level else Placer(task, physics.model, self.ground.relief)
        self._qpos, self._qvel = physics.field("qpos"), physics.field("qvel")
        self._ctrl, self._sensors = physics.field("ctrl"), physics.field("sensordata")
        self._command, self._action = np.zeros((n, task.ncommand)), np.zeros((n, task.naction))
        self._count, self._energy, self._distance = np.zeros(n, dtype=int), np.zeros(n), np.zeros(n)
        self._last, self._before = self._action.copy(), self._qpos.copy()
        one = self._observe(self._moment(self._before, np.zeros(n)))
        self._seen = np.zeros((n, task.config.history, one.shape[1]), dtype=np.float32)
        self.nobservation = self._seen[0].size

    def restart(self, chosen: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin episodes in the chosen simulations, each with a generator of its own."""
        model = self.physics.model

        def place() -> None:
            for i, rng in zip(chosen, rngs, strict=True):
                self.ground.put(i, draw(self.task.config, self.task.planar, rng))
                self._qpos[i], self._qvel[i] = model.key_qpos[0], model.key_qvel[0]
                self._ctrl[i] = model.key_ctrl[0]
                self._command[i] = self.task.start(rng, self._qpos[i], self._qvel[i])
                if self._placer is not None:
                    self._placer.place(i, rng, self._qpos[i])

        self.physics.restart(chosen, place)
        for kept in (self._count, self._energy, self._distance, self._action, self._last):
            kept[list(chosen)] = 0
        self._seen[list(chosen)] = self._observe(self._now())[list(chosen), None]

    def observation(self) -> Observation:
        """Observations at the start of an episode, (n, nobservation); what came before it was as it is then."""
        self._seen[:, -1] = self._observe(self._now())
        return self._flat()

    def info(self) -> dict[str, NDArray[np.generic]]:
        """The `strength`, `friction` [-] and `slope_deg` [deg] of the ground that an episode has, (n,) each."""
        strength, friction = np.exp(self.ground.draws[:, :2]).T
        slope = np.rad2deg(np.arcsin(np.linalg.norm(self.ground.draws[:, 2:], axis=1)))
        return {"strength": strength, "friction": friction, "slope_deg": slope}

    def step(self, action: ArrayLike) -> Outcome:
        """Take a control step in every simulation.

        Args:
            action: Actions, (n, naction), which are clipped to -1 and 1.

        Raises:
            ValueError: It has another shape, or is not finite.
        """
        self.act(action)
        return self.conclude(self.physics.step(self.task.config.substeps))

    def act(self, action: ArrayLike) -> None:
        """Begin a control step, for whoever takes its time steps himself: set the controls that actions ask for.

        Args:
            action: As of `step`.

        Raises:
            ValueError: As of `step`.
        """
        wanted = np.array(action, dtype=float)
        if wanted.shape != self._action.shape or not np.isfinite(wanted).all():
            raise ValueError(f"the action must be finite and of shape {self._action.shape}, not {action!r}")
        self._before = self._qpos.copy()
        self._last, self._action = self._action, np.clip(wanted, -1.0, 1.0)
        self._ctrl[:] = self.task.controls(self._action, self._moment(self._before, np.zeros(len(wanted))))

    def conclude(self, power: Array) -> Outcome:
        """End a control step that `act` began, after its time steps.

        Args:
            power: Mean positive power of the actuators over them [W], (n,).
        """
        task, period = self.task, self.task.config.period
        moment, diverged = self._moment(self._before, power), self.physics.failed()
        terms, measures = task.rewards(moment), task.measures(moment)
        reached = task.reached(moment) & ~diverged
        self._count += 1
        self._energy += power * period
        self._distance += np.abs(task.speed(moment)) * period
        info: dict[str, NDArray[np.generic]] = {f"reward/{name}": term * period for name, term in terms.items()}
        reward = np.where(diverged, 0.0, sum(info.values()))
        info |= measures | {"power": power, "diverged": diverged, "reached": reached} | self._limits.measures()
        info["cost_of_transport"] = self._energy / (task.weight * np.maximum(self._distance, 1e-3))
        terminated = task.failed(moment) | reached | diverged
        truncated = (self._count >= task.config.steps) & ~terminated
        return Outcome(self._look(moment), reward, terminated, truncated, info)

    def _now(self) -> Moment:
        """This moment as one at which an episode starts."""
        return self._moment(self._qpos, np.zeros(self.physics.n))

    def _moment(self, before: Array, power: Array) -> Moment:
        return Moment(
            before=before,
            qpos=self._qpos,
            qvel=self._qvel,
            sensors=self._sensors,
            gravity=self.ground.gravity,
            command=self._command,
            action=self._action,
            last=self._last,
            power=power,
            period=self.task.config.period,
            relief=self.ground.relief,
        )

    def _look(self, moment: Moment) -> Observation:
        """Observations of a moment and of those before it, (n, nobservation), the latest at the end."""
        self._seen[:, :-1] = self._seen[:, 1:]
        self._seen[:, -1] = self._observe(moment)
        return self._flat()

    def _flat(self) -> Observation:
        return self._seen.reshape(len(self._seen), -1).copy()

    def _observe(self, moment: Moment) -> Observation:
        """Observations of one moment, (n, nobservation / history)."""
        seen = self.task.observe(moment)
        if self.task.config.scan:
            seen = np.hstack([seen, self._scan.heights(moment)])
        if self.task.config.observe_ground:
            seen = np.hstack([seen, self.ground.draws])
        return seen.astype(np.float32)
