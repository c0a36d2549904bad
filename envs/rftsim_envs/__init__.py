"""Tasks on sand: Gymnasium environments, registered on import as `rftsim/NAME-v0`; and gymnasium's own, on sand."""

import gymnasium as _gym

from rftsim_envs.env import SandEnv
from rftsim_envs.gymnasium_on_sand import on_sand
from rftsim_envs.gymnasium_on_sand import register as _register
from rftsim_envs.task import Config, ConfigError, Moment, Task
from rftsim_envs.tasks import TASKS
from rftsim_envs.vector import SandVectorEnv

IDS = tuple(f"rftsim/{name}-v0" for name in TASKS)

for _name, _id in zip(TASKS, IDS, strict=True):
    _gym.register(
        _id,
        entry_point="rftsim_envs.env:SandEnv",
        vector_entry_point="rftsim_envs.vector:SandVectorEnv",
        kwargs={"task": _name},
    )
_register()
