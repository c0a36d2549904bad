"""`rftsim demo`: what `make demo` runs."""

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rftsim.cli.output import print_json
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.run.rates import LAWS, RATES, Point, measure_all, points
from rftsim.run.run import run
from rftsim.run.scenes import stage
from rftsim.view.plots import plot_demo


@dataclasses.dataclass(frozen=True)
class Demo:
    """The grousered wheel and the four-flap runner over their rates under four laws: a table, a plot, a recording.

    Example: rftsim demo --out out/demo
    """

    out: Path = Path("out/demo")
    """Folder for demo.png and grouser-wheel.rrd."""
    processes: int = os.cpu_count() or 1
    """Runs at a time."""
    json: bool = False
    """Print JSON instead of the table."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Run, print, draw and record."""
        if self.processes < 1:
            raise RftsimError(f"processes must be at least 1, not {self.processes}")
        try:
            self.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RftsimError(f"cannot make the folder {self.out}: {error.strerror}") from error
        plot, recording = self.out / "demo.png", self.out / "grouser-wheel.rrd"
        check_writable(plot)
        found = self._measure()
        with replacing(plot) as temporary:
            plot_demo(found, temporary)
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
        console.print(f"wrote {plot} and {recording}: open the recording with `rerun {recording}`", highlight=False)

    def _measure(self) -> list[Point]:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        console = Console(stderr=True)
        with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=self.json) as bar:
            task = bar.add_task("wheel and runner on sand", total=len(points()))
            return measure_all(self.processes, lambda point: bar.advance(task))


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
