"""The effort of the sand's implicit force in the environments, under random and swaying actions and under drives."""

from typing import Final

import numpy as np

from rftsim.bench.effort import Effort, Meter
from rftsim_envs import ground
from rftsim_envs.episodes import Episodes
from rftsim_envs.physics import One
from rftsim_envs.recipe import Drive
from rftsim_envs.task import Task
from rftsim_envs.tasks import TASKS, make

RANDOM: Final = "random"
"""Name of the actions that are drawn anew in each control step."""
SWAYING: Final = "swaying"
"""Name of the actions that are sines of RATE, each with a phase at random."""
RATE: Final = 2.0
"""Frequency of swaying actions [Hz]."""
DRIVES: Final = 4
"""Number of each task's drives that see nothing, at most."""
SEED: Final = 0
"""Seed of the random actions and of the episodes."""


def players() -> tuple[str, ...]:
    """Every task and who acts in it, as `Hopper/random`: random and swaying actions, and drives that see nothing."""
    return tuple(f"{name}/{who}" for name in TASKS for who in (RANDOM, SWAYING, *_some(make(name, {}).open_loops())))


def measure(player: str, h: float, duration: float) -> Effort:
    """Play episodes of a task one after the other.

    Args:
        player: One of `players`.
        h: Time step [s]; its control step is a multiple of it.
        duration: Simulated time of all episodes [s].
    """
    name, _, who = player.partition("/")
    task, meter, rng = make(name, {"timestep": h}), Meter(), np.random.default_rng(SEED)
    episodes = Episodes(task, One(ground.lay(task), meter.advance))
    drive = _drive(task, who, rng)
    episodes.restart([0], [rng])
    begun = 0
    for k in range(round(duration / task.config.period)):
        outcome = episodes.step(drive((k - begun) * task.config.period)[None])
        if meter.lost:
            break
        if outcome.terminated[0] or outcome.truncated[0]:
            episodes.restart([0], [rng])
            begun = k + 1
    return meter.effort()


def _some(drives: dict[str, Drive]) -> list[str]:
    """The names of DRIVES of them, spread evenly, the last one included."""
    names = list(drives)
    return names if len(names) <= DRIVES else [names[(k + 1) * len(names) // DRIVES - 1] for k in range(DRIVES)]


def _drive(task: Task, who: str, rng: np.random.Generator) -> Drive:
    if who == RANDOM:
        return lambda time: rng.uniform(-1.0, 1.0, task.naction)
    if who == SWAYING:
        phase = rng.uniform(0.0, 2.0 * np.pi, task.naction)
        return lambda time: np.sin(2.0 * np.pi * RATE * time + phase)
    return task.open_loops()[who]
