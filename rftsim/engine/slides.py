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

RATE: Final = 800.0
"""Passes over a patch per second, as far as it was not looked at before; what is not at rest then goes on sliding."""
MOST: Final = 16
"""Passes in one go."""
SHARE: Final = 0.15
"""Share of what is too much that moves over an edge in a pass; with more than a sixth, stripes of cells would grow."""
REACH: Final = 2
"""Cells beyond those where it may be too steep that are looked at."""
REST: Final = 0.97
"""Slope at which what slides comes to rest, over that at which it begins."""


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
        wide = patch.DIAGONAL * steepest
        total += _over(here, peek(level, at - columns - 1), wide) + _over(here, peek(level, at + columns + 1), wide)
        total += _over(here, peek(level, at - columns + 1), wide) + _over(here, peek(level, at + columns - 1), wide)
        poke(flow, at, total)
    for k in range(count):
        most = larger(most, abs(peek(flow, start + k)))
    return most


@exact
def _fill_levels(p, gap):
    """Fill the heights of the cells from and to which sand can slide; no numbers for those held, and for the edge."""
    level, height, rows, columns = patch.level(p), patch.height(p), patch.head(p).rows, patch.head(p).columns
    for i in range(rows):
        for j in range(columns):
            is_edge = i == 0 or j == 0 or i == rows - 1 or j == columns - 1
            level[i, j] = np.nan if is_edge or patch.is_held(p, i, j, gap) else height[i, j]


@exact
def _pass(p, steepest, box):
    """Let the sand in a box of cells slide once, first row and column and behind the last; what to look at next."""
    columns, level, flow = patch.head(p).columns, patch.flat(p, patch.level(p)), patch.flat(p, patch.flow(p))
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
def _inside(p, box, margin):
    """A box of cells of the ground, and a margin, as one of the patch, less its edge."""
    head = patch.head(p)
    low = max(int(box[0]) - margin - head.row, 1), max(int(box[1]) - margin - head.column, 1)
    high = int(box[2]) + margin - head.row, int(box[3]) + margin - head.column
    return low[0], low[1], min(high[0], head.rows - 1), min(high[1], head.columns - 1)


@exact
def settle(p, marks, repose, passed, box):
    """Let the sand of a patch slide for some passes, as many as the time that passed allows.

    Args:
        p: Address of the patch's table.
        marks: The ruts.
        repose: Tangent of the angle at which the sand rests.
        passed: Time since it was let slide the last time [s].
        box: Cells where it may be too steep, first row and column and those behind the last; becomes those where it
            still may be, (4,).
    """
    head, height, level = patch.head(p), patch.height(p), patch.level(p)
    _fill_levels(p, ruts.GAP * marks.spacing)
    now, touched = _inside(p, box, REACH), (head.rows, head.columns, 0, 0)
    for _ in range(min(max(int(RATE * passed + 0.5), 1), MOST)):
        now = _pass(p, repose * marks.spacing, now)
        if now[2] <= now[0]:
            break
        touched = (
            min(touched[0], now[0]),
            min(touched[1], now[1]),
            max(touched[2], now[2]),
            max(touched[3], now[3]),
        )
        now = _wider(p, now)
    for i in range(touched[0], touched[2]):
        for j in range(touched[1], touched[3]):
            if level[i, j] == level[i, j] and level[i, j] != height[i, j]:
                patch.raise_cell(p, marks, i, j, level[i, j] - height[i, j])
    is_out = touched[0] <= 1 or touched[1] <= 1 or touched[2] >= head.rows - 1 or touched[3] >= head.columns - 1
    still = touched if is_out and touched[2] > touched[0] else now
    box[0], box[1] = head.row + still[0], head.column + still[1]
    box[2], box[3] = head.row + still[2], head.column + still[3]
