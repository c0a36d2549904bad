"""What the commands that run a study share: a bar, a picture, a recording, and JSON."""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from rftsim_mpm.cli.report import print_json, progress
from rftsim_mpm.output import check_writable, replacing
from rftsim_mpm.simulation import Simulation

Watch = Callable[[Simulation, float], None]


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Where results go."""

    quick: bool = False
    """Coarser and shorter: a look, not a measurement."""
    json: bool = False
    """Print JSON."""
    plot: Path | None = None
    """Draw the result, .png, .pdf or .svg."""
    record: Path | None = None
    """Write a Rerun recording of the first run, .rrd."""

    def check(self) -> None:
        """Refuse what cannot be written, before anything runs."""
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
        if self.record:
            check_writable(self.record, ".rrd")

    @contextlib.contextmanager
    def watching(self, title: str) -> Iterator[Watch]:
        """A bar with the time left, and the recording."""
        with contextlib.ExitStack() as stack:
            show = stack.enter_context(progress(title, quiet=self.json))
            recorder: Any = None
            if self.record:
                from rftsim_mpm.record import Recorder  # rerun is an extra

                recorder = Recorder(self.record)
                stack.callback(recorder.close)
            first: list[Simulation] = []

            def watch(sim: Simulation, share: float) -> None:
                if not first:
                    first.append(sim)
                if sim.steps % 20 == 0:
                    show(share)
                if recorder is not None and sim is first[0]:
                    recorder.log(sim)

            yield watch

    def finish(self, report: dict[str, Any], lines: list[str], draw: Callable[[Path], None]) -> None:
        """Draw, and print."""
        if self.plot:
            with replacing(self.plot) as temporary:
                draw(temporary)
        if self.json:
            print_json(report)
            return
        console = Console(highlight=False, soft_wrap=True)
        for line in lines:
            console.print(line)
        for path in (self.plot, self.record):
            if path:
                console.print(f"wrote {path}")
