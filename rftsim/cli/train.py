"""`rftsim train`: a policy for a task on sand."""

import contextlib
import dataclasses
import math
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rftsim.cli.extra import needing
from rftsim.cli.options import Count, Flag, Names, Number, Text, Whole
from rftsim.cli.output import is_quiet, print_json, print_line
from rftsim.cli.settings import Settings, read_settings
from rftsim.errors import RftsimError

if TYPE_CHECKING:
    from rftsim_envs.training.folder import Plan
    from rftsim_envs.training.ppo import Trained
    from rftsim_envs.training.shows import Shows


@dataclasses.dataclass(frozen=True)
class Train:
    """Train a policy by PPO, on simulations side by side.

    The folder holds config.json, progress.csv, checkpoint.zip and, in the end, policy.zip. A run that was stopped or
    killed goes on from its checkpoint when the same command is given again, with new episodes.

    Example: rftsim train FourFlapRunner --steps 500000 --out out/runner

    A robot of one's own: rftsim train Locomotion --set model=unitree_go1/scene.xml --out out/go1
    """

    env: tyro.conf.Positional[str]
    """rftsim/NAME-v0, NAME, or FILE.py:CLASS; Locomotion takes a robot of one's own: --set model=PATH."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
    """Folder of the run."""
    algo: Annotated[Literal["ppo"], tyro.conf.arg(metavar="NAME")] = "ppo"
    """Algorithm that the policy is trained by."""
    steps: Whole = None
    """Control steps in all; by default the task's."""
    seed: Count = 0
    """Seed of everything that is drawn at random."""
    envs: Whole = None
    """Simulations side by side; by default the task's."""
    set: Settings = ()
    """Of the task: ground=rigid strength=0.5,2."""
    hyper: Settings = ()
    """Of PPO: learning_rate=1e-3 layers=128,128; physics=warp on a GPU."""
    threads: Count = 0
    """Threads; 0 for one a processor."""
    tensorboard: Flag = False
    """Write for TensorBoard, too, under OUT/tensorboard."""
    watch: Number = None
    """Record an episode for Rerun each so many seconds, and at the end, to OUT/watch."""
    seeds: Names = None
    """Several runs, 0,1,2: each in OUT/seed-N, and OUT/returns.png over all of them."""
    vary: Settings = ()
    """Several runs, in OUT/key=value/seed-N: settings with each value, ground=sand ground=rigid."""
    ray: Text = None
    """Train the runs on Ray: local, or a cluster's address."""
    json: Flag = False
    """Print JSON instead of progress."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Train one run or several, and say what came of each."""
        with needing("train"):
            from rftsim_envs.training.campaign import make_plans
            from rftsim_envs.training.folder import make_plan
        if self.tensorboard:
            with needing("tensorboard"):
                import tensorboard  # noqa: F401
        if self.watch is not None and not (math.isfinite(self.watch) and self.watch >= 0.0):
            raise RftsimError(f"watch takes seconds, zero or more, not {self.watch:g}")
        changes: dict[str, Any] = read_settings(self.hyper)
        changes |= {"steps": self.steps} if self.steps is not None else {}
        changes |= {"n_envs": self.envs} if self.envs is not None else {}
        given = read_settings(self.set)
        alone = self.seeds is None and not self.vary and self.ray is None
        if alone:
            plans = {"": make_plan(self.env, given, changes, seed=self.seed, algo=self.algo)}
        else:
            seeds = _seeds(self.seeds or str(self.seed))
            plans = make_plans(self.env, given, changes, seeds=seeds, vary=_values(self.vary), algo=self.algo)
        found = self._train_here(plans) if self.ray is None else self._train_on_ray(plans, self.ray)
        if self.json:
            print_json({str(self.out / name): trained._asdict() for name, trained in found.items()})
        else:
            for name, one in found.items():
                print_line(Console(), _said(*one, self.out / name))
        if not alone:
            from rftsim_envs.tasks import title

            from rftsim.cli.sweep import show_sweep

            show_sweep(title(next(iter(plans.values())).task), self.out, found, self.json)
        if not all(one.done for one in found.values()):
            sys.exit(130)

    def _train_here(self, plans: "dict[str, Plan]") -> "dict[str, Trained]":
        found = {}
        with interruptible() as stop:
            for name, plan in plans.items():
                found[name] = self._train_one(name, plan, stop)
                if stop():
                    break
        return found

    def _train_one(self, name: str, plan: "Plan", stop: Callable[[], bool]) -> "Trained":
        from rftsim_envs.tasks import title
        from rftsim_envs.training.ppo import train

        out = self.out / name
        shows = self._shows(plan, out)
        with showing(name or title(plan.task), plan.training.steps, self.json) as report:

            def reports(row: Mapping[str, Any]) -> None:
                report(row)
                if shows:
                    shows(row)

            trained = train(plan, out, threads=self.threads, tensorboard=self.tensorboard, report=reports, stop=stop)
        if shows and trained.done:
            shows.record(trained.steps)
        return trained

    def _shows(self, plan: "Plan", out: Path) -> "Shows | None":
        """Whoever records the policy while it is trained, if that was asked for and is still to be trained."""
        from rftsim_envs.training.folder import Folder

        if self.watch is None or Folder(out).done:
            return None
        with needing("rerun"):
            from rftsim_envs.training.shows import Shows
        return Shows(plan, out, self.watch)

    def _train_on_ray(self, plans: "dict[str, Plan]", address: str) -> "dict[str, Trained]":
        if self.tensorboard or self.threads or self.watch is not None:
            raise RftsimError("runs on Ray have one thread each, do not write for TensorBoard and are not watched")
        from rftsim_envs.training.campaign import train_all

        with needing("ray"), Progress(console=Console(stderr=True), disable=is_quiet(self.json)) as bar:
            task = bar.add_task("runs", total=len(plans))
            return train_all(plans, self.out, address, lambda name, trained: bar.advance(task))


def _seeds(text: str) -> list[int]:
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise RftsimError(f"--seeds takes whole numbers with commas between them, not {text!r}") from None


def _values(groups: Settings) -> dict[str, list[str]]:
    """The values of each key in `key=value` words, in which a key may come again."""
    found: dict[str, list[str]] = {}
    for word in (word for group in groups for word in group):
        ((key, value),) = read_settings(((word,),)).items()
        found.setdefault(key, []).append(value)
    return found


def _said(steps: int, began: int, done: bool, out: Path) -> str:
    if not done:
        return f"stopped at {steps} steps, saved in {out}: the same command goes on from there"
    if began == steps:
        return f"{out} is finished: {steps} steps"
    resumed = f", resumed at {began}" if began else ""
    return f"trained {steps} steps{resumed}: {out / 'policy.zip'}. Watch it with `rftsim play {out}`"


@contextlib.contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Make the first Ctrl-C, or SIGTERM, a question that the block answers; a second one ends it, as ever."""
    asked, numbers = False, (signal.SIGINT, signal.SIGTERM)

    def ask(number: int, frame: object) -> None:
        nonlocal asked
        asked = True
        signal.signal(number, before[signal.Signals(number)])

    before = {number: signal.signal(number, ask) for number in numbers}
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def showing(name: str, steps: int, silent: bool) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Show a bar of the training; the function that it gives is called with each row of progress.csv."""
    columns = (
        TextColumn("{task.description}"),
        TextColumn("{task.completed:,} of {task.total:,} steps"),
        BarColumn(),
        TextColumn("return {task.fields[score]}  {task.fields[pace]} steps/s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=Console(stderr=True), disable=is_quiet(silent)) as bar:
        task = bar.add_task(name, total=steps, score="-", pace="-")

        def report(row: Mapping[str, Any]) -> None:
            score = f"{float(row['return']):.3g}" if row["return"] else "-"
            pace = f"{float(row['steps_per_second']):,.0f}"
            bar.update(task, completed=int(row["steps"]), score=score, pace=pace)

        yield report
