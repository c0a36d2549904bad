"""`rftsim bench stability`: its tables, picture and JSON."""

import math
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rftsim.bench.hard_cases import CASES
from rftsim.bench.stability import FORCES, STEPS, Row, Starts, Study, Summary, run, summarise
from rftsim.bench.stability_picture import plot_stability
from rftsim.bench.trials import Force
from rftsim.cli.output import make_table, print_json, print_line, print_written, progress
from rftsim.cli.results import draw, picture_in, remembered_in
from rftsim.errors import RftsimError


def play_hard_cases(
    cases: tuple[str, ...], starts: int, quick: bool, memory: Path, plot: Path | None, json: bool
) -> None:
    """Play the hard cases and the random starts, print what came of them, and draw it.

    Raises:
        RftsimError: There is no such case, or the number of starts is negative.
    """
    unknown = sorted(set(cases) - set(CASES))
    if unknown:
        raise RftsimError(f"no case {unknown[0]!r}; cases are {', '.join(CASES)}")
    if starts < 0:
        raise RftsimError(f"starts must be zero or more, not {starts}")
    picture, study = picture_in(plot, "stability"), Study(remembered_in(memory, "stability"))
    names, steps = cases or tuple(CASES), (1e-3, 5e-3) if quick else STEPS
    count = min(starts, 20) if quick else starts
    with progress("stability", len(names) * (1 + len(FORCES) * len(steps)) + count, json) as report:
        rows = run(study, names, steps, report)
        thrown = study.starts(count, lambda: report("random starts"))
    summary = summarise(rows)
    draw(picture, plot_stability, rows)
    if json:
        print_json(_report(rows, summary, thrown))
        return
    console = Console()
    for table in _tables(rows):
        console.print(table)
    _print_summary(console, summary, thrown)
    print_written(console, picture)


def _percent(value: float) -> str:
    """An error in percent; a dash where there is none, `lost` where it is tenfold."""
    if math.isnan(value):
        return "-"
    if value > 9.995:
        return "lost"
    return f"{100 * value:.2f}" if value < 0.0995 else f"{100 * value:.0f}"


def _tables(rows: list[Row]) -> list[Table]:
    steps = sorted({h for row in rows for _, h in row.played})

    def table(title: str, cell: Callable[[Row, float], str]) -> Table:
        found = make_table(title, ("case",), [f"{1e3 * h:g} ms" for h in steps])
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
        f"derivatives per step (each about 3.5 evaluations): {listed(summary.derivatives)}",
        *(f"median error [%], {force}: {listed(error, 100)}" for force, error in summary.error.items()),
        f"a second at 5 ms implicit costs {summary.cost_ratio:.2f} of one at 1 ms explicit in the median, and is "
        f"nearer to the truth in {summary.nearer[0]} of {summary.nearer[1]} cases",
        f"{starts.starts} random starts at 5 ms: {starts.failed} lost, largest work of the sand in a step "
        f"{starts.gain:.2g} J, {starts.evaluations:.2f} evaluations and {starts.derivatives:.2f} derivatives per step, "
        f"{starts.unsolved} unsolved",
    ):
        print_line(console, line)


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
            "derivatives": summary.derivatives,
            "median_error": summary.error,
            "cost_ratio_implicit_5ms_explicit_1ms": summary.cost_ratio,
            "nearer_of": list(summary.nearer),
        },
        "random_starts": starts._asdict(),
    }
