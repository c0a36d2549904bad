"""Four-flap runner, [Agarwal] Table 4.3: run fast."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from dm_control.rl import control
from dm_control.utils import containers, rewards
from rftsim_models.wheels import FOUR_FLAP_RUNNER

from rftsim.sand.presets import PRESETS
from rftsim_envs.dm import wheel

TIME_LIMIT: Final = 10.0
GROUND: Final = wheel.Ground(PRESETS["poppy-seeds"].replace(lambda_=4.0), "drft2d", structural=False)
TOP_RATE: Final = 6 * np.pi
RUN_SPEED: Final = 1.5
"""Speed from which the reward is 1 [m/s]."""
SUITE = containers.TaggedTasks()


@SUITE.add()
def run(
    time_limit: float = TIME_LIMIT,
    random: "np.random.RandomState | int | None" = None,
    random_sand: bool = False,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Run fast."""
    physics = wheel.make_physics(FOUR_FLAP_RUNNER, GROUND, TOP_RATE)
    return wheel.make_environment(physics, Run(GROUND, random_sand, random), time_limit, environment_kwargs)


class Run(wheel.Task):
    """Be fast."""

    def get_reward(self, physics: wheel.Physics) -> float:
        """Speed as a share of RUN_SPEED."""
        return float(
            rewards.tolerance(
                physics.speed(),
                bounds=(RUN_SPEED, float("inf")),
                margin=RUN_SPEED,
                value_at_margin=0.0,
                sigmoid="linear",
            )
        )
