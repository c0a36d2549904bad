"""Prints: points of a body's surface, close enough together that no cell of sand which it sweeps is missed."""

import numpy as np

from rftsim.surface.clusters import clustered
from rftsim.surface.splitting import split
from rftsim.surface.triangles import Array, Surface

FINENESS = 1.5
"""Points nearer to each other than this part of a cell count as one."""


def prints_of(surface: Surface, spacing: float, block: int) -> Array:
    """Points of a surface by which it marks sand, shape (n, 3): of each of its faces some in each cell.

    Args:
        surface: The whole surface, body frame.
        spacing: Side of a cell [m].
        block: How many of them, one behind another, lie close together.
    """
    fine = split(surface.triangles, spacing)
    points = np.concatenate([fine.reshape(-1, 3), fine.mean(axis=1)])
    _, first = np.unique(np.rint(points * (FINENESS / spacing)).astype(np.int64), axis=0, return_index=True)
    points = points[np.sort(first)]
    return points[clustered(points, block)]
