"""Sand in dm_control: tasks in the style of its suite, and an arena for composer. Needs the extra `dm-control`."""

from rftsim_envs.dm.arena import SandArena
from rftsim_envs.dm.suite import ALL_TASKS, load
