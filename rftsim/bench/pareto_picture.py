"""The picture of the study of speed against accuracy: error over cost, a panel for each subject."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from rftsim.bench.pareto import Compared, Mesh, front, laws_apart
from rftsim.bench.stability import LOST
from rftsim.view.figure import make_figure, save_figure

LAWS: Final = {"rft2d": "C9", "drft2d": "C0", "rft3d": "C1", "drft3d": "C3"}
"""Colour of each law."""
MESHES: Final[dict[Mesh, str]] = {"fine": "s", "shipped": "D", "1 %": "o", "3 %": "v", "10 %": "."}
"""Marker of each mesh."""


def plot_pareto(compared: list[Compared], path: Path) -> None:
    """Draw error against cost, a panel for each subject, with each law's front."""
    names = list(dict.fromkeys(each.tried[0].subject for each in compared))
    figure = make_figure((13, 4.6 * -(-len(names) // 2)))
    panels = figure.subplots(-(-len(names) // 2), 2, squeeze=False).flat
    apart = laws_apart(compared)
    for axis, name in zip(panels, names, strict=False):
        own = [each for each in compared if each.tried[0].subject == name]
        for each in own:
            _draw_front(axis, each, apart[name, each.tried[0].law])
        _label(axis, name)
    _explain(figure, [law for law in LAWS if any(each.tried[0].law == law for each in compared)])
    figure.suptitle("Each law against itself with a fine mesh at 0.1 ms; lines: what nothing cheaper comes near")
    save_figure(figure, path)


def _label(axis: Any, name: str) -> None:
    """Scale and label the axes of a subject's panel."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.margins(0.12)
    axis.set_title(name)
    axis.set_xlabel("processor time per simulated second [ms]")
    axis.set_ylabel("error of the path [%]")
    axis.grid(alpha=0.3)
    above = axis.secondary_xaxis("top", functions=(_inverse, _inverse))
    above.set_xlabel("times real time")
    number_plainly(axis.xaxis, axis.yaxis, above.xaxis)


def number_plainly(*axes: Any) -> None:
    """Write plain numbers at 1, 2 and 5 of each decade of logarithmic axes."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def _inverse(x: Any) -> Any:
    """Turn milliseconds per simulated second into times real time, or back."""
    return 1e3 / np.maximum(x, 1e-9)


def _draw_front(axis: Any, each: Compared, apart: float) -> None:
    """Draw all that was tried of a subject under a law, the front, and the law's distance from the own law."""
    colour = LAWS[each.tried[0].law]
    for one in each.tried:
        if one.error < LOST:
            face = colour if one.force == "implicit" else "none"
            options = {"marker": MESHES[one.mesh], "markersize": 5, "linestyle": "", "alpha": 0.4}
            axis.plot(1e3 * one.cost, 100 * max(one.error, 1e-6), color=colour, markerfacecolor=face, **options)
    best = [one for one in front(each.tried) if one.error < LOST]
    axis.plot([1e3 * one.cost for one in best], [100 * one.error for one in best], color=colour, linewidth=2)
    for one in best if apart == 0.0 else ():  # of the subject's own law
        says = f"{1e3 * one.h:g} ms, {one.elements}"
        spot = (1e3 * one.cost, 100 * one.error)
        axis.annotate(says, spot, textcoords="offset points", xytext=(5, 4), fontsize=8, color=colour)
    if apart > 0.0:
        axis.axhline(100 * apart, color=colour, linestyle=":", linewidth=1.5)


def _explain(figure: Any, laws: list[str]) -> None:
    """Say what colours, markers and lines mean, below all panels."""
    from matplotlib.lines import Line2D

    black: dict[str, Any] = {"color": "0.3", "linestyle": ""}
    lines = [Line2D([], [], color=LAWS[law], linewidth=2, label=law) for law in laws]
    for mesh, marker in MESHES.items():
        says = {"fine": "fine mesh", "shipped": "the model's mesh"}.get(mesh, f"facets, {mesh}")
        lines.append(Line2D([], [], marker=marker, label=says, **black))
    lines.append(Line2D([], [], marker="D", markerfacecolor="none", label="explicit force", **black))
    lines.append(Line2D([], [], color="0.3", linestyle=":", label="the law's distance from the scene's own law"))
    figure.legend(handles=lines, loc="outside lower center", ncols=5)
