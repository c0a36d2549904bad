"""Figures of matplotlib, which is imported when the first is drawn."""

from pathlib import Path
from typing import Any

DPI = 110
"""Resolution of a figure's file [pixels per inch]."""


def make_figure(size: tuple[float, float]) -> Any:
    """Make an empty matplotlib Figure of a width and height [inch], laid out so that nothing overlaps."""
    from matplotlib.figure import Figure  # not before it is needed: it takes a second

    return Figure(figsize=size, layout="constrained")


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure to a file, in the format that the file's ending names."""
    figure.savefig(path, dpi=DPI)
