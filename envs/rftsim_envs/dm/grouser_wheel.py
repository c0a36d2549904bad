"""Grousered wheel, [Agarwal] Table 4.1: follow a commanded speed at low slip."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from dm_control.rl import control
from dm_control.utils import containers
from rftsim_models.wheels import GROUSER_WHEEL

from rftsim_envs.dm import wheel
from rftsim_envs.grouser_wheel import GrouserWheel, WheelConfig
from rftsim_envs.physics import Array

CONFIG: Final = WheelConfig(timestep=wheel.TIMESTEP, duration=wheel.TIME_LIMIT, slip=0.1)
"""Settings of the task. Slip weighs little, as rewards end at 0: a wheel that spins shall still gain by its speed."""
TOP_RATE: Final = 4 * np.pi
"""Largest rate that can be commanded [rad/s]."""
SUITE = containers.TaggedTasks()


@SUITE.add()
def follow(
    time_limit: float = CONFIG.duration,
    random: "np.random.RandomState | int | None" = None,
    random_sand: bool = False,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Follow a speed that each episode commands, as `GrouserWheel` rewards it."""
    task = Follow(GrouserWheel(CONFIG), random_sand, random)
    return wheel.make_environment(wheel.rate_driven(GROUSER_WHEEL, TOP_RATE), task, time_limit, environment_kwargs)


class Follow(wheel.WheelTask):
    """A commanded speed to hold with little slip, without a drawbar load."""

    commanded_speed = 0.0
    """Speed that this episode commands [m/s]."""

    def command(self) -> Array:
        """Commanded speed [m/s] and no drawbar load [N], (2,)."""
        return np.array([self.commanded_speed, 0.0])

    def initialize_episode(self, physics: wheel.Physics) -> None:
        """Draw the commanded speed, then start near rolling."""
        self.commanded_speed = self.random.uniform(*CONFIG.speed)
        super().initialize_episode(physics)

    def get_observation(self, physics: wheel.Physics) -> wheel.Observation:
        """The wheel's motion, the sand's force and the commanded speed, in SI units."""
        observation = super().get_observation(physics)
        observation["commanded_speed"] = np.array([self.commanded_speed])
        return observation
