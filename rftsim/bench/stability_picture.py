"""The picture of the study of stability: error over the time step, and over the time spent."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from rftsim.bench.stability import FORCES, LOST, Row, with_answer
from rftsim.bench.trials import Force
from rftsim.view.figure import make_figure, save_figure

COLOURS: Final[dict[Force, str]] = {"implicit": "C0", "explicit": "C3"}
"""Colour of each force's lines."""
BESIDE: Final[dict[Force, tuple[int, int]]] = {"implicit": (-12, -16), "explicit": (0, 8)}
"""Place of a time step's label beside its point [points]."""


def plot_stability(rows: list[Row], path: Path) -> None:
    """Draw the hard cases' error against the time step and against the time spent."""
    figure, answered = make_figure((11, 5)), with_answer(rows)
    left, right = figure.subplots(1, 2, sharey=True)
    for force in FORCES if answered else ():
        _draw_force(left, right, answered, force)
    left.set_xlabel("time step [ms]")
    left.set_ylabel("error against the exact or converged answer")
    right.set_xlabel("elapsed time per simulated second [s]")
    for axis in (left, right):
        axis.axhline(LOST, color="0.6", linestyle=":")
        axis.grid(alpha=0.3)
        axis.legend(loc="lower right")
    left.text(0.0, LOST, " lost", color="0.4", va="bottom", transform=left.get_yaxis_transform())
    figure.suptitle(f"{len(answered)} hard cases, and their median (bold)")
    save_figure(figure, path)


def _draw_force(left: Any, right: Any, rows: list[Row], force: Force) -> None:
    """Draw every case under a force, and their median: over the time step on the left, over the time spent right."""
    steps = sorted({h for row in rows for used, h in row.played if used == force})
    errors = np.array([[row.verdicts[force, h].error for h in steps] for row in rows])
    errors, costs = np.clip(errors, 1e-5, LOST), np.array([[row.played[force, h].cost for h in steps] for row in rows])
    error, cost = np.median(errors, 0), np.median(costs, 0)
    thin = {"color": COLOURS[force], "alpha": 0.2, "linewidth": 1}
    bold = {"color": COLOURS[force], "linewidth": 2.5, "label": force}
    left.loglog(1e3 * np.array(steps), errors.T, **thin)
    left.loglog(1e3 * np.array(steps), error, "o-", **bold)
    right.loglog(costs.T, errors.T, **thin)
    right.loglog(cost, error, "o-", **bold)
    for h, x, y in zip(steps, cost, error, strict=True):
        label = {"textcoords": "offset points", "xytext": BESIDE[force], "color": COLOURS[force]}
        right.annotate(f"{1e3 * h:g} ms", (x, y), **label)
