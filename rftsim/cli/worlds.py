"""`rftsim bench warp`: its table and JSON."""

import math

from rich.console import Console

from rftsim.cli.output import make_table, print_json, print_line, progress
from rftsim.errors import RftsimError

ROUNDS = 9
"""Repetitions of each measurement."""


def weigh_warp(cases: tuple[str, ...], quick: bool, json: bool) -> None:
    """Time many worlds in mujoco_warp, or play hard cases there: `rftsim bench warp`.

    Raises:
        RftsimError: The extra of it is not installed.
    """
    try:
        import rftsim.warp  # noqa: F401
    except ImportError as error:
        raise RftsimError(str(error)) from error
    if cases:
        _play(cases, json)
    else:
        _time(quick, json)


def _play(cases: tuple[str, ...], json: bool) -> None:
    """Play hard cases on Warp."""
    from rftsim.bench import worlds_cases
    from rftsim.bench.hard_cases import CASES
    from rftsim.warp.sand import ITERATIONS

    names = tuple(CASES) if cases == ("all",) else cases
    unknown = [name for name in names if name not in CASES]
    if unknown:
        raise RftsimError(f"no hard case {unknown[0]!r}; there are all, {', '.join(CASES)}")
    with progress("warp", len(names) * len(worlds_cases.STEPS), json) as report:
        rows = worlds_cases.play(names, ITERATIONS, report)
    if json:
        print_json([row._asdict() | {"judged": row.judged._asdict()} for row in rows])
        return
    table = make_table(None, ("case", "quantity", "unit"), ("step [ms]", "Warp", "plugin", "wanted"))
    for row in rows:
        wanted = f"{row.wanted:.4g}" if row.judged.limit is None else f"< {row.wanted:g}"
        numbers = f"{1e3 * row.h:g}", f"{row.warp:.4g}", f"{row.plugin:.4g}", wanted
        table.add_row(row.case, row.quantity, row.judged.unit, *numbers)
    console = Console()
    console.print(table)
    print_line(
        console,
        f"{ITERATIONS} linearisations a step on Warp; plugin: the engine plugin at the same step; wanted: exact, or "
        f"the engine plugin at {1e3 * worlds_cases.CONVERGED:g} ms",
    )


def _time(quick: bool, json: bool) -> None:
    """Time many worlds."""
    from rftsim.bench import worlds
    from rftsim.bench.cases import GROUNDS
    from rftsim.bench.environment import SIMULATIONS
    from rftsim.warp.sand import ITERATIONS

    rounds, numbers = 3 if quick else ROUNDS, worlds.counts(quick)
    with progress("warp", rounds * len(numbers) + len(GROUNDS), json) as report:
        rows = worlds.measure(numbers, rounds, ITERATIONS, report)
        rates = worlds.measure_batch(rounds, report)
    if json:
        print_json({"device": worlds.device(), "rows": [row._asdict() for row in rows], "batch": rates})
        return
    table = make_table(None, ("worlds", "sand"), ("ms a step", "x", "steps/s", "memory [MB]"))
    for row in rows:
        memory = "" if math.isnan(row.memory) else f"{row.memory / 1e6:.0f}"
        rate = row.worlds / row.seconds
        table.add_row(
            str(row.worlds), row.ground, f"{1e3 * row.seconds:.3g}", f"{row.ratio:.2f}", f"{rate:.3g}", memory
        )
    console = Console()
    console.print(table)
    batch = ", ".join(f"{ground} {rate:.3g}" for ground, rate in rates.items())
    print_line(
        console,
        f"quadruped at 5 ms on {worlds.device()}, {ITERATIONS} linearisations; x: over the bare step. "
        f"{SIMULATIONS} in mujoco.batch on this machine's processors, steps/s: {batch}. "
        f"Medians of {rounds} repetitions, in turn",
    )
