"""Slopes that are too steep slide: sand moves from cell to cell until none is steeper than the angle of repose.

What moves over an edge between neighbours is the same for both, so nothing is lost, and a mirrored bed slides as the
mirror image. No sand moves into cells that a body holds.
"""

from typing import Final

import numpy as np

from rftsim.engine import patch
from rftsim.law import ruts
from rftsim.law.vectors import larger
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import peek, poke

PASSES: Final = 12
"""Passes over a patch in one go; what is not at rest by then goes on sliding the next time."""
SHARE: Final = 0.2
"""Share of what is too much that moves over an edge in a pass; a cell has eight, and more than 2/9 would not come to
rest."""
REST: Final = 0.97
"""Slope at which what slides comes to rest, over that at which it begins."""
_DIAGONAL: Final = 2.0**0.5


@inline
def _over(here, there, steepest):
    """What comes over an edge to a cell from its neighbour, by their heights [m]; nothing where one is no number."""
    step = there - here
    much = larger(abs(step) - REST * steepest, 0.0)
    much = SHARE * much if abs(step) > steepest else 0.0
    return much if step > 0.0 else -much


@loop
def _row(level, flow, start, count, columns, steepest):
    """Fill what comes to each of so many cells of a row, from one on; the largest [m]."""
    most = 0.0
    for k in range(count):
        at = start + k
        here = peek(level, at)
        total = _over(here, peek(level, at - 1), steepest) + _over(here, peek(level, at + 1), steepest)
        total += _over(here, peek(level, at - columns), steepest) + _over(here, peek(level, at + columns), steepest)
        wide = _DIAGONAL * steepest
        total += _over(here, peek(level, at - columns - 1), wide) + _over(here, peek(level, at + columns + 1), wide)
        total += _over(here, peek(level, at - columns + 1), wide) + _over(here, peek(level, at + columns - 1), wide)
        poke(flow, at, total)
    for k in range(count):
        most = larger(most, abs(peek(flow, start + k)))
    return most


@exact
def _fill_levels(p, gap):
    """Fill the heights of the cells from and to which sand can slide; no numbers for those held, and for the edge."""
    level, height, rows, columns = patch.target(p), patch.height(p), patch.head(p).rows, patch.head(p).columns
    for i in range(rows):
        for j in range(columns):
            is_edge = i == 0 or j == 0 or i == rows - 1 or j == columns - 1
            level[i, j] = np.nan if is_edge or patch.is_held(p, i, j, gap) else height[i, j]


@exact
def _pass(p, steepest, box):
    """Let the sand in a box of cells slide once, first row and column and behind the last; what to look at next."""
    columns, level, flow = patch.head(p).columns, patch.flat(p, patch.target(p)), patch.flat(p, patch.flow(p))
    low, high = (patch.head(p).rows, columns), (0, 0)
    for i in range(box[0], box[2]):
        start = i * columns
        if _row(level, flow, start + box[1], box[3] - box[1], columns, steepest) == 0.0:
            continue
        first, last = box[1], box[3] - 1
        while flow[start + first] == 0.0:
            first += 1
        while flow[start + last] == 0.0:
            last -= 1
        low, high = (min(low[0], i), min(low[1], first)), (max(high[0], i + 1), max(high[1], last + 1))
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            level[i * columns + j] += flow[i * columns + j]
    return low[0], low[1], high[0], high[1]


@exact
def _wider(p, box):
    """A box with the cells around it, within the patch but for its edge."""
    rows, columns = patch.head(p).rows, patch.head(p).columns
    return max(box[0] - 1, 1), max(box[1] - 1, 1), min(box[2] + 1, rows - 1), min(box[3] + 1, columns - 1)


@exact
def settle(p, marks, repose):
    """Let the sand of a patch slide for some passes, at the tangent of its repose; the box of what still slides."""
    head, height, level = patch.head(p), patch.height(p), patch.target(p)
    _fill_levels(p, ruts.GAP * marks.spacing)
    box, touched = (1, 1, head.rows - 1, head.columns - 1), (head.rows, head.columns, 0, 0)
    for _ in range(PASSES):
        box = _pass(p, repose * marks.spacing, box)
        if box[2] <= box[0]:
            break
        touched = (
            min(touched[0], box[0]),
            min(touched[1], box[1]),
            max(touched[2], box[2]),
            max(touched[3], box[3]),
        )
        box = _wider(p, box)
    for i in range(touched[0], touched[2]):
        for j in range(touched[1], touched[3]):
            if level[i, j] == level[i, j] and level[i, j] != height[i, j]:
                patch.raise_cell(p, marks, i, j, level[i, j] - height[i, j])
    return box
