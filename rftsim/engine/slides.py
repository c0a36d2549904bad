"""Slopes that are too steep slide: sand moves from cell to cell until none is steeper than the angle of repose.

What moves over each edge between neighbours is found for all at once, and taken from one cell and given to the other,
so nothing is lost, and a mirrored bed slides as the mirror image. No sand moves into cells that a body holds.
"""

from typing import Final

import numpy as np

from rftsim.engine import patch
from rftsim.law import ruts
from rftsim.machine.compiling import exact, inline

SWEEPS: Final = 4
"""Passes over a patch in one go; what is not at rest by then goes on sliding the next time."""
SHARE: Final = 0.125
"""Share of what is too much that moves over an edge in a pass; a cell has eight."""
REST: Final = 0.98
"""Slope at which what slides comes to rest, over that at which it begins."""


@inline
def _slide(p, i, j, a, b, steepest, gap):
    """Let sand move over the edge between two cells; whether it was too steep."""
    rows, columns, height, flow = patch.head(p).rows, patch.head(p).columns, patch.height(p), patch.flow(p)
    if a < 0 or b < 0 or a >= rows or b >= columns:
        return False
    step = height[i, j] - height[a, b]
    if not abs(step) > steepest or patch.is_held(p, i, j, gap) or patch.is_held(p, a, b, gap):
        return False
    much = SHARE * (step - REST * steepest if step > 0.0 else step + REST * steepest)
    flow[i, j] -= much
    flow[a, b] += much
    return True


@exact
def _pass(p, marks, steepest):
    """Let all sand slide once that lies too steep.

    Returns:
        First row and column of what did, and last row and column; the last ones are negative where nothing did.
    """
    rows, columns, flow = patch.head(p).rows, patch.head(p).columns, patch.flow(p)
    gap, low, high = ruts.GAP * marks.spacing, (rows, columns), (-1, -1)
    diagonal = np.sqrt(2.0) * steepest
    for i in range(rows):
        for j in range(columns):
            flow[i, j] = 0.0
    for i in range(rows):
        for j in range(columns):
            slid = _slide(p, i, j, i, j + 1, steepest, gap)
            slid = _slide(p, i, j, i + 1, j, steepest, gap) or slid
            slid = _slide(p, i, j, i + 1, j + 1, diagonal, gap) or slid
            slid = _slide(p, i, j, i + 1, j - 1, diagonal, gap) or slid
            if slid:
                low, high = (min(low[0], i), min(low[1], j - 1)), (max(high[0], i + 1), max(high[1], j + 1))
    if high[0] >= 0:
        for i in range(max(low[0], 0), min(high[0] + 1, rows)):
            for j in range(max(low[1], 0), min(high[1] + 1, columns)):
                if flow[i, j] != 0.0:
                    patch.raise_cell(p, marks, i, j, flow[i, j])
    return low[0], low[1], high[0], high[1]


@exact
def settle(p, marks, repose):
    """Let the sand of a patch slide for some passes, at a tangent of the angle of repose; what slid in the last one."""
    found = patch.head(p).rows, patch.head(p).columns, -1, -1
    for _ in range(SWEEPS):
        found = _pass(p, marks, repose * marks.spacing)
        if found[2] < 0:
            break
    return found
