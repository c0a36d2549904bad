"""A vector environment of Gymnasium, on `mujoco.batch` or on a GPU."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from rftsim_envs import ground, tasks
from rftsim_envs.env import Action, spaces
from rftsim_envs.episodes import Episodes, Observation
from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Stepper
from rftsim_envs.simulations import side_by_side
from rftsim_envs.task import Task


class SandVectorEnv(VectorEnv[Observation, Action, NDArray[np.generic]]):
    """A task in many simulations, each with its own sand, stepped together on threads.

    Step by step equal to `SyncVectorEnv` of `SandEnv`s, with `AutoresetMode.SAME_STEP`: an episode that ends is
    followed by the next one in the same step, and its end is in `final_obs` and `final_info`.

    Args:
        task: Name of a task, a class of one's own, or where that is: FILE.py:CLASS or MODULE:CLASS.
        num_envs: Number of simulations.
        threads: Number of threads; 0 for as many as there are processors.
        physics: `batch`, which is MuJoCo's own on threads, or `warp`, which is mujoco_warp on a GPU.
        **settings: Fields of the task's Config.

    Raises:
        ConfigError: No such task, setting or physics.
        SceneError: Warp does not know the sand: terrain, or ruts.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self, task: "str | type[Task]", num_envs: int = 1, threads: int = 0, physics: Stepper = "batch", **settings: Any
    ) -> None:
        self.task, self.num_envs = tasks.make(task, settings), num_envs
        self.config = self.task.config
        self.episodes = Episodes(self.task, side_by_side(ground.lay(self.task), num_envs, threads, physics))
        self.single_observation_space, self.single_action_space = spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]

    def reset(
        self, *, seed: "int | list[int | None] | None" = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in each simulation; simulation i is seeded with seed + i, or from a list."""
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)] if not isinstance(seed, list) else seed
        )
        if len(seeds) != self.num_envs:
            raise ValueError(f"seeds are {len(seeds)}, and environments {self.num_envs}")
        for i, one in enumerate(seeds):
            if one is not None:
                self._rngs[i], _ = gym.utils.seeding.np_random(one)
        self.episodes.restart(range(self.num_envs), self._rngs)
        return self.episodes.observation(), _masked(self.episodes.info(), np.ones(self.num_envs, dtype=bool))

    def step(self, actions: ArrayLike) -> tuple[Observation, Array, Flags, Flags, dict[str, Any]]:
        """Go on by one control step with actions, (num_envs, naction); where an episode ends, begin the next one."""
        out = self.episodes.step(actions)
        observation, ended = out.observation, out.terminated | out.truncated
        info = _masked(out.info, ~ended)
        if ended.any():
            chosen = np.flatnonzero(ended).tolist()
            final = np.full(self.num_envs, None, dtype=object)
            for i in chosen:
                final[i] = observation[i].copy()
            info |= {"final_obs": final, "_final_obs": ended}
            info |= {"final_info": _masked(out.info, ended), "_final_info": ended}
            self.episodes.restart(chosen, [self._rngs[i] for i in chosen])
            observation[chosen] = self.episodes.observation()[chosen]
            info |= _masked(self.episodes.info(), ended)
        return observation, out.reward, out.terminated, out.truncated, info


def _masked(info: dict[str, NDArray[np.generic]], given: Flags) -> dict[str, Any]:
    """Gymnasium's form: under each name the values, zero where they are not given, and under _name where they are."""
    if not given.any():
        return {}
    shown: dict[str, Any] = {}
    for name, values in info.items():
        shown[name], shown[f"_{name}"] = np.where(given, values, np.zeros((), values.dtype)), given.copy()
    return shown
