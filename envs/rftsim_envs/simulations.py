"""Choose what steps many simulations side by side: MuJoCo's batch, or mujoco_warp."""

import importlib
from typing import get_args

import mujoco

from rftsim_envs.physics import Many, Physics
from rftsim_envs.recipe import Stepper
from rftsim_envs.task import ConfigError


def side_by_side(model: mujoco.MjModel, n: int, threads: int = 0, physics: Stepper = "batch") -> Physics:
    """Simulations of one model side by side.

    Args:
        model: Model that all simulate.
        n: Number of simulations.
        threads: Number of the batch's threads; 0 for as many as there are processors.
        physics: What steps them. Warp steps in single precision, by a linearised step, on what it calls its device.

    Raises:
        ValueError: There are no simulations, or less than no threads.
        ConfigError: There is no such physics, or its packages are missing.
        SceneError: Warp does not know the sand: terrain, or ruts.
    """
    if n < 1 or threads < 0:
        raise ValueError(f"there must be at least 1 simulation and 0 threads, not {n} and {threads}")
    if physics not in get_args(Stepper):
        raise ConfigError(f"no physics {physics!r}; there are {', '.join(get_args(Stepper))}")
    if physics == "batch":
        return Many(model, n, threads)
    try:
        importlib.import_module("rftsim.warp")
    except ImportError as error:
        raise ConfigError(f"physics warp: {error}") from error
    from rftsim_envs.worlds import Worlds

    return Worlds(model, n)
