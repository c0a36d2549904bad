"""`rftsim validate`: the laws against what is published, computed elsewhere, or measured."""

import dataclasses
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rftsim.cli.output import print_json
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.validation.measured import DATA
from rftsim.validation.study import Request, Row
from rftsim.view.plots import plot_study

if TYPE_CHECKING:
    from rftsim.validation.studies import Found

MARKS = {True: "pass", False: "FAIL", None: "-"}


@dataclasses.dataclass(frozen=True)
class Validate:
    """Compare the laws with published trends, other programs, exact relations and measured data.

    Prints a row for each quantity: expected, got, error, source. What was measured is remembered; a run that was
    stopped goes on from there. Ends with exit code 1 where a row fails.

    Example: rftsim validate --quick --plot out
    """

    studies: tyro.conf.Positional[tuple[str, ...]] = ()
    """Names of studies; by default all."""
    quick: bool = False
    """Fewer rates; some minutes for all studies."""
    data: Path | None = None
    """Folder of measured data: cmu_wheel_grouser.csv, cmu_circular_plate_sinkage.csv; by default ../shared/data/cmu,
    where there is one."""
    plot: Path | None = None
    """Folder for the figures, STUDY.png."""
    memory: Path = Path("out/validate")
    """Folder for what was measured."""
    markdown: bool = False
    """Print one table in Markdown, with the command."""
    json: bool = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Measure, print and draw."""
        from rftsim.validation.studies import choose  # which takes the continuum, and that numba

        names = choose(self.studies)
        if self.json and self.markdown:
            raise RftsimError("--json and --markdown exclude one another: give one")
        if self.data is not None and not self.data.is_dir():
            raise RftsimError(f"no folder {self.data} of measured data")
        pictures = {} if self.plot is None else {name: self.plot / f"{name}.png" for name in names}
        for folder in (self.memory, self.plot):
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
        for path in (*pictures.values(), *(self.memory / f"{name}.json" for name in names)):
            check_writable(path)
        found = self._measure(names)
        for one in found:
            if one.name in pictures:
                with replacing(pictures[one.name]) as temporary:
                    plot_study(one.study, one.measured, temporary)
        if self.json:
            print_json({one.name: [_report(row) for row in one.rows] for one in found})
        elif self.markdown:
            print("\n".join(_markdown(found)) + f"\n\n    {self._command()}")
        else:
            _print(found, pictures)
        if any(row.passed is False for one in found for row in one.rows):
            sys.exit(1)

    def _measure(self, names: list[str]) -> "list[Found]":
        from rftsim.validation.studies import STUDIES, run

        request = Request(self.quick, self.data or DATA)
        total = sum(len(STUDIES[name].jobs(request)) for name in names)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        console = Console(stderr=True)
        with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=self.json) as bar:
            task = bar.add_task("validate", total=total)
            return list(run(names, request, self.memory, lambda job: bar.update(task, advance=1, description=job)))

    def _command(self) -> str:
        return " ".join(["rftsim validate", *self.studies, *(["--quick"] if self.quick else []), "--markdown"])


def _number(value: float) -> str:
    return "0" if abs(value) < 1e-9 else f"{value:.4g}"


def _wanted(row: Row) -> str:
    if row.expected is not None:
        within = row.high - row.expected
        return _number(row.expected) + (f" ± {within:.2g}" if math.isfinite(within) else "")
    if math.isfinite(row.low):
        return f"≥ {_number(row.low)}"
    return f"≤ {_number(row.high)}" if math.isfinite(row.high) else "-"


def _cells(row: Row) -> list[str]:
    """Quantity, expected, got, error, verdict, source."""
    what = row.what + (f" [{row.unit}]" if row.unit != "-" else "")
    got = "-" if row.got is None else _number(row.got)
    error = "-" if row.error is None else f"{round(100 * row.error, 2) + 0.0:+.2f} %"
    return [what, _wanted(row), got, error, MARKS[row.passed], row.source + (f"; {row.note}" if row.note else "")]


HEADER = ("quantity", "expected", "got", "error", "verdict", "source")


def _print(found: "list[Found]", pictures: dict[str, Path]) -> None:
    console = Console()
    for one in found:
        table = Table(title=f"{one.name}: {escape(one.study.says)}", title_justify="left")
        for name in HEADER:
            numeric = name in ("expected", "got", "error")
            table.add_column(name, justify="right" if numeric else "left", no_wrap=numeric or name == "verdict")
        for row in one.rows:
            style = {True: "", False: "bold red", None: "dim"}[row.passed]
            table.add_row(*map(escape, _cells(row)), style=style)
        console.print(table)
    rows = [row for one in found for row in one.rows]
    failed = [f"{one.name}: {row.what}" for one in found for row in one.rows if row.passed is False]
    judged = sum(row.passed is not None for row in rows)
    console.print(f"{judged - len(failed)} of {judged} rows pass", highlight=False)
    for text in failed:
        console.print(f"[bold red]FAIL[/bold red] {escape(text)}", highlight=False, soft_wrap=True)
    if pictures:
        console.print(f"wrote {', '.join(map(str, pictures.values()))}", highlight=False, soft_wrap=True)


def _markdown(found: "list[Found]") -> list[str]:
    lines = [("study", *HEADER), ("---", "---", "---:", "---:", "---:", "---", "---")]
    for one in found:
        for k, row in enumerate(one.rows):
            cells = _cells(row)
            cells[4] = "**FAIL**" if row.passed is False else cells[4]
            lines.append((one.name if k == 0 else "", *cells))  # type: ignore[arg-type]
    return [f"| {' | '.join(line)} |" for line in lines]


def _report(row: Row) -> dict[str, Any]:
    bounds = {name: value if math.isfinite(value) else None for name, value in (("low", row.low), ("high", row.high))}
    return dataclasses.asdict(row) | bounds | {"error": row.error, "passed": row.passed}
