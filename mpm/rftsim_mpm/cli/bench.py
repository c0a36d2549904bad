"""The command `rftsim-mpm bench`, which measures throughput."""

import dataclasses

from rich.console import Console
from rich.table import Table

from rftsim_mpm.bench import throughput, together
from rftsim_mpm.cli.options import Flag
from rftsim_mpm.cli.report import print_json
from rftsim_mpm.errors import MpmError


@dataclasses.dataclass(frozen=True)
class Bench:
    """Particle-updates per second in the plane and in space, and what a second process adds.

    Example: rftsim-mpm bench
    """

    processes: int = 2
    """Run this many at a time, against one; 1 leaves that out."""
    quick: Flag = False
    """Fewer particles and repetitions; one process."""
    json: Flag = False
    """Print JSON instead of a table."""

    def __call__(self) -> None:
        """Measure, and print a table or JSON."""
        if self.processes < 1:
            raise MpmError(f"processes must be at least 1, not {self.processes}")
        report = {}
        table = Table("dimensions", "particles", "million particle-updates/s", title="one thread, float64")
        for dim in (2, 3):
            found = throughput(dim, repetitions=1 if self.quick else 5, small=self.quick)
            report[f"{dim}d"] = {"particles": found.particles, "updates_per_s": found.updates_per_s}
            table.add_row(str(dim), f"{found.particles}", f"{1e-6 * found.updates_per_s:.2f}")
        if self.processes > 1 and not self.quick:
            one, several = (together(2, n) for n in (1, self.processes))
            report["processes"] = {"count": self.processes, "one": one, "together": several, "ratio": several / one}
            table.add_row("2", f"{self.processes} processes", f"{1e-6 * several:.2f} ({several / one:.2f} times one)")
        if self.json:
            print_json(report)
        else:
            Console().print(table)
