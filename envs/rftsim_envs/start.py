"""Where an episode on dunes starts: another place of them, on which the robot is put as it is put on level ground."""

from typing import Final

import mujoco
import numpy as np

from rftsim.law import layout
from rftsim.model.readout import instances
from rftsim_envs.physics import Array
from rftsim_envs.relief import Relief
from rftsim_envs.task import Task

NEAR: Final = 0.25
"""Height over the lowest point below which a point stands on the ground, over the root's height."""


class Placer:
    """Puts a task's robot on dunes.

    Args:
        task: The task, which says how its robot leans.
        model: Its model, on sand.
        relief: The dunes.
    """

    def __init__(self, task: Task, model: mujoco.MjModel, relief: Relief) -> None:
        self._task, self._model, self._relief = task, model, relief
        self._data = mujoco.MjData(model)
        surfaces = {body: surface for bed in instances(model) for body, surface in bed.bodies.items()}
        self._points = {body: np.array(layout.read_columns(packed)[:3]) for body, packed in surfaces.items()}

    def place(self, i: int, rng: np.random.Generator, qpos: Array) -> None:
        """Draw the place of the dunes in simulation i, and put the robot on it.

        It leans as the ground under it does in the mean, and its lowest point over the ground is as high as it was.

        Args:
            i: Number of the simulation.
            rng: The episode's generator.
            qpos: Positions on level ground, (nq,), which are changed in place.
        """
        self._relief.move(i, rng)
        points, root = self._felt(qpos), self._task.root(qpos[None])[0]
        lowest = points[2].min()
        standing = points[:, points[2] - lowest < NEAR * (root[2] - lowest)]
        away = np.vstack([standing[:2] - root[:2, None], np.ones(standing.shape[1])])
        slope = np.linalg.lstsq(away.T, self._ground(i, standing), rcond=None)[0][:2]
        self._task.lean(qpos, slope)
        points = self._felt(qpos)
        qpos[1 if self._task.planar else 2] += lowest - (points[2] - self._ground(i, points)).min()

    def _felt(self, qpos: Array) -> Array:
        """Centres of the triangles that feel the sand, world frame [m], (3, k)."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        parts = [
            data.xpos[body][:, None] + data.xmat[body].reshape(3, 3) @ points for body, points in self._points.items()
        ]
        return np.hstack(parts)

    def _ground(self, i: int, points: Array) -> Array:
        """Height of the ground over points (3, k) [m], (k,)."""
        heights: Array = self._relief.height(points[:1], points[1:2], [i])[0]
        return heights
