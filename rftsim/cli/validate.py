"""`rftsim validate`: the laws against what is published, computed elsewhere, or measured."""

import dataclasses
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rftsim.cli.options import Flag, Folder, Kept
from rftsim.cli.output import print_json, print_line, progress
from rftsim.cli.results import draw, picture_in, remembered_in
from rftsim.errors import RftsimError
from rftsim.validation.cmu import FILES
from rftsim.validation.measured import DATA
from rftsim.validation.study import Request, Row, plot_study

if TYPE_CHECKING:
    from rftsim.validation.studies import Finished

MARKS = {True: "pass", False: "FAIL", None: "-"}
"""Words for whether a row passes."""


@dataclasses.dataclass(frozen=True)
class Validate:
    """Compare the laws with published trends, other programs, exact relations and measured data.

    Prints a row for each quantity: expected, got, error, source. What was measured is remembered; a run that was
    stopped goes on from there. Ends with exit code 1 where a row fails.

    Example: rftsim validate --quick --plot out
    """

    studies: Annotated[
        tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="STUDY ..", help_behavior_hint="")
    ] = ()
    """Names of studies; by default all."""
    quick: Flag = False
    """Fewer rates; some minutes for all studies."""
    data: Folder = None
    """Measured data: cmu_wheel_grouser.csv, cmu_circular_plate_sinkage.csv; by default ../shared/data/cmu."""
    plot: Folder = None
    """Folder for the figures, STUDY.png."""
    memory: Kept = Path("out/validate")
    """Folder for what was measured."""
    markdown: Flag = False
    """Print one table in Markdown, with the command."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Measure the studies, print their tables and draw their figures."""
        from rftsim.validation.studies import choose  # which takes the continuum, and that numba

        names = choose(self.studies)
        if self.json and self.markdown:
            raise RftsimError("--json and --markdown exclude one another: give one")
        if self.data is not None and not self.data.is_dir():
            raise RftsimError(f"no folder {self.data} of measured data")
        if self.data is not None and not any((self.data / name).is_file() for name in FILES):
            raise RftsimError(f"{self.data} has no measured data: it needs one or more of {', '.join(FILES)}")
        pictures = [picture_in(self.plot, name) for name in names]
        for name in names:
            remembered_in(self.memory, name)
        found = self._measure(names)
        for picture, one in zip(pictures, found, strict=True):
            draw(picture, plot_study, one.study, one.measured)
        if self.json:
            print_json({one.name: [_report(row) for row in one.rows] for one in found})
        elif self.markdown:
            print("\n".join(_markdown(found)) + f"\n\n    {self._command()}")
        else:
            _print(found, [path for path in pictures if path is not None])
        if any(row.passed is False for one in found for row in one.rows):
            sys.exit(1)

    def _measure(self, names: list[str]) -> "list[Finished]":
        from rftsim.validation.studies import STUDIES, run

        request = Request(self.quick, self.data or DATA)
        total = sum(len(STUDIES[name].jobs(request)) for name in names)
        with progress("validate", total, self.json) as report:
            return list(run(names, request, self.memory, report))

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
    """A row's cells, in the order of HEADER."""
    what = row.what + (f" [{row.unit}]" if row.unit != "-" else "")
    got = "-" if row.got is None else _number(row.got)
    error = "-" if row.error is None else f"{round(100 * row.error, 2) + 0.0:+.2f} %"
    return [what, _wanted(row), got, error, MARKS[row.passed], row.source + (f"; {row.note}" if row.note else "")]


HEADER = ("quantity", "expected", "got", "error", "verdict", "source")
"""Headings of the tables."""


def _print(found: "list[Finished]", pictures: list[Path]) -> None:
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
    passing = f"{judged - len(failed)} of {judged} rows pass"
    print_line(console, passing if judged else "no row could be judged: nothing was compared")
    for text in failed:
        print_line(console, f"[bold red]FAIL[/bold red] {escape(text)}")
    if pictures:
        print_line(console, f"wrote {', '.join(map(str, pictures))}")


def _markdown(found: "list[Finished]") -> list[str]:
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
