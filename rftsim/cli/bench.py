"""`rftsim bench`: what rftsim costs, and what that buys."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rftsim.bench import kernel
from rftsim.bench.hard_cases import CASES, Force
from rftsim.bench.stability import FORCES, STEPS, Row, Starts, Study, Summary, run, summarise
from rftsim.cli import costs
from rftsim.cli.output import print_json
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.plots import plot_kernel, plot_stability


@dataclasses.dataclass(frozen=True)
class Bench:
    """Measure rftsim itself.

    stability: the hard cases (rest, light legs, stiff servos, impacts, edges, constraints) at time steps from 0.1 to
    10 ms with the implicit and the explicit force, against the exact or converged answer.

    environment: what sand adds to MuJoCo's step, in one simulation and in 256 side by side.

    pareto: laws, triangles and time steps: what each costs, and how far it is from the finest.

    kernel: the time of a buried triangle by the size of the body, over that of the tests' NumPy, and the share of what
    the processor's arithmetic allows.

    Example: rftsim bench stability --plot out
    """

    study: tyro.conf.Positional[Literal["stability", "kernel", "environment", "pareto"]]
    """What is measured."""
    cases: tuple[str, ...] = ()
    """Names of cases; by default all."""
    starts: int = 1000
    """Random starts of a free runner."""
    quick: bool = False
    """Steps of 1 and 5 ms, 20 random starts; bodies of up to 20,480 triangles; fewer repetitions; one law each."""
    oracle: Path = Path("tests/oracle.py")
    """The tests' laws in NumPy, that kernel compares with where they are there."""
    plot: Path | None = None
    """Folder for the study's picture, NAME.png."""
    memory: Path = Path("out/bench")
    """Folder for what stability and pareto measured: if stopped, they go on from there."""
    json: bool = False
    """Print JSON instead of the tables."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Measure, print and draw."""
        if self.study == "kernel":
            self._kernel()
            return
        if self.study == "environment":
            costs.environment(self.quick, self.plot, self.json)
            return
        if self.study == "pareto":
            costs.pareto(self.quick, self.memory, self.plot, self.json)
            return
        unknown = sorted(set(self.cases) - set(CASES))
        if unknown:
            raise RftsimError(f"no case {unknown[0]!r}; cases are {', '.join(CASES)}")
        if self.starts < 0:
            raise RftsimError(f"starts must be zero or more, not {self.starts}")
        picture = None if self.plot is None else self.plot / "stability.png"
        for folder in (self.memory, self.plot):
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
        for path in (self.memory / "stability.json", picture):
            if path is not None:
                check_writable(path)
        rows, starts = self._measure(Study(self.memory / "stability.json"))
        summary = summarise(rows)
        if picture is not None:
            with replacing(picture) as temporary:
                plot_stability(rows, temporary)
        if self.json:
            print_json(_report(rows, summary, starts))
            return
        console = Console()
        for table in _tables(rows):
            console.print(table)
        _print_summary(console, summary, starts)
        if picture is not None:
            console.print(f"wrote {picture}", highlight=False)

    def _kernel(self) -> None:
        picture = None if self.plot is None else self.plot / "kernel.png"
        if self.plot is not None and picture is not None:
            self.plot.mkdir(parents=True, exist_ok=True)
            check_writable(picture)
        sizes = tuple(size for size in kernel.SIZES if not self.quick or size <= 20480)
        with Progress(console=Console(stderr=True), transient=True, disable=self.json) as bar:
            task = bar.add_task("kernel", total=kernel.ROUNDS + 2)
            limit = kernel.arithmetic()
            bar.advance(task)
            single = kernel.single_precision()
            bar.advance(task)
            costs = kernel.measure(sizes, kernel.load_oracle(self.oracle), lambda _: bar.advance(task))
        power = kernel.exponent(costs)
        if picture is not None:
            with replacing(picture) as temporary:
                plot_kernel(costs, limit, temporary)
        if self.json:
            rows = [
                {
                    "triangles": c.triangles,
                    "ns": c.nanoseconds,
                    "numpy_ratio": _number(c.ratio),
                    "memory": c.memory,
                    "leading": c.leading,
                }
                for c in costs
            ]
            found = {"law": kernel.LAW, "sizes": rows, "exponent": power}
            print_json({**found, "arithmetic": limit._asdict(), "single_precision": single._asdict()})
            return
        console = Console()
        console.print(_kernel_table(costs, limit))
        console.print(
            f"time grows with the {power:.3f}th power of the triangles from {kernel.LINEAR} on; the law's "
            f"{limit.operations:.0f} operations take {limit.nanoseconds:.2f} ns at least, and are spared the "
            f"{100 - 100 * costs[-1].leading:.0f} % of the triangles that do not lead",
            highlight=False,
            soft_wrap=True,
        )
        console.print(
            f"in single precision the loop takes {single.single_nanoseconds:.2f} ns for each of {single.triangles} "
            f"triangles instead of {single.double_nanoseconds:.2f}, and its wrench errs by {single.error:.1g}",
            highlight=False,
            soft_wrap=True,
        )
        if picture is not None:
            console.print(f"wrote {picture}", highlight=False)

    def _measure(self, study: Study) -> tuple[list[Row], Starts]:
        names, steps = self.cases or tuple(CASES), (1e-3, 5e-3) if self.quick else STEPS
        count = min(self.starts, 20) if self.quick else self.starts
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        console = Console(stderr=True)
        total = len(names) * (1 + len(FORCES) * len(steps)) + count
        with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=self.json) as bar:
            task = bar.add_task("stability", total=total)
            rows = run(study, names, steps, lambda name: bar.update(task, advance=1, description=name))
            bar.update(task, description="random starts")
            starts = study.starts(count, lambda: bar.advance(task))
        return rows, starts


def _kernel_table(costs: list[kernel.Cost], limit: kernel.Arithmetic) -> Table:
    table = Table()
    for heading in ("triangles", "body [µs]", "each [ns]", "of the limit", "NumPy's time", "memory"):
        table.add_column(escape(heading), justify="right")
    for cost in costs:
        table.add_row(
            f"{cost.triangles}",
            f"{1e6 * cost.seconds:.3g}",
            f"{cost.nanoseconds:.2f}",
            f"{100 * limit.nanoseconds / cost.nanoseconds:.0f} %",
            "-" if math.isnan(cost.ratio) else f"× {cost.ratio:.0f}",
            f"× {cost.memory:.2f}",
        )
    return table


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _percent(value: float) -> str:
    if math.isnan(value):
        return "-"
    if value > 9.995:
        return "lost"
    return f"{100 * value:.2f}" if value < 0.0995 else f"{100 * value:.0f}"


def _tables(rows: list[Row]) -> list[Table]:
    steps = sorted({h for row in rows for _, h in row.played})

    def table(title: str, cell: Callable[[Row, float], str]) -> Table:
        found = Table(title=title, title_justify="left")
        found.add_column("case", no_wrap=True)
        for h in steps:
            found.add_column(f"{1e3 * h:g} ms", justify="right", no_wrap=True)
        for row in rows:
            found.add_row(row.case, *(cell(row, h) for h in steps))
        return found

    def rest(row: Row, h: float) -> str:
        value = row.verdicts["implicit", h].rest
        return "-" if math.isnan(value) else f"{value:.2g}"

    def work(row: Row, h: float) -> str:
        return f"{row.played['implicit', h].evaluations:.2f}"

    def error(force: Force) -> Callable[[Row, float], str]:
        return lambda row, h: _percent(row.verdicts[force, h].error)

    return [
        *(table(f"error [%] of the {force} force", error(force)) for force in FORCES),
        table("implicit force: what ought to be zero, over its limit", rest),
        table("implicit force: evaluations per step", work),
    ]


def _print_summary(console: Console, summary: Summary, starts: Starts) -> None:
    def listed(values: dict[float, float], scale: float = 1.0) -> str:
        return ", ".join(f"{scale * value:.3g} at {1e3 * h:g} ms" for h, value in values.items())

    for line in (
        f"evaluations per step, mean over the cases: {listed(summary.evaluations)}",
        f"derivatives per step (each about 3.5 evaluations): {listed(summary.jacobians)}",
        *(f"median error [%], {force}: {listed(error, 100)}" for force, error in summary.error.items()),
        f"a second at 5 ms implicit costs {summary.cost_ratio:.2f} of one at 1 ms explicit in the median, and is "
        f"nearer to the truth in {summary.nearer[0]} of {summary.nearer[1]} cases",
        f"{starts.starts} random starts at 5 ms: {starts.failed} lost, largest work of the sand in a step "
        f"{starts.gain:.2g} J, {starts.evaluations:.2f} evaluations and {starts.jacobians:.2f} derivatives per step, "
        f"{starts.unsolved} unsolved",
    ):
        console.print(line, highlight=False, soft_wrap=True)


def _report(rows: list[Row], summary: Summary, starts: Starts) -> dict[str, object]:
    return {
        "cases": [
            {
                "case": row.case,
                "says": row.says,
                "expected": row.expected,
                "played": [
                    played._asdict() | row.verdicts[force, h]._asdict() for (force, h), played in row.played.items()
                ],
            }
            for row in rows
        ],
        "summary": {
            "evaluations": summary.evaluations,
            "jacobians": summary.jacobians,
            "median_error": summary.error,
            "cost_ratio_implicit_5ms_explicit_1ms": summary.cost_ratio,
            "nearer_of": list(summary.nearer),
        },
        "random_starts": starts._asdict(),
    }
