"""`rftsim bench warp`: its table and JSON."""

import math

from rich.console import Console

from rftsim.cli.output import make_table, print_json, print_line, progress
from rftsim.errors import RftsimError

ROUNDS = 9
"""Repetitions of each measurement."""


def time_worlds(quick: bool, json: bool) -> None:
    """Time many worlds in mujoco_warp: `rftsim bench warp`.

    Raises:
        RftsimError: The extra of it is not installed.
    """
    try:
        from rftsim.bench import worlds
        from rftsim.bench.cases import GROUNDS
        from rftsim.bench.environment import SIMULATIONS
        from rftsim.warp.sand import ITERATIONS
    except ImportError as error:
        raise RftsimError(str(error)) from error
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
