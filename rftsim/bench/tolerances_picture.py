"""The picture of the implicit force's tolerance: error over the cost of a step, a panel for each subject."""

from pathlib import Path

from rftsim.bench.pareto_picture import number_plainly
from rftsim.bench.stability import LOST
from rftsim.bench.tolerances import Solved
from rftsim.view.figure import make_figure, save_figure


def plot_tolerances(rows: list[Solved], path: Path) -> None:
    """Draw error against processor time, a line over the tolerances for each time step."""
    names = list(dict.fromkeys(row.subject for row in rows))
    figure = make_figure((4.3 * len(names), 4.3))
    for axis, name in zip(figure.subplots(1, len(names), squeeze=False).flat, names, strict=True):
        for h in dict.fromkeys(row.h for row in rows):
            own = [row for row in rows if (row.subject, row.h) == (name, h) and row.error < LOST]
            times, errors = [1e6 * row.seconds for row in own], [100 * row.error for row in own]
            (line,) = axis.loglog(times, errors, "o-", label=f"{1e3 * h:g} ms")
            for row, x, y in zip(own, times, errors, strict=True):
                label = {"textcoords": "offset points", "xytext": (4, 4), "fontsize": 7, "color": line.get_color()}
                axis.annotate(f"{row.tolerance:g}", (x, y), **label)
        axis.set_title(name)
        axis.set_xlabel("processor time of a step [µs]")
        axis.set_ylabel("error of the path [%]")
        axis.margins(0.12)
        axis.grid(alpha=0.3)
        number_plainly(axis.xaxis, axis.yaxis)
        axis.legend()
    figure.suptitle("The tolerance of the implicit force, against the finest one at 0.1 ms")
    save_figure(figure, path)
