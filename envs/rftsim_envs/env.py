"""A Gymnasium environment of one simulation."""

from typing import Any, Final, Literal

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import ArrayLike, NDArray

from rftsim.view.cameras import Follower
from rftsim.view.render import Pictures
from rftsim_envs import ground, tasks
from rftsim_envs.episodes import Episodes, Observation
from rftsim_envs.physics import One
from rftsim_envs.task import Task

Action = NDArray[np.float32]
FOLLOW: Final = "follow"
"""Name of the camera by which pictures are taken, of a model that has it."""


class SandEnv(gym.Env[Observation, Action], EzPickle):
    """A task in one simulation, as an environment of Gymnasium.

    Episodes begin anew only at `reset`. Where MuJoCo gives a simulation up, the episode is terminated with
    `info["diverged"]` and no reward. Actions outside -1 and 1 are clipped; those that are not finite are refused.

    Args:
        task: Name of a task, a class of one's own, or where that is: FILE.py:CLASS or MODULE:CLASS.
        render_mode: `rgb_array`, or None.
        width: Width of pictures [pixels].
        height: Height of pictures [pixels].
        **settings: Fields of the task's Config.

    Raises:
        ConfigError: No such task or setting.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self,
        task: "str | type[Task]",
        render_mode: Literal["rgb_array"] | None = None,
        width: int = 640,
        height: int = 480,
        **settings: Any,
    ) -> None:
        EzPickle.__init__(self, task, render_mode, width, height, **settings)
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be 'rgb_array' or None, not {render_mode!r}")
        self.task = tasks.make(task, settings)
        self.config, self.render_mode = self.task.config, render_mode
        self.physics = One(ground.lay(self.task))
        self.model, self.data = self.physics.model, self.physics.data
        self.episodes = Episodes(self.task, self.physics)
        self.metadata = self.metadata | {"render_fps": round(1.0 / self.config.period)}
        self.observation_space, self.action_space = spaces(self.episodes)
        self._size = width, height
        self._pictures: Pictures | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, and return its first observation, (nobservation,), and what is known of its ground."""
        super().reset(seed=seed)
        self.episodes.restart([0], [self.np_random])
        return self.episodes.observation()[0], _alone(self.episodes.info())

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go on by one control step with an action, (naction,)."""
        out = self.episodes.step(np.asarray(action)[None])
        return (
            out.observation[0],
            float(out.reward[0]),
            bool(out.terminated[0]),
            bool(out.truncated[0]),
            _alone(out.info),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """A picture with the sand's forces, (height, width, 3), by the model's camera `follow` or by one like it.

        Without a render mode it is None.
        """
        if self.render_mode is None:
            return None
        if self._pictures is None:
            self._pictures, self._follower = Pictures(self.model, *self._size), Follower(self.model)
        return self._pictures.take(self.data, FOLLOW if has_camera(self.model) else self._follower.at(self.data))

    def close(self) -> None:
        """Let go of what pictures need."""
        if self._pictures is not None:
            self._pictures.close()
            self._pictures = None


def has_camera(model: mujoco.MjModel) -> bool:
    """Whether a model has the camera `follow`."""
    return any(model.camera(i).name == FOLLOW for i in range(model.ncam))


def spaces(episodes: Episodes) -> tuple[Any, Any]:
    """The spaces of observations and of actions of one simulation."""
    return (
        gym.spaces.Box(-np.inf, np.inf, (episodes.nobservation,), np.float32),
        gym.spaces.Box(-1.0, 1.0, (episodes.task.naction,), np.float32),
    )


def _alone(info: dict[str, NDArray[np.generic]]) -> dict[str, Any]:
    return {name: values[0].item() for name, values in info.items()}
