"""Sand in dm_control: its suite, tasks in its style, an arena for composer. Needs the extra `dm-control`."""

from rftsim_envs.dm.arena import SandArena
from rftsim_envs.dm.suite import ALL_TASKS, load
from rftsim_envs.dm.suite_on_sand import on_sand
