"""`rftsim play`: watch a policy, or the actions that it is compared with."""

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from rftsim.cli.extra import needing
from rftsim.cli.options import Count, File, Flag, Number
from rftsim.cli.output import make_table, print_json, print_written
from rftsim.cli.settings import Settings, read_settings
from rftsim.cli.view import print_keys
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.view.cameras import SIZE
from rftsim.view.live import watch

if TYPE_CHECKING:
    from rftsim_envs.env import SandEnv
    from rftsim_envs.training.actors import Maker
    from rftsim_envs.training.folder import Folder

LONGEST = 1e6
"""Longest time of an episode that may be asked for [s]."""
SHOWN = {"r": "return", "l": "steps", "speed": "speed [m/s]", "command": "commanded [m/s]", "slip": "slip"}
SHOWN |= {"power": "power [W]", "cost_of_transport": "cost of transport"}
"""Headings of what an episode came to, by name."""


@dataclasses.dataclass(frozen=True)
class Play:
    """Play episodes of a trained policy, or of an environment without one, and say what they came to.

    Example: rftsim play out/runner --record runner.rrd --video runner.mp4
    """

    run: tyro.conf.Positional[str]
    """A folder of `rftsim train`, or an environment: rftsim/NAME-v0, NAME, or FILE.py:CLASS."""
    actions: Annotated[
        Literal["policy", "zero", "random"] | None, tyro.conf.arg(metavar="WHOSE", help_behavior_hint="")
    ] = None
    """policy, zero or random; by default a folder's policy."""
    episodes: Count = 1
    """Number of episodes."""
    seconds: Number = None
    """Longest time of an episode [s], at which it is cut; with --live, after which the window closes."""
    seed: Count = 0
    """Episode k is seeded with seed + k."""
    set: Settings = ()
    """Of the task: ground=rigid."""
    record: File = None
    """Write a Rerun recording, .rrd."""
    video: File = None
    """Write a film, .mp4."""
    picture: File = None
    """Picture of four moments, with tractions, .png."""
    live: Flag = False
    """Watch one episode after the other in MuJoCo's viewer, until it is closed: with pushes, and stronger sand."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Play the episodes, show them, and print what they came to."""
        with needing("train"):
            from rftsim_envs.env import SandEnv
            from rftsim_envs.training.folder import Folder, make_plan
        if self.episodes < 1 or self.seed < 0 or (self.seconds is not None and not 0.0 < self.seconds <= LONGEST):
            raise RftsimError(
                f"episodes must be at least 1, seed zero or more, and seconds positive, {LONGEST:g} at most"
            )
        paths = [path for path in (self.record, self.video, self.picture) if path]
        if self.live and (paths or self.episodes > 1):
            raise RftsimError("--live goes on until its window is closed, and writes no files: play again without it")
        folder = Folder(self.run)
        plan = folder.plan() if folder.exists else make_plan(self.run, read_settings(self.set))
        who = self.actions or ("policy" if folder.exists else "random")
        if who == "policy" and not folder.exists:
            raise RftsimError(f"{self.run} is no folder of `rftsim train`: it has no policy")
        maker = self._maker(who, folder)
        with contextlib.ExitStack() as stack:
            given = plan.settings | read_settings(self.set)
            env = SandEnv(plan.task, "rgb_array" if self.video else None, *SIZE, **given)
            stack.callback(env.close)
            found = self._watched(env, maker) if self.live else self._played(env, maker, stack)
        name = plan.env
        if self.json:
            print_json({"env": name, "actions": who, "episodes": found, "written": [str(path) for path in paths]})
            return
        console = Console()
        console.print(_table(f"{name}, {who}", found))
        print_written(console, *paths)

    def _played(self, env: "SandEnv", maker: "Maker", stack: contextlib.ExitStack) -> list[dict[str, float]]:
        """What the episodes came to, shown in the files that were asked for."""
        from rftsim_envs.training import play

        watchers = self._watchers(env, stack)

        def watch(info: Mapping[str, Any]) -> None:
            for one in watchers:
                one(info)

        return list(play.play(env, maker, self.episodes, self.seed, seconds=self.seconds, watch=watch))

    def _watched(self, env: "SandEnv", maker: "Maker") -> list[dict[str, float]]:
        """What the episodes came to that were watched live, the one that the window's closing cut too."""
        from rftsim_envs.training.live import LiveEpisodes

        live = LiveEpisodes(env, maker, self.seed)
        print_keys(Console(stderr=True))
        watch(live, self.seconds)
        live.restart()
        return live.ended

    def _maker(self, who: str, folder: "Folder") -> "Maker":
        """Whoever chooses the actions, by the word for it."""
        from rftsim_envs.training import actors

        if who == "policy":
            return actors.trained(folder)
        return actors.at_random(self.seed) if who == "random" else actors.zero

    def _watchers(self, env: "SandEnv", stack: contextlib.ExitStack) -> list[Callable[[Mapping[str, Any]], None]]:
        """Functions that show each control step: in a recording, a film and a picture, where these are asked for."""
        from rftsim_envs.training import play

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
        return watchers


def _table(title: str, found: list[dict[str, float]]) -> Table:
    shown = {name: heading for name, heading in SHOWN.items() if name in found[0]}
    table = make_table(title, (), ("episode", *shown.values()), wrap=True)
    for k, episode in enumerate(found):
        table.add_row(str(k), *(f"{episode[name]:.4g}" for name in shown))
    return table
