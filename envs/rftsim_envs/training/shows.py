"""Recordings of a policy while it is trained."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rftsim_envs.env import SandEnv
from rftsim_envs.training import actors
from rftsim_envs.training.folder import Folder, Plan
from rftsim_envs.training.play import play
from rftsim_envs.watch import Watch

SEED: Final = 0
"""Seed of the episode that is recorded, the same each time."""
DIGITS: Final = 9
"""Digits of the number of steps in a recording's name, so that names sort."""


class Shows:
    """Records an episode of a run's policy from time to time, as far as it is saved, without its noise.

    Args:
        plan: What is trained.
        path: Folder of the run; recordings are in its folder `watch`, named by the steps that were trained.
        every: Time between two recordings [s].
    """

    def __init__(self, plan: Plan, path: Path, every: float) -> None:
        self._env, self._folder, self._every = SandEnv(plan.task, **plan.settings), Folder(path), every
        self._shown = time.monotonic()

    def __call__(self, row: Mapping[str, Any]) -> None:
        """Record an episode, after an update of which this is the row of progress.csv, if it is time for one."""
        if time.monotonic() - self._shown >= self._every:
            self.record(int(row["steps"]))
            self._shown = time.monotonic()

    def record(self, steps: int) -> Path:
        """Record an episode of the policy after so many steps, and return the recording's path."""
        path = self._folder.path / "watch" / f"{steps:0{DIGITS}}.rrd"
        path.parent.mkdir(exist_ok=True)
        with Watch(self._env.episodes, path) as watch:
            list(play(self._env, actors.trained(self._folder), 1, SEED, seconds=None, watch=watch.log))
        return path
