"""Tasks on sand: Gymnasium environments, registered on import as `rftsim/NAME-v0`; and gymnasium's own, on sand.

`IDS` run as they are. `rftsim/Locomotion-v0` takes a robot of one's own, `model=PATH`, and `rftsim/Task-v0` a task of
one's own, `task=CLASS` or `task="FILE.py:CLASS"`.
"""

import gymnasium as _gym

from rftsim_envs.env import SandEnv
from rftsim_envs.gymnasium_on_sand import on_sand
from rftsim_envs.gymnasium_on_sand import register as _register
from rftsim_envs.locomotion import Locomotion, LocomotionConfig
from rftsim_envs.physics import Array
from rftsim_envs.recipe import Training
from rftsim_envs.task import Config, ConfigError, Moment, Task
from rftsim_envs.tasks import NAMED as _NAMED
from rftsim_envs.tasks import TASKS
from rftsim_envs.vector import SandVectorEnv

IDS = tuple(f"rftsim/{name}-v0" for name in TASKS)

for _name in (*_NAMED, None):
    _gym.register(
        f"rftsim/{_name or 'Task'}-v0",
        entry_point="rftsim_envs.env:SandEnv",
        vector_entry_point="rftsim_envs.vector:SandVectorEnv",
        kwargs={"task": _name} if _name else {},
    )
_register()
