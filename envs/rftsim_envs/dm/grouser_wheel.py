"""Grousered wheel, [Agarwal] Table 4.1: follow a commanded speed at low slip."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from dm_control.rl import control
from dm_control.utils import containers, rewards
from rftsim_models.wheels import GROUSER_WHEEL

from rftsim.sand.presets import PRESETS
from rftsim_envs.dm import wheel

TIME_LIMIT: Final = 10.0
GROUND: Final = wheel.Ground(PRESETS["poppy-seeds"], "drft2d", structural=True)
TOP_RATE: Final = 4 * np.pi
SPEEDS: Final = (0.1, 0.5)
"""Range of the commanded speed [m/s]."""
SUITE = containers.TaggedTasks()


@SUITE.add()
def follow(
    time_limit: float = TIME_LIMIT,
    random: "np.random.RandomState | int | None" = None,
    random_sand: bool = False,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Follow a speed that each episode commands."""
    physics = wheel.make_physics(GROUSER_WHEEL, GROUND, TOP_RATE)
    return wheel.make_environment(physics, Follow(GROUND, random_sand, random), time_limit, environment_kwargs)


class Follow(wheel.Task):
    """Hold a commanded speed, with little slip."""

    commanded_speed = 0.0

    def initialize_episode(self, physics: wheel.Physics) -> None:
        """Draw the commanded speed [m/s]."""
        self.commanded_speed = self.random.uniform(*SPEEDS)
        super().initialize_episode(physics)

    def get_observation(self, physics: wheel.Physics) -> wheel.Observation:
        """The wheel's motion and what is commanded."""
        observation = super().get_observation(physics)
        observation["commanded_speed"] = np.array([self.commanded_speed])
        return observation

    def get_reward(self, physics: wheel.Physics) -> float:
        """Closeness to the commanded speed, of which a quarter needs low slip."""
        close = rewards.tolerance(physics.speed() - self.commanded_speed, bounds=(-0.01, 0.01), margin=0.1)
        grip = rewards.tolerance(physics.slip(), bounds=(-0.2, 0.2), margin=0.4)
        return float(close * (3 + grip) / 4)
