"""A scan of the ground's height at places around a robot and ahead of it."""

from typing import Final

import numpy as np

from rftsim_envs.physics import Array
from rftsim_envs.task import Moment, Task

ALONG: Final = (-0.5, 1.5)
"""Where the places start and end along the heading, from the root, in lengths of the robot."""
ASIDE: Final = (0.5, 0.0, -0.5)
"""How far to the left the lines lie along which a robot that can turn scans, in its lengths."""


class Scan:
    """The scan of a task's robot, which its configuration's `scan` describes.

    Attributes:
        places: Places ahead of the root and to its left, in the axes of the heading [m], (k, 2).
    """

    def __init__(self, task: Task) -> None:
        ahead = np.linspace(*ALONG, task.config.scan)
        aside = (0.0,) if task.planar else ASIDE
        self._task = task
        self.places = task.length * np.array([(x, y) for y in aside for x in ahead]).reshape(-1, 2)

    def heights(self, moment: Moment) -> Array:
        """Height of the undisturbed ground at the places over the root, in lengths of the robot, (n, k)."""
        root, yaw = self._task.root(moment.qpos), self._task.heading(moment.qpos)[:, None]
        ahead, left = self.places.T
        x = root[:, :1] + np.cos(yaw) * ahead - np.sin(yaw) * left
        y = root[:, 1:2] + np.sin(yaw) * ahead + np.cos(yaw) * left
        heights: Array = (moment.relief.height(x, y) - root[:, 2:]) / self._task.length
        return heights
