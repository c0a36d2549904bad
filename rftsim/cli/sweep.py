"""The end of a sweep of seeds and settings: one table and one picture over all its runs."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from rftsim.cli.output import make_table, print_written
from rftsim.cli.results import draw, picture_in

if TYPE_CHECKING:
    from rftsim_envs.training.curves import Curve

PICTURE = "returns"
"""Name of the picture in the sweep's folder, without its ending."""
NUMBERS = ("seeds", "steps", "minutes each", "return", "lowest", "highest")
"""Headings of the table's numbers."""


def show_sweep(title: str, out: Path, names: Iterable[str], silent: bool) -> None:
    """Draw the returns of a sweep's runs over the steps, as far as they are trained, and print them.

    Args:
        title: What is trained.
        out: The sweep's folder, in which the picture is written.
        names: Folders of the runs in it.
        silent: Print nothing.
    """
    from rftsim_envs.training.curves import read_curves

    from rftsim.view.curves import plot_curves

    curves = read_curves(out, names)
    if not curves:
        return
    picture = picture_in(out, PICTURE)
    draw(picture, plot_curves, curves, title)
    if silent:
        return
    table = make_table(f"{title}, return of the last episodes", ("setting",), NUMBERS)
    for curve in curves:
        table.add_row(curve.name or "-", *_numbers(curve))
    Console().print(table)
    print_written(Console(), picture)


def _numbers(curve: "Curve") -> list[str]:
    last = curve.last
    returns = ["-" if math.isnan(one) else f"{one:.3g}" for one in (last.mean(), last.min(), last.max())]
    return [str(len(last)), f"{curve.steps[-1]:.0f}", f"{curve.seconds.mean() / 60.0:.1f}", *returns]
