"""`rftsim bench solver`: its table and JSON."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from rftsim.bench.effort import Effort
from rftsim.bench.hard_cases import CASES
from rftsim.bench.solver import STEPS, Group, Played, Study, Summary, hard_cases, hardest, lost, scenes, summarise
from rftsim.cli.extra import needing
from rftsim.cli.output import make_table, print_json, print_line, progress
from rftsim.cli.results import remembered_in
from rftsim.errors import RftsimError

EPISODES = 5.0
"""Simulated time of each environment's episodes under each kind of actions [s]."""
QUICK_SCENES = 20
"""Number of scenes at random of a quick study."""
BY: Final[dict[str, Callable[[Effort], float]]] = {
    "evaluations' worth of a step": lambda effort: effort.worst,
    "evaluations in the mean": lambda effort: effort.evaluations / max(effort.steps, 1),
    "unsolved equations": lambda effort: effort.unsolved,
    "work of the sand in a step [J]": lambda effort: effort.gain,
    "that over kinetic energy": lambda effort: effort.share,
}
"""Quantities by which the worst scenes are listed."""


def weigh_solver(cases: tuple[str, ...], count: int, quick: bool, memory: Path, json: bool) -> None:
    """Measure the solver's effort in hard cases, environments and scenes at random, and print it.

    Raises:
        RftsimError: There is no such case, or the number of scenes is not positive.
    """
    unknown = sorted(set(cases) - set(CASES))
    if unknown:
        raise RftsimError(f"no case {unknown[0]!r}; cases are {', '.join(CASES)}")
    if count < 1:
        raise RftsimError(f"scenes must be one or more, not {count}")
    with needing("envs"):
        from rftsim_envs import effort as episodes
    players = episodes.players()
    groups = [
        hard_cases(cases or (tuple(CASES)[::4] if quick else ())),
        Group("environments", players[::4] if quick else players, lambda who, h: episodes.measure(who, h, EPISODES)),
        scenes(min(count, QUICK_SCENES) if quick else count),
    ]
    steps = (5e-3,) if quick else STEPS
    study = Study(remembered_in(memory, "solver"), episodes)
    with progress("solver", len(steps) * sum(len(group.members) for group in groups), json) as report:
        played = [one for group in groups for one in study.play(group, steps, report)]
    drawn = [one for one in played if one.group == groups[-1].name]
    listed = {what: [one for one in hardest(drawn, measure) if measure(one.effort) > 0] for what, measure in BY.items()}
    if json:
        print_json(_report(summarise(played), listed, lost(played)))
        return
    console = Console()
    console.print(_table(summarise(played)))
    print_line(
        console,
        "a step: evaluations of the force and of its derivative, in the mean; most: evaluations' worth of one step, "
        "of 60 at most, in which a derivative counts as two; open: "
        "unsolved equations over steps; J: largest work of the sand in one step; share: that over the largest kinetic "
        "energy of its simulation; lost: simulations lost with sand though not without, and those lost without. The "
        "environments' actions are random or swaying, or come from drives that see nothing",
    )
    for what, found in listed.items():
        told = (f"{one.member} at {1e3 * one.h:g} ms ({BY[what](one.effort):.3g})" for one in found)
        print_line(console, f"scenes by {what}: {', '.join(told) or 'none'}")
    print_line(console, f"lost: {', '.join(fate(one) for one in lost(played)) or 'none'}")


def fate(one: Played) -> str:
    """Tell which simulation is lost, and since when it is without sand as well."""
    told = f"{one.member} at {1e3 * one.h:g} ms"
    if one.effort.bare_from is None:
        return told
    time, energy = one.effort.bare_from
    return f"{told} (without sand as well from {time:.3g} s on, with {energy:.2g} of the kinetic energy of its start)"


def _table(rows: list[Summary]) -> Table:
    headings = ("a step", "most", "open", "J", "share", "lost")
    table = make_table(None, ("set",), headings)
    for i, row in enumerate(rows):
        table.add_row(
            f"{row.simulations} {row.group}, {1e3 * row.h:g} ms",
            f"{row.evaluations:.1f} + {row.derivatives:.1f}",
            f"{row.worst:.0f}",
            f"{row.unsolved:.1g}",
            f"{row.gain:.1g}",
            f"{row.share:.1g}",
            f"{row.lost} + {row.lost_bare}",
            end_section=i + 1 == len(rows) or rows[i + 1].group != row.group,
        )
    return table


def _report(rows: list[Summary], listed: dict[str, list[Played]], gone: list[Played]) -> dict[str, object]:
    def told(one: Played) -> dict[str, object]:
        return {"set": one.group, "name": one.member, "h": one.h} | one.effort._asdict()

    return {
        "sets": [row._asdict() for row in rows],
        "worst_scenes": {what: [told(one) for one in found] for what, found in listed.items()},
        "lost": [told(one) for one in gone],
    }
