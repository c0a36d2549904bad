"""`rftsim bench kernel`, `environment` and `pareto`: their tables, pictures and JSON."""

import itertools
import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from rftsim.bench import environment, kernel, pareto, tolerances
from rftsim.bench.environment import TIMED, Timed
from rftsim.bench.environment_picture import plot_environment
from rftsim.bench.kernel_picture import plot_kernel
from rftsim.bench.pareto import Compared, Tried
from rftsim.bench.pareto_picture import plot_pareto
from rftsim.bench.paths import REFERENCE_STEP
from rftsim.bench.subjects import SUBJECTS
from rftsim.bench.tolerances import Solved
from rftsim.bench.tolerances_picture import plot_tolerances
from rftsim.cli.output import make_table, print_json, print_line, print_written, progress
from rftsim.cli.results import draw, picture_in, remembered_in
from rftsim.errors import RftsimError

ROUNDS = 15
"""Repetitions of each measurement."""
PARTS = {"laws": tuple(SUBJECTS), "tolerance": tuple(tolerances.SOLVED)}
"""The subjects of each part of pareto."""


def time_kernel(quick: bool, oracle: Path, plot: Path | None, json: bool) -> None:
    """Time a triangle by the size of the body: `rftsim bench kernel`."""
    picture = picture_in(plot, "kernel")
    sizes = tuple(size for size in kernel.SIZES if not quick or size <= 20480)
    with progress("kernel", kernel.ROUNDS + 1, json) as report:
        limit = kernel.arithmetic()
        report("kernel")
        found = kernel.measure(sizes, kernel.load_oracle(oracle), lambda _: report("kernel"))
    power = kernel.exponent(found)
    draw(picture, plot_kernel, found, limit)
    if json:
        rows = [
            {
                "triangles": cost.triangles,
                "ns": cost.nanoseconds,
                "numpy_ratio": _number(cost.ratio),
                "memory": cost.memory,
                "leading": cost.leading,
            }
            for cost in found
        ]
        head = {"law": kernel.LAW, "sizes": rows, "exponent": power}
        print_json({**head, "arithmetic": limit._asdict()})
        return
    console = Console()
    console.print(_kernel_table(found, limit))
    print_line(
        console,
        f"time grows with the {power:.3f}th power of the triangles from {kernel.LINEAR} on; the law's "
        f"{limit.operations:.0f} operations take {limit.nanoseconds:.2f} ns at least, and are spared the "
        f"{100 - 100 * found[-1].leading:.0f} % of the triangles that do not lead",
    )
    print_written(console, picture)


def time_environment(names: tuple[str, ...], quick: bool, plot: Path | None, json: bool) -> None:
    """Time MuJoCo's step with sand and without: `rftsim bench environment`."""
    picture = picture_in(plot, "environment")
    rounds = 3 if quick else ROUNDS
    cases, missing = environment.choose(names, quick)
    with progress("environment", environment.repetitions(cases, rounds), json) as report:
        rows = environment.measure(cases, rounds, report)
    draw(picture, plot_environment, rows)
    if json:
        print_json([row._asdict() for row in rows])
        return
    console = Console()
    console.print(_single_table(rows))
    if any(row.batch for row in rows):
        console.print(_batch_table([row for row in rows if row.batch]))
    print_line(
        console,
        f"µs: processor time of a step; x: over that without sand, throughput likewise; expl.: over that with "
        f"the explicit force; real: times real time; work: evaluations and derivatives of the force in a step; "
        f"training: the implicit force at a tolerance of {environment.TRAINING:g}. Medians of {rounds} repetitions, in "
        f"turn",
    )
    if missing:
        print_line(console, f"left out, as they are not there: {', '.join(missing)}")
    print_written(console, picture)


def compare_speeds(parts: tuple[str, ...], quick: bool, memory: Path, plot: Path | None, json: bool) -> None:
    """Compare laws, triangles and time steps, and tolerances: `rftsim bench pareto`."""
    laws, solved = _choose_parts(parts)
    laws_picture = picture_in(plot if laws else None, "pareto")
    solved_picture = picture_in(plot if solved else None, "tolerance")
    study = pareto.Study(remembered_in(memory, "pareto"), quick)
    with progress("pareto", sum(len(study.laws(name)) for name in laws) + len(solved), json) as report:
        compared = pareto.run(study, laws, report)
        rows = pareto.run_tolerances(study, solved, report)
    draw(laws_picture, plot_pareto, compared)
    draw(solved_picture, plot_tolerances, rows)
    if json:
        print_json({**(_laws_json(compared) if laws else {}), **(_tolerances_json(rows) if solved else {})})
        return
    console = Console()
    if laws:
        _print_laws(console, compared)
    if solved:
        _print_tolerances(console, rows)
    print_written(console, laws_picture, solved_picture)


def _choose_parts(parts: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The subjects of the parts of pareto, laws and tolerances, that were asked for; none for all."""
    for name in parts:
        if name not in PARTS:
            raise RftsimError(f"pareto has no part {name!r}; --cases takes {', '.join(PARTS)}")
    laws, solved = (subjects if name in (parts or PARTS) else () for name, subjects in PARTS.items())
    return laws, solved


def _laws_json(compared: list[Compared]) -> dict[str, Any]:
    return {
        "tried": [one._asdict() for each in compared for one in each.tried],
        "front": [one._asdict() for one in _front(compared)],
        "laws_apart": {f"{name}, {law}": value for (name, law), value in pareto.laws_apart(compared).items()},
    }


def _tolerances_json(rows: list[Solved]) -> dict[str, Any]:
    advice = tolerances.advise(rows)
    return {"tolerance": [row._asdict() for row in rows], "advice": advice._asdict() if advice else None}


def _print_laws(console: Console, compared: list[Compared]) -> None:
    console.print(_meshes_table(compared))
    console.print(_front_table(_front(compared)))
    print_line(
        console,
        "ms: time step; error: largest distance from the path of the same law with all triangles of the fine mesh at "
        f"{1e3 * REFERENCE_STEP:g} ms, over that path's length; µs: processor time of a step; "
        "real: times real time",
    )
    for (name, law), value in pareto.laws_apart(compared).items():
        if value > 0.0:
            says = f"{name}: the path under {law} lies {_percent(value)} % from that under {SUBJECTS[name].laws[0]}"
            print_line(console, says)


def _print_tolerances(console: Console, rows: list[Solved]) -> None:
    console.print(_tolerances_table(rows))
    print_line(
        console,
        "µs: processor time of a step; work: evaluations and derivatives of the force in a step; unsolved: equations "
        "outside the tolerance, over all steps; error: largest distance from the path of the same mesh at "
        f"{1e3 * REFERENCE_STEP:g} ms and {tolerances.TOLERANCES[0]:g}, over that path's length",
    )
    print_line(console, _say_advice(tolerances.advise(rows)))


def _say_advice(advice: tolerances.Advice | None) -> str:
    if advice is None:
        return "for training: no tolerance is recommended, as the finest one loses a simulation"
    each = ", ".join(f"{name} {tolerance:g}" for name, tolerance in advice.each.items())
    return (
        f"for training at {1e3 * advice.h:g} ms: tolerance {advice.common:g} for all, the cheapest whose error is "
        f"within {tolerances.ALLOWED:g} times that of {advice.finest:g}; each by itself: {each}"
    )


def _front(compared: list[Compared]) -> list[Tried]:
    return [one for each in compared for one in pareto.front(each.tried)]


def _kernel_table(costs: list[kernel.Cost], limit: kernel.Arithmetic) -> Table:
    headings = ("triangles", "body [µs]", "each [ns]", "of the limit", "NumPy's time", "memory")
    table = make_table(None, (), headings)
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


def _single_table(rows: list[Timed]) -> Table:
    table = make_table("one simulation", ("scene", "sand"), ("µs", "x", "expl.", "real", "work"))
    for row in rows:
        name, sand = _head(row)
        first = {"none": name, "explicit": f"  {1e3 * row.h:g} ms", "implicit": f"  {row.triangles} triangles"}
        table.add_row(
            first.get(row.sand, ""),
            sand,
            f"{1e6 * row.seconds:.4g}" if row.seconds < 9e-3 else f"{1e6 * row.seconds:.0f}",
            "lost" if row.lost else f"{row.ratio:.1f}",
            f"{row.over_explicit:.1f}" if row.sand in ("implicit", "training") else "",
            f"{row.realtime:.3g}",
            f"{row.evaluations:.1f} + {row.derivatives:.1f}",
            end_section=row.sand == TIMED[-1],
        )
    return table


def _batch_table(rows: list[Timed]) -> Table:
    title = f"{environment.SIMULATIONS} simulations at once, each with sand of its own"
    headings = [heading for n in environment.THREADS for heading in (f"{n} thread{'s' if n > 1 else ''}", "x")]
    table = make_table(title, ("scene", "sand"), headings)
    for row in rows:
        cells = [cell for rate, share in row.batch.values() for cell in (f"{rate:,.0f}/s", f"{share:.2f}")]
        table.add_row(*_head(row), *cells, end_section=row.sand == TIMED[-1])
    return table


def _head(row: Timed) -> tuple[str, str]:
    """The first cells of a row, the scene in the first row of each only."""
    return f"{row.subject}, {row.law}" if row.sand == "none" else "", row.sand


def _meshes_table(compared: list[Compared]) -> Table:
    meshes = list(dict.fromkeys(one.mesh for each in compared for one in each.tried))
    table = make_table("elements, and largest error of the wrench [%]", ("scene",), meshes)
    for each in compared:
        found = {one.mesh: f"{one.elements}: {_percent(one.wrench_error)}" for one in each.tried}
        table.add_row(f"{each.tried[0].subject}, {each.tried[0].law}", *(found[mesh] for mesh in meshes))
    return table


def _front_table(front: list[Tried]) -> Table:
    headings = ("elements", "ms", "error %", "µs", "real")
    table = make_table("what nothing cheaper comes near", ("scene", "force"), headings)
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


def _tolerances_table(rows: list[Solved]) -> Table:
    table = make_table("tolerance", ("scene",), ("ms", "tolerance", "µs", "work", "unsolved", "error %"))
    for row, following in itertools.zip_longest(rows, rows[1:]):
        table.add_row(
            f"{row.subject}, {row.law}",
            f"{1e3 * row.h:g}",
            f"{row.tolerance:g}",
            f"{1e6 * row.seconds:.1f}",
            f"{row.evaluations:.1f} + {row.derivatives:.1f}",
            f"{row.unsolved}",
            _percent(row.error),
            end_section=following is None or (following.subject, following.h) != (row.subject, row.h),
        )
    return table


def _percent(value: float) -> str:
    return "lost" if math.isinf(value) else f"{100 * value:.2g}"
