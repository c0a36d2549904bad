"""`rftsim train`: a policy for a task on sand."""

import contextlib
import dataclasses
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rftsim.cli.extra import needing
from rftsim.cli.inspect import Settings, settings
from rftsim.cli.output import print_json


@dataclasses.dataclass(frozen=True)
class Train:
    """Train a policy by PPO, on simulations side by side.

    The folder holds config.json, progress.csv, checkpoint.zip and, in the end, policy.zip. A run that was stopped or
    killed goes on from its checkpoint when the same command is given again, with new episodes.

    Example: rftsim train FourFlapRunner --steps 500000 --out out/runner
    """

    env: tyro.conf.Positional[str]
    """rftsim/NAME-v0, or NAME."""
    out: Path
    """Folder of the run."""
    algo: Literal["ppo"] = "ppo"
    """The algorithm."""
    steps: int | None = None
    """Control steps in all; by default the task's. Rounded up to whole steps of all simulations."""
    seed: int = 0
    """Of everything that is drawn."""
    envs: int | None = None
    """Simulations side by side; by default the task's."""
    set: Settings = ()
    """Settings of the task, key=value ...: ground=rigid strength=0.5,2; may be repeated."""
    hyper: Settings = ()
    """Settings of PPO, key=value ...: learning_rate=1e-3 layers=128,128; may be repeated."""
    threads: int = 0
    """Threads of the simulations; 0 for as many as there are processors."""
    tensorboard: bool = False
    """Write for TensorBoard, too, under OUT/tensorboard."""
    json: bool = False
    """Print JSON instead of progress."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Train and report."""
        with needing("train"):
            from rftsim_envs.training import ppo
            from rftsim_envs.training.folder import make_plan
        changes: dict[str, Any] = settings(self.hyper)
        changes |= {"steps": self.steps} if self.steps is not None else {}
        changes |= {"n_envs": self.envs} if self.envs is not None else {}
        plan = make_plan(self.env, settings(self.set), changes, seed=self.seed, algo=self.algo)
        with interruptible() as stop, showing(plan.training.steps, self.json) as report:
            trained = ppo.train(
                plan, self.out, threads=self.threads, tensorboard=self.tensorboard, report=report, stop=stop
            )
        if self.json:
            print_json({"folder": str(self.out), **trained._asdict()})
        else:
            Console().print(
                _said(trained.steps, trained.began, trained.done, self.out), highlight=False, soft_wrap=True
            )
        if not trained.done:
            sys.exit(130)


def _said(steps: int, began: int, done: bool, out: Path) -> str:
    if not done:
        return f"stopped at {steps} steps, saved in {out}: the same command goes on from there"
    if began == steps:
        return f"{out} is finished: {steps} steps"
    resumed = f", resumed at {began}" if began else ""
    return f"trained {steps} steps{resumed}: {out / 'policy.zip'}. Watch it with `rftsim play {out}`"


@contextlib.contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Ctrl-C, once, is a question that the block answers; a second one is KeyboardInterrupt, as ever."""
    asked = False

    def ask(number: int, frame: object) -> None:
        nonlocal asked
        asked = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def showing(steps: int, silent: bool) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """A bar of the training's progress."""
    columns = (
        TextColumn("{task.completed:,} of {task.total:,} steps"),
        BarColumn(),
        TextColumn("return {task.fields[score]}  {task.fields[pace]} steps/s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=Console(stderr=True), disable=silent) as bar:
        task = bar.add_task("training", total=steps, score="-", pace="-")

        def report(row: Mapping[str, Any]) -> None:
            score = f"{float(row['return']):.3g}" if row["return"] else "-"
            pace = f"{float(row['steps_per_second']):,.0f}"
            bar.update(task, completed=int(row["steps"]), score=score, pace=pace)

        yield report
