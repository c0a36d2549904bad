"""Sand in mujoco_warp, for thousands of worlds on a GPU; of the extra `rftsim[warp]`."""

from rftsim.warp.sand import WarpSand, Worlds, put, without_plugin
