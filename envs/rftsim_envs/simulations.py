"""Choose what steps many simulations side by side: MuJoCo's batch, or mujoco_warp."""

import importlib.util
from typing import Final

import mujoco

from rftsim_envs.physics import Many, Physics
from rftsim_envs.recipe import BATCH, WARP
from rftsim_envs.task import ConfigError

PHYSICS: Final = (BATCH, WARP)
"""Names of what can step simulations: `mujoco.batch` on threads, or mujoco_warp on a GPU."""


def side_by_side(model: mujoco.MjModel, n: int, threads: int = 0, physics: str = BATCH) -> Physics:
    """Simulations of one model side by side.

    Args:
        model: Model that all simulate.
        n: Number of simulations.
        threads: Number of the batch's threads; 0 for as many as there are processors.
        physics: One of PHYSICS. Warp steps in single precision, by a linearised step, on what it calls its device.

    Raises:
        ValueError: There are no simulations, or less than no threads.
        ConfigError: There is no such physics, or its packages are missing.
        SceneError: Warp does not know the sand: terrain, or ruts.
    """
    if n < 1 or threads < 0:
        raise ValueError(f"there must be at least 1 simulation and 0 threads, not {n} and {threads}")
    if physics == BATCH:
        return Many(model, n, threads)
    if physics != WARP:
        raise ConfigError(f"no physics {physics!r}; there are {', '.join(PHYSICS)}")
    if any(importlib.util.find_spec(name) is None for name in ("warp", "mujoco_warp")):
        raise ConfigError("physics warp needs mujoco_warp: pip install 'rftsim[warp]'")
    from rftsim_envs.worlds import Worlds

    return Worlds(model, n)
