"""Four-flap runner, [Agarwal] Table 4.3: run fast."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from dm_control.rl import control
from dm_control.utils import containers
from rftsim_models.wheels import FOUR_FLAP_RUNNER

from rftsim_envs.dm import wheel
from rftsim_envs.four_flap_runner import FourFlapRunner, RunnerConfig

CONFIG: Final = RunnerConfig(timestep=wheel.TIMESTEP, duration=wheel.TIME_LIMIT)
TOP_RATE: Final = 6 * np.pi
"""Largest rate that can be commanded [rad/s]."""
SUITE = containers.TaggedTasks()


@SUITE.add()
def run(
    time_limit: float = CONFIG.duration,
    random: "np.random.RandomState | int | None" = None,
    random_sand: bool = False,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Run fast at a steady draw, as `FourFlapRunner` rewards it."""
    task = wheel.WheelTask(FourFlapRunner(CONFIG), random_sand, random)
    return wheel.make_environment(wheel.rate_driven(FOUR_FLAP_RUNNER, TOP_RATE), task, time_limit, environment_kwargs)
