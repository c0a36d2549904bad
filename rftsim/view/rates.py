"""The picture of the demonstration: wheel and runner over their rates, under four laws."""

from pathlib import Path
from typing import Final

from rftsim.run.rate_sweep import Point
from rftsim.view.figure import make_figure, save_figure

STYLES: Final = {"rft2d": ("C0", "--"), "drft2d": ("C0", "-"), "rft3d": ("C1", "--"), "drft3d": ("C1", "-")}
"""Colour and line style of each law's curve."""


def plot_rates(points: list[Point], path: Path) -> None:
    """Draw speed and sinkage against spin, a column for each scene, as [Agarwal] Figs. 4-7 and 4-9 do."""
    scenes = list(dict.fromkeys(point.scene for point in points))
    figure = make_figure((11, 7.5))
    axes = figure.subplots(2, len(scenes), sharex="col", squeeze=False)
    for column, scene in enumerate(scenes):
        for law, (colour, line) in STYLES.items():
            own = [point for point in points if point.scene == scene and point.law == law]
            spin = [point.spin for point in own]
            options = {"color": colour, "linestyle": line, "marker": "o", "markersize": 4, "label": law}
            axes[0, column].plot(spin, [point.speed for point in own], **options)
            axes[1, column].plot(spin, [point.sinkage for point in own], **options)
        axes[0, column].set_title(scene)
        axes[0, column].set_ylabel("speed  $v/\\sqrt{g\\ell}$")
        axes[1, column].set_ylabel("sinkage  $z/\\ell$")
        axes[1, column].set_xlabel("spin  $\\omega/\\sqrt{g/\\ell}$")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend()
    figure.suptitle("Wheels on loose poppy seeds: quasi-static (dashed) and dynamic (solid) laws")
    save_figure(figure, path)
