"""Sand in mujoco_warp, for thousands of worlds on a GPU; of the extra `rftsim[warp]`."""

import importlib.util

if any(importlib.util.find_spec(name) is None for name in ("warp", "mujoco_warp")):
    raise ImportError("rftsim.warp needs mujoco_warp: pip install 'rftsim[warp]'")

from rftsim.warp.bed import PARAMETERS, WarpBed
from rftsim.warp.sand import ITERATIONS, WarpSand, Worlds, compile_coupled, put, without_plugin
