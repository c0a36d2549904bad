"""`rftsim view`: a robot live on sand, in MuJoCo's viewer."""

import dataclasses
import functools
import math
from collections.abc import Callable

from rich.console import Console

from rftsim.cli.options import Flag, Number
from rftsim.cli.output import print_line
from rftsim.cli.scene import Scene
from rftsim.errors import RftsimError
from rftsim.run.start import begin
from rftsim.view.live import KEYS, Live, watch


@dataclasses.dataclass(frozen=True)
class View(Scene):
    """Watch a scene on sand live, its controls held: push it with the mouse, and make the sand stronger or weaker.

    Example: rftsim view robot.xml --sand poppy-seeds
    """

    settle: Flag = True
    """Start where the sand carries it; this does not."""
    timestep: Number = None
    """Time step [s]; by default the scene's."""
    seconds: Number = None
    """Time after which the window closes [s]."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Open the window, and go on until it is closed."""
        if self.seconds is not None and not 0.0 < self.seconds < math.inf:
            raise RftsimError(f"seconds must be positive, not {self.seconds:g}")
        staged = self.staged(settle=self.settle, timestep=self.timestep)
        print_keys(Console())
        watch(Live(staged.model, functools.partial(begin, staged)), self.seconds)


def print_keys(console: Console) -> None:
    """Say what the keys do in a live view, each on a line of its own."""
    for key, does in KEYS:
        print_line(console, f"{key}: {does}")
