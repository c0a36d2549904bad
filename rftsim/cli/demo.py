"""`rftsim demo`: wheel and runner over their rates, which `make demo` runs."""

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rftsim.cli.options import Count, Flag, Kept
from rftsim.cli.output import print_json, print_line, progress
from rftsim.cli.results import draw, picture_in
from rftsim.errors import RftsimError
from rftsim.run.rate_sweep import LAWS, RATES, Point, measure_all, points
from rftsim.run.run import run
from rftsim.run.scenes import stage
from rftsim.view.rates import plot_rates


@dataclasses.dataclass(frozen=True)
class Demo:
    """The grousered wheel and the four-flap runner over their rates under four laws: a table, a plot, a recording.

    Example: rftsim demo --out out/demo
    """

    out: Kept = Path("out/demo")
    """Folder for demo.png and grouser-wheel.rrd."""
    processes: Count = os.cpu_count() or 1
    """Runs that are simulated at a time."""
    json: Flag = False
    """Print JSON instead of the table."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Run every point, print and draw them, and record the wheel."""
        if self.processes < 1:
            raise RftsimError(f"processes must be at least 1, not {self.processes}")
        picture, recording = picture_in(self.out, "demo"), self.out / "grouser-wheel.rrd"
        with progress("wheel and runner on sand", len(points()), self.json) as report:
            found = measure_all(self.processes, lambda point: report("wheel and runner on sand"))
        draw(picture, plot_rates, found)
        staged = stage("grouser-wheel", settings={"rpm": "60"}, duration=2.0)
        from rftsim.view.record import Recorder  # rerun is an extra

        with Recorder(staged.model, recording) as recorder:
            run(staged, recorder.log)
        if self.json:
            print_json([point._asdict() for point in found])
            return
        console = Console()
        for scene in RATES:
            console.print(_table(scene, [point for point in found if point.scene == scene]))
        print_line(console, f"wrote {picture} and {recording}: open the recording with `rerun {recording}`")


def _table(scene: str, found: list[Point]) -> Table:
    table = Table(title=scene)
    for name in ("law", "rpm", "v/√(gℓ)", "sinkage/ℓ", "slip", "times real time"):
        table.add_column(name, justify="left" if name == "law" else "right")
    for law in LAWS:
        for point in found:
            if point.law == law:
                numbers = (point.speed, point.sinkage, point.slip)
                cells = [f"{number:.3f}" for number in numbers]
                table.add_row(law, f"{point.rpm:g}", *cells, f"{point.realtime_factor:.0f}")
        table.add_section()
    return table
