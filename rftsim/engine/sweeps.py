"""Bodies sweep sand: it is lowered to the lowest point of a body over each cell, and lies beside it afterwards.

What is displaced goes to the nearest cell that no body holds; where the body's surface moves across the sand rather
than into it, to the nearest before it. What a body rolls over, so that its surface moves less along the level than its
middle, comes out behind it and at its sides: in a continuum in plane strain a wheel leaves no rut.
"""

from collections import namedtuple
from typing import Final

import numpy as np
from numba import carray, types

from rftsim.engine import bodies, covers, instance, patch
from rftsim.law import ruts
from rftsim.law.body import header_at
from rftsim.law.layout import BLOCK, BOX_NUMBERS, prints_start
from rftsim.law.vectors import nine, to_world
from rftsim.machine.compiling import exact, loop
from rftsim.machine.memory import doubles, on_stack, peek, poke, stack_doubles

RINGS: Final = 3
"""Rings of cells about one in which the nearest that no body holds is looked for first."""
LEAST: Final = 0.02
"""Depth to which a body may lie in the sand before it is lowered [cells]."""
ROLLING: Final = 0.02
"""Least share of what is displaced that comes out behind what rolls over it, if any does."""
_WAYS: Final = 9
"""Directions to a cell's neighbours, and itself in their middle."""
ACROSS: Final = 0.5
"""Share of a surface's speed along the level from which on it pushes the sand ahead by a cell."""
_found = on_stack(3 * BLOCK, types.float64)


@loop
def _place_prints(prints, first, n, count, r, at, per, out):
    """Fill out with the height [m], the row and the column of each of count prints from one of n on, column by column.

    Args:
        prints: Their places, body frame [m], three columns of n.
        first: The first of them.
        n: How many there are in all.
        count: How many to look at, at most BLOCK.
        r: Body to world, row-major, (9,).
        at: Position of the body's origin [m], (3,).
        per: Cells per metre.
        out: (3 BLOCK,).
    """
    for i in range(count):
        x, y, z = peek(prints, first + i), peek(prints, first + i + n), peek(prints, first + i + 2 * n)
        poke(out, i, at[2] + r[6] * x + r[7] * y + r[8] * z)
        poke(out, i + BLOCK, np.floor((at[1] + r[3] * x + r[4] * y + r[5] * z) * per + 0.5))
        poke(out, i + 2 * BLOCK, np.floor((at[0] + r[0] * x + r[1] * y + r[2] * z) * per + 0.5))


@exact
def _is_over(p, marks, box, top):
    """Whether a box in the world, by its centre and half its size [m], (6,), comes below a height over the patch."""
    head, x = patch.head(p), marks.spacing
    is_in = box[1] + box[4] >= (head.row - 0.5) * x and box[1] - box[4] <= (head.row + head.rows - 0.5) * x
    is_in = is_in and box[0] + box[3] >= (head.column - 0.5) * x
    return is_in and box[0] - box[3] <= (head.column + head.columns - 0.5) * x and box[2] - box[5] <= top


@exact
def press(p, t, marks, top, body, k, surface):
    """Note the lowest points of the k-th body of a bed over the cells of the patch, of those below a height [m]."""
    header, matrix, position = header_at(surface), t.xmat[9 * body : 9 * body + 9], t.xpos[3 * body : 3 * body + 3]
    box, found = doubles(stack_doubles(6), 6), carray(_found(), (3 * BLOCK,))
    covers.extent(t, body, surface, box)
    if not _is_over(p, marks, box, top):
        return
    n, r, at = int(header.prints), nine(matrix), (position[0], position[1], position[2])
    count = (n + BLOCK - 1) // BLOCK
    numbers = doubles(surface + 8 * prints_start(header), 3 * n + BOX_NUMBERS * count)
    for block in range(count):
        start = 3 * n + BOX_NUMBERS * block
        covers.place_box(r, at, numbers[start : start + BOX_NUMBERS], box)
        if _is_over(p, marks, box, top):
            some = min(BLOCK, n - BLOCK * block)
            _place_prints(numbers, BLOCK * block, n, some, r, at, 1.0 / marks.spacing, found)
            _note(p, found, some, k)


@exact
def _note(p, found, count, k):
    """Note the heights of so many points of the k-th body, see `_place_prints`."""
    lowest, mover, head = patch.flat(p, patch.lowest(p)), patch.flat(p, patch.mover(p)), patch.head(p)
    rows, columns = float(head.rows), float(head.columns)
    for i in range(count):
        row, column = peek(found, i + BLOCK) - head.row, peek(found, i + 2 * BLOCK) - head.column
        if 0.0 <= row < rows and 0.0 <= column < columns:
            cell = int(row) * head.columns + int(column)
            if peek(found, i) < peek(lowest, cell):
                poke(lowest, cell, peek(found, i))
                poke(mover, cell, float(k))


@exact
def _nearest2(p, i, j, gap):
    """The square of the distance from a cell to the nearest ones that no body holds, within RINGS [cells]; else -1.

    And how many they are.
    """
    rows, columns, best, count = patch.head(p).rows, patch.head(p).columns, -1, 0
    for ring in range(RINGS + 1):
        if 0 <= best < ring * ring:
            break
        for a in range(max(i - ring, 0), min(i + ring + 1, rows)):
            step = 1 if abs(a - i) == ring else max(2 * ring, 1)
            for b in range(j - ring, j + ring + 1, step):
                away = (a - i) * (a - i) + (b - j) * (b - j)
                if 0 <= b < columns and (best < 0 or away <= best) and not patch.is_held(p, a, b, gap):
                    count = count + 1 if away == best else 1
                    best = away
    return best, count


@exact
def _drop_far(p, i, j, depth, steepest, gap):
    """Drop sand on the nearest cells that no body holds, of those along rows, columns and diagonals; whether any is."""
    walks, best, count = doubles(stack_doubles(_WAYS), _WAYS), np.inf, 0
    for way in range(_WAYS):
        x, y = float(way % 3 - 1), float(way // 3 - 1)
        n = _walk(p, i, j, x, y, gap) if way != _WAYS // 2 else 0
        walks[way] = n * np.sqrt(x * x + y * y) if n > 0 else np.inf
        best = min(best, walks[way])
    for way in range(_WAYS):
        count += walks[way] < np.inf and walks[way] == best
    if count == 0:
        return False
    for way in range(_WAYS):
        x, y = float(way % 3 - 1), float(way // 3 - 1)
        if walks[way] == best:
            n = int(np.rint(best / np.sqrt(x * x + y * y)))
            _give(p, i, j, x, y, n, depth / count, steepest, gap)
    return True


@exact
def _spread(p, i, j, depth, steepest, gap):
    """Drop sand on the cells nearest to one that no body holds, on all of them the same; whether there is any."""
    rows, columns, (away, count) = patch.head(p).rows, patch.head(p).columns, _nearest2(p, i, j, gap)
    if away < 0:
        return _drop_far(p, i, j, depth, steepest, gap)
    reach = int(np.sqrt(float(away)))
    for a in range(max(i - reach, 0), min(i + reach + 1, rows)):
        for b in range(max(j - reach, 0), min(j + reach + 1, columns)):
            if (a - i) * (a - i) + (b - j) * (b - j) == away and not patch.is_held(p, a, b, gap):
                _drop(p, a, b, depth / count, steepest, gap)
    return True


_Motion = namedtuple("_Motion", ["v", "w", "at", "along", "across"])
_Motion.__doc__ = """A body's velocity [m/s] and angular velocity [rad/s]; where it is [m]; and its middle's velocity
along the level [m/s]."""


@exact
def _motion_of(model, m, t, address, k):
    """How the k-th body moves, see _Motion."""
    twist, body, surface = (
        doubles(stack_doubles(6), 6),
        instance.body(address, k),
        instance.surface(model, m, address, k),
    )
    bodies.twist(t, body, twist[:3], twist[3:])
    v, w, at = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5]), t.xpos[3 * body : 3 * body + 3]
    r, low, high = t.xmat[9 * body : 9 * body + 9], header_at(surface).lowest, header_at(surface).highest
    x, y, z = to_world(r, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    return _Motion(v, w, (at[0], at[1], at[2]), v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z)


@exact
def _fill_motion(p, own, i, j, marks, out):
    """Fill out with the velocity of the body's point over a cell, and with that of its middle along the level, (5,)."""
    head, (v, w, at) = patch.head(p), (own.v, own.w, own.at)
    x, y = (head.column + j) * marks.spacing - at[0], (head.row + i) * marks.spacing - at[1]
    z = patch.lowest(p)[i, j] - at[2]
    out[0], out[1], out[2] = v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x
    out[3], out[4] = own.along, own.across


@exact
def _walk(p, i, j, x, y, gap):
    """Cells to the nearest that no body holds, in a direction along columns and rows; zero where there is none."""
    rows, columns, n = patch.head(p).rows, patch.head(p).columns, 1
    while True:
        a, b = int(np.floor(i + n * y + 0.5)), int(np.floor(j + n * x + 0.5))
        if a < 0 or b < 0 or a >= rows or b >= columns:
            return 0
        if not patch.is_held(p, a, b, gap):
            return n
        n += 1


@exact
def _drop(p, i, j, depth, steepest, gap):
    """Let the sand of a cell rise; on a slope that is too steep, that of the cell down to which it rolls."""
    height, rows, columns = patch.height(p), patch.head(p).rows, patch.head(p).columns
    while True:
        lowest, a, b = 0.0, i, j
        for row in range(max(i - 1, 0), min(i + 2, rows)):
            for column in range(max(j - 1, 0), min(j + 2, columns)):
                away = patch.DIAGONAL if row != i and column != j else 1.0
                fall = height[i, j] - height[row, column] - steepest * away
                if fall > lowest and not patch.is_held(p, row, column, gap):
                    lowest, a, b = fall, row, column
        if lowest == 0.0:
            patch.flow(p)[i, j] += depth
            return
        i, j = a, b


@exact
def _give(p, i, j, x, y, n, depth, steepest, gap):
    """Drop sand on the cell that lies n cells on in a direction."""
    _drop(p, int(np.floor(i + n * y + 0.5)), int(np.floor(j + n * x + 0.5)), depth, steepest, gap)


@exact
def _roll_over(p, i, j, motion, depth, steepest, gap):
    """Let what a body rolls over come out behind it and at its sides, the nearer the more; how much that is [m]."""
    speed = np.sqrt(motion[3] * motion[3] + motion[4] * motion[4])
    slow = np.sqrt(motion[0] * motion[0] + motion[1] * motion[1])
    share = 1.0 - slow / speed if slow < speed else 0.0
    if share < ROLLING:
        return 0.0
    x, y = motion[3] / speed, motion[4] / speed
    back, left, right = _walk(p, i, j, -x, -y, gap), _walk(p, i, j, -y, x, gap), _walk(p, i, j, y, -x, gap)
    total = (1.0 / back if back > 0 else 0.0) + (1.0 / left if left > 0 else 0.0) + (1.0 / right if right > 0 else 0.0)
    if total == 0.0:
        return 0.0
    unit = share * depth / total
    if back > 0:
        _give(p, i, j, -x, -y, back, unit / back, steepest, gap)
    if left > 0:
        _give(p, i, j, -y, x, left, unit / left, steepest, gap)
    if right > 0:
        _give(p, i, j, y, -x, right, unit / right, steepest, gap)
    return share * depth


@exact
def _push(p, i, j, motion, depth, steepest, gap):
    """Let the nearest cells rise that no body holds: before the body, where it moves across; whether there are any."""
    rows, columns = patch.head(p).rows, patch.head(p).columns
    speed = np.sqrt(motion[0] * motion[0] + motion[1] * motion[1] + motion[2] * motion[2])
    row = i + (1 if motion[1] > ACROSS * speed else (-1 if motion[1] < -ACROSS * speed else 0))
    column = j + (1 if motion[0] > ACROSS * speed else (-1 if motion[0] < -ACROSS * speed else 0))
    row, column = min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)
    return _spread(p, row, column, depth, steepest, gap)


@exact
def lower(model, m, t, address, p, marks, repose, box):
    """Lower the sand to what bodies have swept, and raise it beside them; the volume that was displaced [m^3].

    A box of cells of the ground, (4,), is widened by those that rise or fall.
    """
    height, lowest, flow, mover = patch.height(p), patch.lowest(p), patch.flow(p), patch.mover(p)
    rows, columns, gap = patch.head(p).rows, patch.head(p).columns, ruts.GAP * marks.spacing
    displaced, motion, steepest = 0.0, doubles(stack_doubles(5), 5), repose * marks.spacing
    for i in range(rows):
        for j in range(columns):
            flow[i, j] = 0.0
    last = 0
    own = _motion_of(model, m, t, address, last)
    for i in range(rows):
        for j in range(columns):
            depth = height[i, j] - lowest[i, j]
            if not depth > LEAST * marks.spacing:
                continue
            if int(mover[i, j]) != last:
                last = int(mover[i, j])
                own = _motion_of(model, m, t, address, last)
            _fill_motion(p, own, i, j, marks, motion)
            under = _roll_over(p, i, j, motion, depth, steepest, gap)
            if not _push(p, i, j, motion, depth - under, steepest, gap):
                depth = under  # nowhere to go in this patch: it stays, until the body has moved on
            flow[i, j] -= depth
            displaced += depth
    if displaced > 0.0:
        _raise_all(p, marks, box)
    return displaced * marks.spacing * marks.spacing


@exact
def _raise_all(p, marks, box):
    """Let all cells of a patch rise by their flow, and widen a box of cells of the ground by them, (4,)."""
    flow, head = patch.flow(p), patch.head(p)
    for i in range(head.rows):
        for j in range(head.columns):
            if flow[i, j] != 0.0:
                patch.raise_cell(p, marks, i, j, flow[i, j])
                row, column = head.row + i, head.column + j
                box[0], box[1] = min(box[0], row), min(box[1], column)
                box[2], box[3] = max(box[2], row + 1), max(box[3], column + 1)
