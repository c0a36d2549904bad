"""`rftsim run`: a shipped scene or somebody's MJCF, on sand."""

import contextlib
import dataclasses
import math
from collections.abc import Callable
from typing import Annotated, Any, Literal

import mujoco
import tyro
from rich.console import Console
from rich.progress import Progress

from rftsim.cli.extra import needing
from rftsim.cli.options import File, Flag, Number
from rftsim.cli.output import is_quiet, print_doubts, print_json, print_written
from rftsim.cli.results import draw
from rftsim.cli.scene import Scene, print_robot, robot_report
from rftsim.files import check_writable, replacing
from rftsim.run.run import SAMPLES, run
from rftsim.run.run import Run as Finished
from rftsim.run.scenes import Staged
from rftsim.view.cameras import SIZE, Follower
from rftsim.view.drawing import Shown
from rftsim.view.film import filming
from rftsim.view.history import plot_history
from rftsim.view.render import Pictures, save_picture


@dataclasses.dataclass(frozen=True)
class Run(Scene):
    """Run a scene on sand, and say how it moves and stands; film it, picture it, record it.

    Speed, sinkage and slip are means over the last 40 %.

    Example: rftsim run grouser-wheel --set rpm=60 --plot wheel.png --record wheel.rrd
    """

    force: Annotated[Literal["implicit", "explicit"], tyro.conf.arg(metavar="HOW", help_behavior_hint="")] = "implicit"
    """implicit, or explicit, which needs short steps."""
    duration: Number = None
    """Simulated time [s]; by default the scene's."""
    timestep: Number = None
    """Time step [s]; by default the scene's."""
    record: File = None
    """Write a Rerun recording, .rrd."""
    plot: File = None
    """Draw the run, .png, .pdf or .svg."""
    picture: File = None
    """Picture of the last moment, .png."""
    video: File = None
    """Film of the run, .mp4."""
    arrows: Flag = True
    """Arrows for forces; this leaves them out."""
    tractions: Flag = False
    """Arrows for tractions, and their scale."""
    buried: Flag = False
    """What is buried shows through the sand."""
    settle: Flag = True
    """Start where the sand carries it; this does not."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Run the scene, draw it, and print its steady state."""
        if self.record:
            check_writable(self.record, ".rrd")
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
        if self.picture:
            check_writable(self.picture, ".png")
        if self.video:
            check_writable(self.video, ".mp4")
            with needing("video"):
                import av  # noqa: F401
        staged = self._stage()
        shown = Shown(self.arrows, self.tractions, self.buried)
        with contextlib.ExitStack() as stack:
            pictures = None
            if self.picture or self.video:
                pictures = stack.enter_context(Pictures(staged.model, shown=shown))  # fails now, or not at all
            finished = self._simulate(staged, pictures)
            draw(self.plot, plot_history, finished.history, f"{self.scene}, {staged.bed.law.name}")
            draw(self.picture, save_picture, pictures, finished.last)
        if self.json:
            print_json(self._report(staged, finished, warnings()))
            return
        console, steady = Console(), finished.steady
        slip = "" if steady.slip is None else f", slip {steady.slip:.3f}"
        law = staged.bed.law.name
        console.print(f"[bold]{self.scene}[/bold], law {law}, {staged.duration:g} s", highlight=False)
        console.print(f"speed {steady.speed:.4g} m/s, sinkage {steady.sinkage:.4g} m{slip}")
        if finished.robot is not None:
            print_robot(console, finished.robot)
        console.print(f"{finished.realtime_factor:.3g} times real time")
        print_doubts(console, finished.doubts)
        print_written(console, self.plot, self.picture, self.video, self.record)

    def _stage(self) -> Staged:
        return self.staged(
            settle=self.settle,
            timestep=self.timestep,
            duration=self.duration,
            force=self.force,
        )

    def _report(self, staged: Staged, finished: Finished, warnings: list[str]) -> dict[str, Any]:
        steady = finished.steady
        return {
            "scene": self.scene,
            "law": staged.bed.law.name,
            "sand": dataclasses.asdict(staged.bed.sand),
            "timestep_s": float(staged.model.opt.timestep),
            "duration_s": staged.duration,
            "speed_m_s": steady.speed,
            "sinkage_m": steady.sinkage,
            "slip": steady.slip,
            "rate_rad_s": steady.rate,
            **(robot_report(finished.robot) if finished.robot is not None else {}),
            "realtime_factor": finished.realtime_factor,
            "choices": staged.bed.choices,
            "warnings": [*warnings, *finished.doubts],
        }

    def _simulate(self, staged: Staged, pictures: Pictures | None) -> Finished:
        samples = min(SAMPLES, math.ceil(staged.duration / staged.model.opt.timestep))
        with Progress(console=Console(stderr=True), transient=True, disable=is_quiet(self.json)) as progress:
            task = progress.add_task(self.scene, total=samples)
            with contextlib.ExitStack() as stack:
                recorder = None
                if self.record is not None:
                    from rftsim.view.record import Recorder  # rerun is an extra

                    recorder = stack.enter_context(Recorder(staged.model, self.record))
                show = None
                if self.video is not None:
                    show = stack.enter_context(filming(stack.enter_context(replacing(self.video)), *SIZE))
                follower = Follower(staged.model)

                def observe(data: mujoco.MjData) -> None:
                    progress.advance(task)
                    if recorder is not None:
                        recorder.log(data)
                    if show is not None and pictures is not None:
                        show(lambda: pictures.take(data, follower.at(data)), data.time)

                return run(staged, observe)
