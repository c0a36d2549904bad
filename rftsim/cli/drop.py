"""`rftsim drop`: let a robot settle in sand, and keep the pose in which it stands."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from rich.console import Console
from rich.progress import Progress

from rftsim.cli.options import Amount, Flag, Number, Output
from rftsim.cli.output import is_quiet, print_doubts, print_json, print_line, print_written
from rftsim.cli.scene import Scene, print_robot, robot_report
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.run.drop import Settled, drop, keyframe
from rftsim.run.scenes import Staged


@dataclasses.dataclass(frozen=True)
class Drop(Scene):
    """Let a robot settle in sand, its controls held, until it rests; print its pose as a keyframe, or write it.

    It starts just above where the sand would carry it in the pose of its keyframe. Where the keyframe has no controls,
    servos of position hold the pose.

    Example: rftsim drop robot.xml --sand poppy-seeds -o settled.xml
    """

    output: Output = None
    """Keyframe for <include>, .xml, or arrays, .npz."""
    limit: Amount = 10.0
    """Simulated time at most [s]."""
    timestep: Number = None
    """Time step [s]; by default the model's."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Drop the robot, and print where it came to rest."""
        if not 0.0 < self.limit < math.inf:
            raise RftsimError(f"the limit must be positive, not {self.limit:g} s")
        if self.output:
            check_writable(self.output, ".xml", ".npz")
        staged = self.staged(timestep=self.timestep, duration=self.limit)
        settled = self._settle(staged)
        if self.output:
            _write(settled, self.output)
        doubts = settled.doubts()
        if self.json:
            report = {"scene": self.scene, "rests": settled.rests, "time_s": settled.data.time}
            state = {"qpos": settled.data.qpos.tolist(), "ctrl": settled.data.ctrl.tolist()}
            print_json(
                report
                | robot_report(settled.robot)
                | state
                | {"choices": staged.bed.choices, "warnings": [*warnings(), *doubts]}
            )
            return
        console = Console()
        if settled.rests:
            print_line(console, f"rests after {settled.data.time:.2f} s")
        print_robot(console, settled.robot)
        print_doubts(console, doubts)
        if self.output is None:
            print(keyframe(settled))
        print_written(console, self.output)

    def _settle(self, staged: Staged) -> Settled:
        with Progress(console=Console(stderr=True), transient=True, disable=is_quiet(self.json)) as progress:
            task = progress.add_task(self.scene, total=self.limit)

            def observe(data: mujoco.MjData) -> None:
                progress.update(task, completed=data.time)

            return drop(staged, self.limit, observe)


def _write(settled: Settled, path: Path) -> None:
    """Write a settled state, whole or not at all."""
    data = settled.data
    with replacing(path) as temporary:
        if path.suffix.lower() == ".xml":
            temporary.write_text(f"<mujocoinclude>\n{keyframe(settled)}\n</mujocoinclude>\n")
        else:
            np.savez(temporary, qpos=data.qpos, qvel=data.qvel, ctrl=data.ctrl, act=data.act)
