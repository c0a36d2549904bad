"""The picture of the study of the environment: what sand costs a step, and the throughput of many simulations."""

from pathlib import Path
from typing import Final

import numpy as np

from rftsim.bench.cases import Ground
from rftsim.bench.environment import LIMITS, SIMULATIONS, THREADS, Timed
from rftsim.view.figure import make_figure, save_figure

COLOURS: Final[dict[Ground, str]] = {"explicit": "C3", "training": "C2", "implicit": "C0"}
"""Colour of each force's bars."""


def plot_environment(rows: list[Timed], path: Path) -> None:
    """Draw what sand costs: the step over the one without sand, and the throughput of batches over it."""
    cases = list(dict.fromkeys((row.subject, row.law) for row in rows))
    batched = list(dict.fromkeys((row.subject, row.law) for row in rows if row.batch))
    figure = make_figure((max(4.0 + 0.6 * (len(cases) + len(batched)), 8.0), 4.5))
    widths = [max(len(cases), 2), max(len(batched), 2)]
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": widths})
    for k, (force, colour) in enumerate(COLOURS.items()):
        own = [row for row in rows if row.sand == force]
        many = [row for row in own if row.batch]
        limit = LIMITS[force]
        place = np.arange(len(cases)) + 0.25 * (k - 1.0)
        left.bar(place, [row.ratio for row in own], 0.23, color=colour, label=force)
        if limit < np.inf:
            left.axhline(limit, color=colour, linestyle="--", linewidth=1)
            right.axhline(1.0 / limit, color=colour, linestyle="--", linewidth=1)
        for j, threads in enumerate(THREADS):
            at, shares = np.arange(len(many)) + 0.13 * (2 * k + j - 2.5), [row.batch[threads][1] for row in many]
            label = f"{force}, {threads} thread{'s' if threads > 1 else ''}"
            right.bar(at, shares, 0.12, color=colour, alpha=1.0 - 0.5 * j, label=label)
    left.set_yscale("log")
    ticks = [1, 2, 3, 5, 10, 20, 30, 100, 300, 1000]
    left.set_yticks(ticks, [f"{tick}" for tick in ticks])
    left.set_ylabel("step, over that without sand")
    ratios = [row.ratio for row in rows]
    left.set_ylim(0.7 * min(1.0, *ratios), 1.5 * max(limit for limit in (*LIMITS.values(), *ratios) if limit < np.inf))
    right.set_ylabel(f"throughput of {SIMULATIONS}, likewise")
    for axis, names in ((left, cases), (right, batched)):
        axis.set_xticks(np.arange(len(names)), [f"{name}\n{law}" for name, law in names], rotation=90)
        axis.grid(alpha=0.3, axis="y")
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize="small")
    right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize="small")
    figure.suptitle("What sand adds to MuJoCo's step (dashed: what the wheel was asked to keep)")
    save_figure(figure, path)
