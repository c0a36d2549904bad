"""What bodies sweep: the sand is lowered to the lowest point of a body over each cell, and lies beside it afterwards.

What is displaced goes to the nearest cell that no body holds; where the body's surface moves across the sand rather
than into it, to the nearest before it. What a body rolls over, so that its surface moves less along the level than its
middle, comes out behind it and at its sides: in a continuum in plane strain a wheel leaves no rut.
"""

from typing import Final

import numpy as np

from rftsim.engine import bodies, instance, patch
from rftsim.law import ruts
from rftsim.law.body import header_at
from rftsim.law.layout import BLOCK, BOX_NUMBERS, prints_start
from rftsim.law.vectors import to_world
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, peek, stack_doubles

ACROSS: Final = 0.5
"""Share of a surface's speed along the level from which on it pushes the sand ahead by a cell."""


@exact
def press(p, t, marks, top, body, k, surface):
    """Note the lowest points of the k-th body of a bed over the cells of the patch, of those below a height [m]."""
    header, r = header_at(surface), t.xmat[9 * body : 9 * body + 9]
    n, at = int(header.prints), t.xpos[3 * body : 3 * body + 3]
    numbers = doubles(surface + 8 * prints_start(header), 3 * n + BOX_NUMBERS * ((n + BLOCK - 1) // BLOCK))
    lowest, mover, rows, columns = patch.lowest(p), patch.mover(p), patch.head(p).rows, patch.head(p).columns
    for start in range(0, n, BLOCK):
        box = 3 * n + BOX_NUMBERS * (start // BLOCK)
        _, _, middle = to_world(r, peek(numbers, box), peek(numbers, box + 1), peek(numbers, box + 2))
        half = (
            abs(r[6]) * peek(numbers, box + 3) + abs(r[7]) * peek(numbers, box + 4) + abs(r[8]) * peek(numbers, box + 5)
        )
        if not at[2] + middle - half <= top:
            continue
        for i in range(start, min(start + BLOCK, n)):
            x, y, z = to_world(r, peek(numbers, i), peek(numbers, i + n), peek(numbers, i + 2 * n))
            row = ruts.cell(y + at[1], marks.spacing) - patch.head(p).row
            column = ruts.cell(x + at[0], marks.spacing) - patch.head(p).column
            if 0 <= row < rows and 0 <= column < columns and z + at[2] < lowest[row, column]:
                lowest[row, column], mover[row, column] = z + at[2], k


@exact
def _find_targets(p, gap):
    """Fill the nearest cell that no body holds, for each; whether there is any. Passes down and up, to neighbours."""
    target, rows, columns = patch.target(p), patch.head(p).rows, patch.head(p).columns
    found = False
    for i in range(rows):
        for j in range(columns):
            is_free = not patch.is_held(p, i, j, gap)
            target[i, j] = i * columns + j if is_free else -1.0
            found = found or is_free
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
    return found


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
    """Let the nearest cell rise that no body holds: before the body, where that moves across the sand."""
    rows, columns = patch.head(p).rows, patch.head(p).columns
    speed = np.sqrt(motion[0] * motion[0] + motion[1] * motion[1] + motion[2] * motion[2])
    row = i + (1 if motion[1] > ACROSS * speed else (-1 if motion[1] < -ACROSS * speed else 0))
    column = j + (1 if motion[0] > ACROSS * speed else (-1 if motion[0] < -ACROSS * speed else 0))
    cell = int(patch.target(p)[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)])
    _drop(p, cell // columns, cell % columns, depth, steepest, gap)


@exact
def lower(model, m, t, address, p, marks, repose):
    """Lower the sand to what bodies have swept, and raise it beside them; the volume that was displaced [m^3]."""
    height, lowest = patch.height(p), patch.lowest(p)
    rows, columns, gap = patch.head(p).rows, patch.head(p).columns, ruts.GAP * marks.spacing
    if not _find_targets(p, gap):
        return 0.0
    flow, displaced, motion = patch.flow(p), 0.0, doubles(stack_doubles(5), 5)
    steepest = repose * marks.spacing
    for i in range(rows):
        for j in range(columns):
            flow[i, j] = 0.0
    for i in range(rows):
        for j in range(columns):
            depth = height[i, j] - lowest[i, j]
            if not depth > 0.0:
                continue
            _motion(model, m, t, address, p, i, j, marks, motion)
            flow[i, j] -= depth
            under = _roll_over(p, i, j, motion, depth, steepest, gap)
            _push(p, i, j, motion, depth - under, steepest, gap)
            displaced += depth
    if displaced > 0.0:
        for i in range(rows):
            for j in range(columns):
                if flow[i, j] != 0.0:
                    patch.raise_cell(p, marks, i, j, flow[i, j])
    return displaced * marks.spacing * marks.spacing
