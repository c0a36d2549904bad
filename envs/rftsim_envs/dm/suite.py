"""All tasks by name, as `dm_control.suite` has them."""

from collections.abc import Mapping
from typing import Any, Final

from dm_control.rl import control

from rftsim_envs.dm import four_flap_runner, grouser_wheel

DOMAINS: Final = {"four_flap_runner": four_flap_runner.SUITE, "grouser_wheel": grouser_wheel.SUITE}
"""Tasks of each domain, by name."""
ALL_TASKS: Final = tuple((domain, task) for domain, tasks in DOMAINS.items() for task in tasks)
"""Every (domain name, task name)."""


def load(
    domain_name: str,
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    visualize_reward: bool = False,
) -> control.Environment:
    """Load an environment by the names of its domain and task.

    Args:
        domain_name: Name of a domain.
        task_name: Name of a task in it.
        task_kwargs: Arguments of the task: `time_limit` [s], `random`, a seed, and `random_sand`.
        environment_kwargs: Arguments of `control.Environment`.
        visualize_reward: Show the reward in the wheel's colour.

    Raises:
        ValueError: There is no such domain or task.
    """
    if domain_name not in DOMAINS:
        raise ValueError(f"no domain {domain_name!r}; domains are {', '.join(DOMAINS)}")
    tasks = DOMAINS[domain_name]
    if task_name not in tasks:
        raise ValueError(f"no task {task_name!r} in domain {domain_name!r}; tasks are {', '.join(tasks)}")
    env = tasks[task_name](**(task_kwargs or {}), environment_kwargs=environment_kwargs)
    env.task.visualize_reward = visualize_reward
    return env
