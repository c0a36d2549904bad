"""What bodies sweep: the sand is lowered to the lowest point of a body over each cell, and lies beside it afterwards.

What is displaced goes to the nearest cell that no body holds; where the body's surface moves across the sand rather
than into it, to the nearest before it.
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
def _ahead(model, m, t, address, p, i, j, marks):
    """The cell from which the target of a displaced one counts: a cell ahead, where the body moves across the sand."""
    head, twist = patch.head(p), doubles(stack_doubles(6), 6)
    body = instance.body(address, int(patch.mover(p)[i, j]))
    bodies.twist(t, body, twist[:3], twist[3:])
    at, v, w = t.xpos[3 * body : 3 * body + 3], twist[:3], twist[3:]
    x = (head.column + j) * marks.spacing - at[0], (head.row + i) * marks.spacing - at[1], patch.lowest(p)[i, j] - at[2]
    vx, vy, vz = v[0] + w[1] * x[2] - w[2] * x[1], v[1] + w[2] * x[0] - w[0] * x[2], v[2] + w[0] * x[1] - w[1] * x[0]
    speed = np.sqrt(vx * vx + vy * vy + vz * vz)
    row = i + (1 if vy > ACROSS * speed else (-1 if vy < -ACROSS * speed else 0))
    column = j + (1 if vx > ACROSS * speed else (-1 if vx < -ACROSS * speed else 0))
    return min(max(row, 0), head.rows - 1), min(max(column, 0), head.columns - 1)


@exact
def lower(model, m, t, address, p, marks):
    """Lower the sand to what bodies have swept, and raise it beside them; the volume that was displaced [m^3]."""
    height, lowest, target = patch.height(p), patch.lowest(p), patch.target(p)
    rows, columns, gap = patch.head(p).rows, patch.head(p).columns, ruts.GAP * marks.spacing
    if not _find_targets(p, gap):
        return 0.0
    flow, displaced = patch.flow(p), 0.0
    for i in range(rows):
        for j in range(columns):
            flow[i, j] = 0.0
    for i in range(rows):
        for j in range(columns):
            depth = height[i, j] - lowest[i, j]
            if not depth > 0.0:
                continue
            a, b = _ahead(model, m, t, address, p, i, j, marks)
            cell = int(target[a, b])
            flow[i, j] -= depth
            flow[cell // columns, cell % columns] += depth
            displaced += depth
    if displaced > 0.0:
        for i in range(rows):
            for j in range(columns):
                if flow[i, j] != 0.0:
                    patch.raise_cell(p, marks, i, j, flow[i, j])
    return displaced * marks.spacing * marks.spacing
