"""`rftsim play`: watch a policy, or what it is compared with."""

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rftsim.cli.extra import needing
from rftsim.cli.inspect import Settings, settings
from rftsim.cli.output import print_json
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing

SHOWN = {"r": "return", "l": "steps", "speed": "speed [m/s]", "command": "commanded [m/s]", "slip": "slip"}
SHOWN |= {"power": "power [W]", "cost_of_transport": "cost of transport"}


@dataclasses.dataclass(frozen=True)
class Play:
    """Play episodes of a trained policy, or of an environment without one, and say what they came to.

    Example: rftsim play out/runner --record runner.rrd --video runner.mp4
    """

    run: tyro.conf.Positional[str]
    """A folder of `rftsim train`, or an environment: rftsim/NAME-v0 or NAME."""
    actions: Literal["policy", "zero", "random"] | None = None
    """Who acts: by default the policy of a folder, and random actions in an environment."""
    episodes: int = 1
    """How many."""
    seconds: float | None = None
    """Cut episodes there [s]."""
    seed: int = 0
    """Episode k is seeded with seed + k."""
    set: Settings = ()
    """Settings of the task, key=value ...: ground=rigid; may be repeated."""
    record: Path | None = None
    """Write a Rerun recording, .rrd."""
    video: Path | None = None
    """Write a film, .mp4."""
    picture: Path | None = None
    """Write a picture of four moments, with arrows for the sand's traction, .png."""
    json: bool = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Play and report."""
        with needing("train"):
            from rftsim_envs.env import SandEnv
            from rftsim_envs.training import actors, play
            from rftsim_envs.training.folder import Folder, make_plan
        if self.episodes < 1 or (self.seconds is not None and not self.seconds > 0.0):
            raise RftsimError("episodes must be at least 1, and seconds positive")
        folder = Folder(self.run)
        plan = folder.plan() if folder.exists else make_plan(self.run)
        who = self.actions or ("policy" if folder.exists else "random")
        if who == "policy" and not folder.exists:
            raise RftsimError(f"{self.run} is no folder of `rftsim train`: it has no policy")
        maker = actors.trained(folder) if who == "policy" else actors.zero
        maker = actors.at_random(self.seed) if who == "random" else maker
        with contextlib.ExitStack() as stack:
            env = SandEnv(
                plan.task,
                "rgb_array" if self.video else None,
                *play.SIZE,
                **(plan.settings | settings(self.set)),
            )
            stack.callback(env.close)
            watchers: list[Callable[[Mapping[str, Any]], None]] = []
            if self.record:
                check_writable(self.record, ".rrd")
                with needing("rerun"):
                    from rftsim_envs.watch import Watch
                watchers.append(stack.enter_context(Watch(env.episodes, self.record)).log)
            if self.video:
                check_writable(self.video, ".mp4")
                with needing("video"):
                    import av  # noqa: F401
                film = stack.enter_context(replacing(self.video))
                watchers.append(stack.enter_context(play.filming(env, film)))

            if self.picture:
                check_writable(self.picture, ".png")
                strip = stack.enter_context(replacing(self.picture))
                watchers.append(stack.enter_context(play.taking_strip(env, strip)))

            def watch(info: Mapping[str, Any]) -> None:
                for one in watchers:
                    one(info)

            found = list(play.play(env, maker, self.episodes, self.seed, seconds=self.seconds, watch=watch))
        written = [str(path) for path in (self.record, self.video, self.picture) if path]
        if self.json:
            print_json({"env": plan.as_json()["env"], "actions": who, "episodes": found, "written": written})
            return
        console = Console()
        console.print(_table(f"{plan.as_json()['env']}, {who}", found))
        for name in written:
            console.print(f"wrote {name}", highlight=False)


def _table(title: str, found: list[dict[str, float]]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("episode", justify="right")
    shown = {name: said for name, said in SHOWN.items() if name in found[0]}
    for said in shown.values():
        table.add_column(escape(said), justify="right")
    for k, episode in enumerate(found):
        table.add_row(str(k), *(f"{episode[name]:.4g}" for name in shown))
    return table
