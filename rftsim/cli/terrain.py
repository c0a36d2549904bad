"""`rftsim bench terrain`: its table and JSON."""

from rich.console import Console

from rftsim.bench import terrain
from rftsim.cli.output import make_table, print_json, progress

ROUNDS = 9
"""Repetitions of each measurement."""


def time_terrain(quick: bool, json: bool) -> None:
    """Time terrain and ruts over a plane: `rftsim bench terrain`."""
    rounds = 3 if quick else ROUNDS
    with progress("terrain", terrain.repetitions(rounds), json) as report:
        rows = terrain.measure(rounds, report)
    if json:
        print_json([row._asdict() for row in rows])
        return
    table = make_table(None, ("what", "ground"), ("µs", "x", "memory [kB]"))
    for row in rows:
        table.add_row(row.what, row.ground, f"{1e6 * row.seconds:.4g}", f"{row.ratio:.2f}", f"{row.memory / 1e3:.4g}")
    Console().print(table)
