"""Sand in dm_control: every task as its environment, its own suite on sand, an arena for composer.

It needs the extra `dm-control`.
"""

from rftsim_envs.dm.arena import SandArena
from rftsim_envs.dm.environment import load
from rftsim_envs.dm.suite_on_sand import on_sand
