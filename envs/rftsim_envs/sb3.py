"""A vector environment of Stable-Baselines3, on `mujoco.batch` or on a GPU."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from rftsim_envs import ground, tasks
from rftsim_envs.env import Action, spaces
from rftsim_envs.episodes import Episodes, Observation
from rftsim_envs.recipe import Stepper
from rftsim_envs.simulations import side_by_side
from rftsim_envs.tally import Tally
from rftsim_envs.task import Task


class SandVecEnv(VecEnv):
    """A task in many simulations, each with its own sand, stepped together on threads.

    Step by step equal to `DummyVecEnv` of `SandEnv`s: an episode that ends is followed by the next one in the same
    step. The `info` of a simulation is empty but where an episode ended: `terminal_observation`,
    `TimeLimit.truncated`, and in `episode` what it came to, as `rftsim_envs.tally.Tally.take` has it.

    Args:
        task: Name of a task, a class of one's own, or where that is: FILE.py:CLASS or MODULE:CLASS.
        n_envs: Number of simulations.
        threads: Number of threads; 0 for as many as there are processors.
        physics: `batch`, which is MuJoCo's own on threads, or `warp`, which is mujoco_warp on a GPU.
        **settings: Fields of the task's Config.

    Attributes:
        rngs: Generators from which each simulation's episodes are drawn.
        outcome: Outcome of the last step, before new episodes began.

    Raises:
        ConfigError: No such task, setting or physics.
        SceneError: Warp does not know the sand: terrain, or ruts.
    """

    def __init__(
        self, task: "str | type[Task]", n_envs: int, threads: int = 0, physics: Stepper = "batch", **settings: Any
    ) -> None:
        self.task = tasks.make(task, settings)
        self.config = self.task.config
        self.physics = side_by_side(ground.lay(self.task), n_envs, threads, physics)
        self.episodes = Episodes(self.task, self.physics)
        self.rngs = [np.random.default_rng() for _ in range(n_envs)]
        self._tally, self._action = Tally(n_envs), np.zeros((n_envs, self.task.naction), np.float32)
        self.render_mode = None
        super().__init__(n_envs, *spaces(self.episodes))

    @property
    def measured(self) -> list[str]:
        """Names of the numbers in `episode` beside `r` and `l`; none before the first step."""
        return self._tally.names

    def reset(self) -> Observation:
        """Begin an episode in each simulation; simulation i is seeded with seed + i after `seed(seed)`."""
        for i, seed in enumerate(self._seeds):
            if seed is not None:
                self.rngs[i], _ = gym.utils.seeding.np_random(seed)
        self._reset_seeds()
        self._reset_options()
        self._tally = Tally(self.num_envs)
        self.episodes.restart(range(self.num_envs), self.rngs)
        return self.episodes.observation()

    def step_async(self, actions: Action) -> None:
        """Keep the actions, (n_envs, naction), for `step_wait`."""
        self._action = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Go on by one control step; where an episode ends, begin the next one."""
        out = self.outcome = self.episodes.step(self._action)
        self._tally.add(out)
        observation, done = out.observation, out.terminated | out.truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            chosen = np.flatnonzero(done).tolist()
            for i in chosen:
                infos[i]["terminal_observation"] = observation[i].copy()
                infos[i]["TimeLimit.truncated"] = bool(out.truncated[i])
                infos[i]["episode"] = self._tally.take(i)
            self.episodes.restart(chosen, [self.rngs[i] for i in chosen])
            observation[chosen] = self.episodes.observation()[chosen]
        return observation, out.reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Do nothing, as there is nothing to let go of."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute, the same for all simulations."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute, for all simulations."""
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Simulations here are not environments of their own.

        Raises:
            NotImplementedError: Always.
        """
        raise NotImplementedError(f"the simulations of a SandVecEnv have no method {method_name!r}")

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Whether the wrapper is SB3's Monitor, whose counts of returns and lengths are made here; nothing wraps."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence["NDArray[np.uint8] | None"]:
        """None for each simulation, since only `SandEnv` draws pictures."""
        return [None] * self.num_envs
