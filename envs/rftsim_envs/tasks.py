"""All tasks by name, and how to make one."""

from typing import Any, Final

from rftsim_envs.c_leg_hexapod import CLegHexapod
from rftsim_envs.four_flap_runner import FourFlapRunner
from rftsim_envs.grouser_wheel import GrouserWheel
from rftsim_envs.hopper import Hopper
from rftsim_envs.quadruped import Quadruped
from rftsim_envs.rover import Rover
from rftsim_envs.task import ConfigError, Task, make_config

TASKS: Final[dict[str, type[Task]]] = {
    task.__name__: task for task in (GrouserWheel, FourFlapRunner, CLegHexapod, Rover, Hopper, Quadruped)
}


def make(name: str, settings: dict[str, Any]) -> Task:
    """A task by name, with these settings in place of its own.

    Raises:
        ConfigError: No such task or setting, or a value that cannot be.
    """
    if name not in TASKS:
        raise ConfigError(f"no task {name!r}; tasks are {', '.join(TASKS)}")
    return TASKS[name](make_config(TASKS[name], settings))
