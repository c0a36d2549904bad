"""Bodies sweep sand: it is lowered to the lowest point of a body over each cell, and lies beside it afterwards.

What is displaced goes to the nearest cell that no body holds; where the body's surface moves across the sand rather
than into it, to the nearest before it. What a body rolls over, so that its surface moves less along the level than its
middle, comes out behind it and at its sides: in a continuum in plane strain a wheel leaves no rut.
"""

from typing import Final

import numpy as np
from numba import carray, types

from rftsim.engine import bodies, covers, instance, patch
from rftsim.law import ruts
from rftsim.law.body import header_at
from rftsim.law.layout import BLOCK, BOX_NUMBERS, prints_start
from rftsim.law.vectors import nine, to_world
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import doubles, on_stack, peek, poke, stack_doubles

RINGS: Final = 3
"""Rings of cells about one in which the nearest that no body holds is looked for first."""
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
def _find_targets(p, gap):
    """Fill the nearest cell that no body holds, for each; -1 where there is none. Passes down and up, to neighbours."""
    target, rows, columns = patch.target(p), patch.head(p).rows, patch.head(p).columns
    patch.head(p).has_targets = 1
    for i in range(rows):
        for j in range(columns):
            target[i, j] = -1.0 if patch.is_held(p, i, j, gap) else i * columns + j
    for way in (1, -1):
        for a in range(rows):
            i = a if way == 1 else rows - 1 - a
            for b in range(columns):
                j = b if way == 1 else columns - 1 - b
                _take_nearer(p, i, j, i, j - way)
                _take_nearer(p, i, j, i - way, j - way)
                _take_nearer(p, i, j, i - way, j)
                _take_nearer(p, i, j, i - way, j + way)
            for b in range(columns):
                j = columns - 1 - b if way == 1 else b
                _take_nearer(p, i, j, i, j + way)


@inline
def _distance2(p, i, j, cell):
    """The square of the distance to a cell, by its place in the patch [cells]."""
    columns = patch.head(p).columns
    row, column = int(cell) // columns, int(cell) % columns
    return (row - i) * (row - i) + (column - j) * (column - j)


@exact
def _take_nearer(p, i, j, a, b):
    """Let a cell have the target of another, where that is nearer than its own."""
    target, rows, columns = patch.target(p), patch.head(p).rows, patch.head(p).columns
    if not (0 <= a < rows and 0 <= b < columns) or target[a, b] < 0.0:
        return
    if target[i, j] < 0.0 or _distance2(p, i, j, target[a, b]) < _distance2(p, i, j, target[i, j]):
        target[i, j] = target[a, b]


@exact
def _nearest2(p, i, j, gap):
    """The square of the distance from a cell to the nearest that no body holds, within RINGS [cells]; else -1."""
    rows, columns, best = patch.head(p).rows, patch.head(p).columns, -1
    for ring in range(RINGS + 1):
        if 0 <= best <= ring * ring:
            break
        for a in range(max(i - ring, 0), min(i + ring + 1, rows)):
            step = 1 if abs(a - i) == ring else max(2 * ring, 1)
            for b in range(j - ring, j + ring + 1, step):
                away = (a - i) * (a - i) + (b - j) * (b - j)
                if 0 <= b < columns and (best < 0 or away < best) and not patch.is_held(p, a, b, gap):
                    best = away
    return best


@exact
def _drop_far(p, i, j, depth, steepest, gap):
    """Drop sand on the nearest cell that no body holds, farther than RINGS; whether there is any."""
    if patch.head(p).has_targets == 0:
        _find_targets(p, gap)
    cell, columns = int(patch.target(p)[i, j]), patch.head(p).columns
    if cell < 0:
        return False
    _drop(p, cell // columns, cell % columns, depth, steepest, gap)
    return True


@exact
def _spread(p, i, j, depth, steepest, gap):
    """Drop sand on the cells nearest to one that no body holds, on all of them the same; whether there is any."""
    rows, columns, away = patch.head(p).rows, patch.head(p).columns, _nearest2(p, i, j, gap)
    if away < 0:
        return _drop_far(p, i, j, depth, steepest, gap)
    reach, count = int(np.sqrt(float(away))) + 1, 0
    for counting in (True, False):
        for a in range(max(i - reach, 0), min(i + reach + 1, rows)):
            for b in range(max(j - reach, 0), min(j + reach + 1, columns)):
                if (a - i) * (a - i) + (b - j) * (b - j) != away or patch.is_held(p, a, b, gap):
                    continue
                if counting:
                    count += 1
                else:
                    _drop(p, a, b, depth / count, steepest, gap)
    return True


@exact
def _motion(model, m, t, address, p, i, j, marks, out):
    """Fill out with the velocity of the body's point over a cell, and with that of its middle along the level, (5,)."""
    head, twist = patch.head(p), doubles(stack_doubles(6), 6)
    body = instance.body(address, int(patch.mover(p)[i, j]))
    bodies.twist(t, body, twist[:3], twist[3:])
    at, v, w = t.xpos[3 * body : 3 * body + 3], twist[:3], twist[3:]
    x = (head.column + j) * marks.spacing - at[0]
    y = (head.row + i) * marks.spacing - at[1]
    z = patch.lowest(p)[i, j] - at[2]
    out[0], out[1], out[2] = v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x
    header = header_at(instance.surface(model, m, address, int(patch.mover(p)[i, j])))
    r, low, high = t.xmat[9 * body : 9 * body + 9], header.lowest, header.highest
    x, y, z = to_world(r, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    out[3], out[4] = v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z


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
                away = np.sqrt(float((row - i) * (row - i) + (column - j) * (column - j)))
                fall = height[i, j] - height[row, column] - steepest * away
                if away > 0.0 and fall > lowest and not patch.is_held(p, row, column, gap):
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
    if share == 0.0:
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
def lower(model, m, t, address, p, marks, repose):
    """Lower the sand to what bodies have swept, and raise it beside them; the volume that was displaced [m^3]."""
    height, lowest, flow = patch.height(p), patch.lowest(p), patch.flow(p)
    rows, columns, gap = patch.head(p).rows, patch.head(p).columns, ruts.GAP * marks.spacing
    displaced, motion, steepest = 0.0, doubles(stack_doubles(5), 5), repose * marks.spacing
    for i in range(rows):
        for j in range(columns):
            flow[i, j] = 0.0
    for i in range(rows):
        for j in range(columns):
            depth = height[i, j] - lowest[i, j]
            if not depth > 0.0:
                continue
            _motion(model, m, t, address, p, i, j, marks, motion)
            under = _roll_over(p, i, j, motion, depth, steepest, gap)
            if not _push(p, i, j, motion, depth - under, steepest, gap):
                depth = under  # nowhere to go in this patch: it stays, until the body has moved on
            flow[i, j] -= depth
            displaced += depth
    if displaced > 0.0:
        for i in range(rows):
            for j in range(columns):
                if flow[i, j] != 0.0:
                    patch.raise_cell(p, marks, i, j, flow[i, j])
    return displaced * marks.spacing * marks.spacing
