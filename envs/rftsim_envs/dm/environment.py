"""Any task as an environment of dm_control: the observations, rewards and episodes of `SandEnv`, bit for bit."""

import collections
from collections.abc import Mapping
from typing import Any, Final

import mujoco
import numpy as np
from dm_control import mujoco as dm_mujoco
from dm_control.mujoco.wrapper import MjData, MjModel
from dm_control.rl import control
from dm_control.suite import base
from dm_env import specs

from rftsim_envs import tasks
from rftsim_envs.episodes import Episodes, Observation, Outcome
from rftsim_envs.ground import lay
from rftsim_envs.physics import Array, One
from rftsim_envs.task import Task

SEEDS: Final = 1 << 31
"""Number of seeds that one generator of dm_control's draws from."""


def load(
    task: "str | type[Task]",
    *,
    random: "np.random.RandomState | int | None" = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    **settings: Any,
) -> control.Environment:
    """A task as an environment of dm_control.

    Actions are within -1 and 1, observations one array under `observations`, and rewards those of `SandEnv`, which may
    be negative. An episode that ends in failure or success has discount 0 at its end, and one whose time is up 1.

    Args:
        task: Its name, a class of one's own, or where that is: FILE.py:CLASS or MODULE:CLASS.
        random: A seed, whose first episode is that of `SandEnv.reset(seed)`, or a generator that seeds.
        environment_kwargs: Arguments of `control.Environment`, but for its time steps.
        **settings: Fields of the task's Config.

    Raises:
        ConfigError: No such task or setting.
    """
    asked = tasks.make(task, settings)
    physics = Physics.from_model(MjModel(lay(asked)))
    kwargs = dict(environment_kwargs or {})
    return control.Environment(physics, SandTask(asked, random), control_timestep=asked.config.period, **kwargs)


class Physics(dm_mujoco.Physics):
    """Physics of dm_control that takes the time steps of a single simulation, as episodes do.

    Attributes:
        one: That simulation, on the data of this physics.
        power: Mean positive power of the actuators over the last steps [W], (1,).
    """

    one: One
    power: Array

    def _reload_from_data(self, data: MjData) -> None:
        super()._reload_from_data(data)
        self.one, self.power = One(self.model.ptr, data=self.data.ptr), np.zeros(1)

    def step(self, nstep: int = 1) -> None:
        """Advance by whole time steps of MuJoCo, fewer where one fails."""
        self.power = self.one.step(nstep)

    def after_reset(self) -> None:
        """Compute where everything is, and nothing from which the next step would start otherwise."""
        model, data = self.model.ptr, self.data.ptr
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)


class SandTask(base.Task):
    """A task of ours in the form of dm_control's.

    Args:
        asked: The task.
        random: As of `load`.

    Attributes:
        asked: The task.
        outcome: Outcome of the last control step, with its `info`; None at an episode's start.
    """

    outcome: Outcome | None

    def __init__(self, asked: Task, random: "np.random.RandomState | int | None" = None) -> None:
        super().__init__(random=random)
        self.asked, self.outcome = asked, None
        seed = self.random.randint(SEEDS) if random is None or isinstance(random, np.random.RandomState) else random
        self._rng = np.random.default_rng(seed)
        self._episodes: Episodes | None = None

    def episodes(self, physics: Physics) -> Episodes:
        """The episodes of the task in a physics."""
        if self._episodes is None or self._episodes.physics is not physics.one:
            self._episodes = Episodes(self.asked, physics.one)
        return self._episodes

    def initialize_episode(self, physics: Physics) -> None:
        """Begin the next episode, drawn from the generator."""
        self.episodes(physics).restart([0], [self._rng])
        self.outcome = None

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """Bounds of an action, -1 and 1, (naction,)."""
        return specs.BoundedArray((self.asked.naction,), float, -1.0, 1.0, name="action")

    def before_step(self, action: Array, physics: Physics) -> None:
        """Set the controls that an action asks for, (naction,)."""
        self.episodes(physics).act(np.asarray(action)[None])

    def after_step(self, physics: Physics) -> None:
        """Take what the control step came to, and bring what is drawn up to its end."""
        self.outcome = self.episodes(physics).conclude(physics.power)
        physics.after_reset()

    def get_observation(self, physics: Physics) -> "collections.OrderedDict[str, Observation]":
        """Give the observation under the name `observations`, (nobservation,)."""
        seen = self.episodes(physics).observation() if self.outcome is None else self.outcome.observation
        return collections.OrderedDict([(control.FLAT_OBSERVATION_KEY, seen[0])])

    def get_reward(self, physics: Physics) -> float:
        """The reward of the last control step, and zero at an episode's start."""
        return 0.0 if self.outcome is None else float(self.outcome.reward[0])

    def get_termination(self, physics: Physics) -> float | None:
        """The discount at an episode's end: 0 after failure or success, 1 where time is up; None before."""
        if self.outcome is None or not (self.outcome.terminated[0] or self.outcome.truncated[0]):
            return None
        return 0.0 if self.outcome.terminated[0] else 1.0
