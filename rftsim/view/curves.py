"""The picture of how several trainings went: return over steps, with a band over the seeds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from rftsim.view.figure import make_figure, save_figure

BAND = 0.2
"""Opacity of a band."""


class Curve(Protocol):
    """The runs of one setting, as `plot_curves` draws them."""

    @property
    def name(self) -> str:
        """The settings that set these runs apart from the others."""
        ...

    @property
    def steps(self) -> Any:
        """The numbers of control steps after which returns were noted, (k,)."""
        ...

    @property
    def returns(self) -> Any:
        """The return of each run after so many steps, (nrun, k)."""
        ...


def plot_curves(curves: Sequence[Curve], title: str, path: Path) -> None:
    """Draw the mean return of each setting's runs over the steps, in a band from the lowest to the highest of them.

    Args:
        curves: The settings, one at least.
        title: The picture's title.
        path: The file of the picture.
    """
    figure = make_figure((8, 5))
    axis = figure.subplots()
    for k, curve in enumerate(curves):
        colour, count = f"C{k % 10}", len(curve.returns)
        said = f"{count} seed{'s' if count > 1 else ''}"
        label = f"{curve.name}, {said}" if curve.name else said
        axis.plot(curve.steps, curve.returns.mean(axis=0), color=colour, label=label)
        if count > 1:
            low, high = curve.returns.min(axis=0), curve.returns.max(axis=0)
            axis.fill_between(curve.steps, low, high, color=colour, alpha=BAND, linewidth=0.0)
    axis.set_xlabel("control steps")
    axis.set_ylabel("return per episode [-]")
    axis.set_title(f"{title}: mean over the seeds, band from the lowest to the highest")
    axis.grid(alpha=0.3)
    axis.legend()
    save_figure(figure, path)
