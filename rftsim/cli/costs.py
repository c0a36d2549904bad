"""`rftsim bench environment` and `pareto`: their tables, pictures and JSON."""

import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rftsim.bench import environment as sanded
from rftsim.bench import pareto as tradeoff
from rftsim.bench.environment import Timed
from rftsim.bench.pareto import Compared, Tried
from rftsim.bench.subjects import SUBJECTS
from rftsim.cli.output import print_json
from rftsim.files import check_writable, replacing
from rftsim.plots import plot_environment, plot_pareto

ROUNDS = 15
"""Repetitions of each measurement."""


def environment(quick: bool, plot: Path | None, json: bool) -> None:
    """Time MuJoCo's step with sand and without."""
    picture = _picture(plot, "environment")
    rounds = 3 if quick else ROUNDS
    with _progress("environment", sanded.repetitions(rounds), json) as report:
        rows = sanded.measure(rounds, report)
    _finish(rows, picture, plot_environment)
    if json:
        print_json([row._asdict() for row in rows])
        return
    console = Console()
    console.print(_single_table(rows))
    console.print(_batch_table(rows))
    console.print(
        f"µs: processor time of a step; x: over that without sand, throughput likewise; real: times real time; work: "
        f"evaluations and derivatives of the force in a step. Medians of {rounds} repetitions, in turn",
        highlight=False,
        soft_wrap=True,
    )
    _say(console, picture)


def pareto(quick: bool, memory: Path, plot: Path | None, json: bool) -> None:
    """Compare laws, triangles and time steps."""
    picture = _picture(plot, "pareto")
    memory.mkdir(parents=True, exist_ok=True)
    kept = memory / "pareto.json"
    check_writable(kept)
    study = tradeoff.Study(kept, quick)
    with _progress("pareto", sum(len(study.laws(name)) for name in SUBJECTS), json) as report:
        compared = tradeoff.run(study, SUBJECTS, report)
    apart = tradeoff.apart(compared)
    _finish(compared, picture, plot_pareto)
    if json:
        print_json(
            {
                "tried": [one._asdict() for each in compared for one in each.tried],
                "front": [one._asdict() for one in _front(compared)],
                "laws_apart": {f"{name}, {law}": value for (name, law), value in apart.items()},
            }
        )
        return
    console = Console()
    console.print(_meshes_table(compared))
    console.print(_front_table(_front(compared)))
    console.print(
        "ms: time step; error: largest distance from the path of the same law with all triangles of the fine mesh at "
        f"{1e3 * tradeoff.REFERENCE_STEP:g} ms, over that path's length; µs: processor time of a step; "
        "real: times real time",
        highlight=False,
        soft_wrap=True,
    )
    for (name, law), value in apart.items():
        if value > 0.0:
            says = f"{name}: the path under {law} lies {_percent(value)} % from that under {SUBJECTS[name].laws[0]}"
            console.print(says, highlight=False, soft_wrap=True)
    _say(console, picture)


def _front(compared: list[Compared]) -> list[Tried]:
    return [one for each in compared for one in tradeoff.fronts(each.tried)]


def _single_table(rows: list[Timed]) -> Table:
    table = _table("one simulation", "scene", "sand")
    for heading in ("triangles", "µs", "x", "real", "work"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            *_head(row),
            f"{row.triangles}",
            f"{1e6 * row.seconds:.2f}",
            f"{row.ratio:.2f}",
            f"× {row.realtime:.0f}",
            f"{row.evaluations:.2f} + {row.derivatives:.2f}",
            end_section=row.sand == sanded.SANDS[-1],
        )
    return table


def _batch_table(rows: list[Timed]) -> Table:
    table = _table(f"{sanded.SIMULATIONS} simulations at once, each with sand of its own", "scene", "sand")
    for threads in sanded.THREADS:
        table.add_column(f"{threads} thread{'s' if threads > 1 else ''}", justify="right")
        table.add_column("x", justify="right")
    for row in rows:
        cells = [cell for rate, share in row.batch.values() for cell in (f"{rate:,.0f}/s", f"{share:.2f}")]
        table.add_row(*_head(row), *cells, end_section=row.sand == sanded.SANDS[-1])
    return table


def _table(title: str, *names: str) -> Table:
    table = Table(title=title, title_justify="left")
    for name in names:
        table.add_column(name, no_wrap=True)
    return table


def _head(row: Timed) -> tuple[str, str]:
    return f"{row.subject}, {row.law}" if row.sand == "none" else "", row.sand


def _meshes_table(compared: list[Compared]) -> Table:
    table = _table("elements, and largest error of the wrench [%]", "scene")
    meshes = list(dict.fromkeys(one.mesh for each in compared for one in each.tried))
    for mesh in meshes:
        table.add_column(mesh, justify="right", no_wrap=True)
    for each in compared:
        found = {one.mesh: f"{one.elements}: {_percent(one.wrench_error)}" for one in each.tried}
        table.add_row(f"{each.tried[0].subject}, {each.tried[0].law}", *(found[mesh] for mesh in meshes))
    return table


def _front_table(front: list[Tried]) -> Table:
    table = _table("what nothing cheaper comes near", "scene", "force")
    for heading in ("elements", "ms", "error %", "µs", "real"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for one, following in itertools.zip_longest(front, front[1:]):
        last = following is None or (following.subject, following.law) != (one.subject, one.law)
        table.add_row(
            f"{one.subject}, {one.law}",
            one.force,
            f"{one.elements}",
            f"{1e3 * one.h:g}",
            _percent(one.error),
            f"{1e6 * one.seconds:.1f}",
            f"× {1.0 / one.cost:.0f}",
            end_section=last,
        )
    return table


def _percent(value: float) -> str:
    return "lost" if math.isinf(value) else f"{100 * value:.2g}"


def _picture(plot: Path | None, name: str) -> Path | None:
    if plot is None:
        return None
    plot.mkdir(parents=True, exist_ok=True)
    check_writable(plot / f"{name}.png")
    return plot / f"{name}.png"


def _finish(found: Any, picture: Path | None, draw: Callable[[Any, Path], None]) -> None:
    if picture is not None:
        with replacing(picture) as temporary:
            draw(found, temporary)


def _say(console: Console, picture: Path | None) -> None:
    if picture is not None:
        console.print(f"wrote {picture}", highlight=False)


@contextmanager
def _progress(name: str, total: int, hidden: bool) -> Iterator[Callable[[str], None]]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=hidden) as bar:
        task = bar.add_task(name, total=total)
        yield lambda said: bar.update(task, advance=1, description=said)
