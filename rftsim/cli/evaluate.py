"""`rftsim evaluate`: how good policies are, on which ground."""

import dataclasses
import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console
from rich.progress import Progress

from rftsim.cli.extra import needing
from rftsim.cli.options import Count, File, Flag, Names, Text
from rftsim.cli.output import is_quiet, make_table, print_json, print_written
from rftsim.cli.results import draw
from rftsim.errors import RftsimError
from rftsim.files import check_writable

if TYPE_CHECKING:
    from rftsim_envs.training.evaluate import Score

MOST_EPISODES = 10_000
"""Most episodes on a ground, which are simulated side by side."""
NUMBERS = {"speed": "speed [m/s]", "error": "off by [m/s]", "cost_of_transport": "CoT", "early": "early [%]"}
NUMBERS |= {"reached": "arrived [%]"}
"""Headings of what is printed beside the return, where it is measured, by name."""
SHARES = ("early", "reached")
"""Those that are shares of the episodes; of arrival where there is any."""


@dataclasses.dataclass(frozen=True)
class Evaluate:
    """Score trained policies on a grid of grounds, without their noise; episodes are seeded, the same for all.

    A folder is that of one run of `rftsim train`, or of several (--seeds), which count together. Several folders give
    one table, a row for each: with --on rigid,sand that of transfer, with a dash where a law cannot have a sand.

    Example: rftsim evaluate out/runner --baseline --plot runner.png
    """

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER ..", help_behavior_hint="")]
    """Folders of `rftsim train`."""
    on: Names = None
    """Grounds; by default all for one folder, and sand,rigid for several."""
    episodes: Count = 20
    """Number of episodes on each ground."""
    seed: Count = 10_000
    """Episode k is seeded with seed + k."""
    baseline: Flag = False
    """Score random actions, too, and the best open loop."""
    plot: File = None
    """Draw the returns, .png, .pdf or .svg."""
    markdown: Flag = False
    """Print the table in Markdown, with the command."""
    threads: Count = 0
    """Threads; 0 for one a processor."""
    ray: Text = None
    """Score on Ray: local, or a cluster's address."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Score the runs on every ground, print the scores and draw them."""
        with needing("train"):
            from rftsim_envs.training import evaluate
            from rftsim_envs.training.folder import Folder
            from rftsim_envs.training.spread import spread
        if not self.runs or not 1 <= self.episodes <= MOST_EPISODES or self.seed < 0:
            raise RftsimError(
                f"evaluate takes at least one folder, 1 to {MOST_EPISODES} episodes, and a seed of zero or more"
            )
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
        runs = {group: evaluate.runs(group) for group in self.runs}
        plans = {group: Folder(own[0]).plan() for group, own in runs.items()}
        default = evaluate.grid(plans[self.runs[0]]) if len(runs) == 1 else ["sand", "rigid"]
        grounds = default if self.on is None else [name.strip() for name in self.on.split(",")]
        for name in grounds:
            if all(evaluate.settings_on(plan, name) is None for plan in plans.values()):
                raise RftsimError(f"{name} has no density, which the law of {', '.join(map(str, runs))} needs")
        jobs = {
            f"{run} on {name}": (run, name, self.episodes, self.seed, self.threads, self.baseline)
            for run, name in itertools.product(itertools.chain(*runs.values()), grounds)
        }
        with needing("ray"), Progress(console=Console(stderr=True), transient=True, disable=is_quiet(self.json)) as bar:
            task = bar.add_task("episodes", total=len(jobs))
            found = spread(evaluate.score, jobs, self.ray, lambda name, scores: bar.advance(task))
        scores = {
            group: evaluate.pooled([one for run in own for name in grounds for one in found[f"{run} on {name}"]])
            for group, own in runs.items()
        }
        names = {group: _name(plans[group], group, len(own)) for group, own in runs.items()}
        if self.plot:
            from rftsim.view.returns import plot_returns

            draw(self.plot, plot_returns, {names[group]: own for group, own in scores.items()})
        self._print(scores, names, grounds)

    def _print(self, scores: "dict[Path, list[Score]]", names: dict[Path, str], grounds: list[str]) -> None:
        if self.json:
            print_json({str(group): [_report(one) for one in own] for group, own in scores.items()})
            return
        if len(scores) == 1:
            ((group, own),) = scores.items()
            title, rows = names[group], _grid(own, self.baseline)
        else:
            title, rows = "return", _transfer(scores, names, grounds)
        if self.markdown:
            lines = [" | ".join(row) for row in rows]
            lines.insert(1, " | ".join(["---"] + ["---:"] * (len(rows[0]) - 1)))
            print("\n".join(f"| {line} |" for line in lines) + f"\n\n    {self._command()}")
            return
        table = make_table(title, rows[0][:1], rows[0][1:], wrap=True)
        for row in rows[1:]:
            table.add_row(*row)
        Console().print(table)
        print_written(Console(), self.plot)

    def _command(self) -> str:
        chosen = f" --on {self.on!r}" if self.on and " " in self.on else f" --on {self.on}" if self.on else ""
        more = (" --baseline" if self.baseline else "") + (
            f" --episodes {self.episodes}" if self.episodes != 20 else ""
        )
        return f"rftsim evaluate {' '.join(map(str, self.runs))}{chosen}{more} --markdown"


def _name(plan: Any, group: Path, runs: int) -> str:
    seeds = f", {runs} runs" if runs > 1 else ""
    from rftsim_envs.tasks import title

    return f"{title(plan.task)} trained on {plan.settings['ground']} ({group.name}{seeds})"


def _spread(one: "Score") -> str:
    return f"{one.mean('r'):.3g} ± {one.std('r'):.2g}"


def _grid(scores: "list[Score]", baseline: bool) -> list[list[str]]:
    measured = [name for name in NUMBERS if not all(math.isnan(one.mean(name)) for one in scores)]
    if not any(one.mean("reached") > 0.0 for one in scores):
        measured.remove("reached")
    rows = [
        ["ground", "return", *(NUMBERS[name] for name in measured), *(["random", "best open loop"] if baseline else [])]
    ]
    for one in scores:
        if one.actor != "policy":
            continue
        numbers = [100.0 * one.mean(name) if name in SHARES else one.mean(name) for name in measured]
        others = {other.actor: other for other in scores if other.ground == one.ground}
        more = [_other(others.get(name)) for name in ("random", "open loop")] if baseline else []
        cells = ["-" if math.isnan(number) else f"{number:.3g}" for number in numbers]
        rows.append([one.ground, _spread(one), *cells, *more])
    return rows


def _other(one: "Score | None") -> str:
    if one is None:
        return "-"
    return f"{one.mean('r'):.3g}" + (f" at {one.which}" if one.which else "")


def _transfer(scores: "dict[Path, list[Score]]", names: dict[Path, str], grounds: list[str]) -> list[list[str]]:
    actors = dict.fromkeys(one.actor for own in scores.values() for one in own)
    rows = [["return", *(f"on {name}" for name in grounds)]]
    for group, own in scores.items():
        for actor in actors:
            by_ground = {one.ground: one for one in own if one.actor == actor}
            name = names[group] if actor == "policy" else f"{names[group].split(' ')[0]}, {actor}"
            rows.append([name, *(_crossed(by_ground[g]) if g in by_ground else "-" for g in grounds)])
    return rows


def _crossed(one: "Score") -> str:
    """The return, and the share of the episodes that ended early in failure, if any did."""
    early = 100.0 * one.mean("early")
    return _spread(one) + (f", {early:.3g} % fail" if early > 0.0 else "")


def _report(one: "Score") -> dict[str, Any]:
    return {
        "ground": one.ground,
        "actor": one.actor,
        "which": one.which,
        "return_mean": one.mean("r"),
        "return_std": one.std("r"),
        "speed_m_s": one.mean("speed"),
        **({} if math.isnan(one.mean("error")) else {"error_m_s": one.mean("error")}),
        "cost_of_transport": one.mean("cost_of_transport"),
        "ended_early": one.mean("early"),
        "episodes": one.episodes,
    }
