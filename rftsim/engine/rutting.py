"""Sand that remembers: when a step ends, what bodies have swept is marked in the ruts, and what is too steep slides.

The ruts are part of MuJoCo's plugin_state, see `layout.RUTS`: so they are copied, pickled and reset with the mjData.
They are looked at when a body can have moved by a part of a cell, and while sand slides in intervals of SLIDING.
"""

from typing import Final

import numpy as np

from rftsim.engine import bodies, instance, patch, slides, sweeps
from rftsim.law import field as fields
from rftsim.law import ruts
from rftsim.law.body import bed_at, header_at
from rftsim.law.layout import BLOCK, BLOCK_SIDE, BOX_NUMBERS, prints_start
from rftsim.law.vectors import to_world
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, release, stack_doubles, take
from rftsim.solver.motion import size_of

PART: Final = 1.0
"""How far a body may move before its marks are made [cells]."""
SLIDING: Final = 0.01
"""Time between two goes at sand that slides [s]."""
NEAR: Final = 2.0
"""Height over the sand at which prints are looked at [cells]."""
MARGIN: Final = 4
"""Cells about what bodies cover that are looked at."""
_TABLE: Final = patch.TABLE
_SAND: Final = instance.SAND_NUMBERS
_WINDOW: Final = 8
"""The window follows when what it is to hold comes nearer to its edge than one in so many of its cells."""


@exact
def _box(t, body, surface, out):
    """Fill out with the lowest and highest corner of a body's box, world frame [m], (6,)."""
    header, r, at = header_at(surface), t.xmat[9 * body : 9 * body + 9], t.xpos[3 * body : 3 * body + 3]
    low, high = header.lowest, header.highest
    middle = to_world(r, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    for k in range(3):
        half = 0.0
        for axis in range(3):
            half += 0.5 * abs(r[3 * k + axis]) * (high[axis] - low[axis])
        out[k], out[3 + k] = at[k] + middle[k] - half, at[k] + middle[k] + half


@exact
def _is_due(model, m, t, address, marks, head, h):
    """Count the time and the way since the ruts were looked at; whether they should be."""
    fastest, twist = 0.0, doubles(stack_doubles(6), 6)
    for k in range(instance.head(address).nbody):
        bodies.twist(t, instance.body(address, k), twist[:3], twist[3:])
        length = header_at(instance.surface(model, m, address, k)).gyration
        fastest = max(fastest, size_of(twist, length))
    head.travel += h * fastest
    head.clock += h
    slides_on = head.unsettled[2] > head.unsettled[0]
    return head.travel >= PART * marks.spacing or (slides_on and head.clock >= SLIDING)


@exact
def _join_block(t, body, field, marks, box, out):
    """Widen a box of cells by those below a block of a body's prints, by its box, where that is near the sand."""
    r, at = t.xmat[9 * body : 9 * body + 9], t.xpos[3 * body : 3 * body + 3]
    x, y, z = to_world(r, box[0], box[1], box[2])
    x, y, z, wide = x + at[0], y + at[1], z + at[2], doubles(stack_doubles(3), 3)
    for k in range(3):
        wide[k] = abs(r[3 * k]) * box[3] + abs(r[3 * k + 1]) * box[4] + abs(r[3 * k + 2]) * box[5]
    height, along, across = fields.surface_over(field, x, y)
    height += ruts.height(marks, x, y) + abs(along) * wide[0] + abs(across) * wide[1]
    if not z - wide[2] <= height + NEAR * marks.spacing:
        return
    cells = doubles(stack_doubles(4), 4)
    cells[0], cells[1] = ruts.cell(y - wide[1], marks.spacing), ruts.cell(x - wide[0], marks.spacing)
    cells[2], cells[3] = ruts.cell(y + wide[1], marks.spacing) + 1, ruts.cell(x + wide[0], marks.spacing) + 1
    _join(out, cells)


@exact
def _covers(model, m, t, address, k, field, marks, out):
    """Fill out with the rows and columns of cells that the k-th body is near to, (4,); whether there are any."""
    body, surface, box = instance.body(address, k), instance.surface(model, m, address, k), doubles(stack_doubles(6), 6)
    for axis in range(4):
        out[axis] = 0.0
    _box(t, body, surface, box)
    x, y = 0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4])
    height, along, across = fields.surface_over(field, x, y)
    rise = abs(along) * 0.5 * (box[3] - box[0]) + abs(across) * 0.5 * (box[4] - box[1])
    if not box[2] <= height + rise + BLOCK_SIDE * marks.spacing:
        return False
    header = header_at(surface)
    n = int(header.prints)
    count = (n + BLOCK - 1) // BLOCK
    boxes = doubles(surface + 8 * (prints_start(header) + 3 * n), BOX_NUMBERS * count)
    for block in range(count):
        _join_block(t, body, field, marks, boxes[BOX_NUMBERS * block : BOX_NUMBERS * (block + 1)], out)
    return out[2] > out[0]


@exact
def _join(box, other):
    """Widen a box of cells, first row and column and behind the last, (4,), to hold another, where that holds any."""
    if other[2] <= other[0]:
        return
    is_empty = box[2] <= box[0]
    for k in range(2):
        box[k] = other[k] if is_empty else min(box[k], other[k])
        box[2 + k] = other[2 + k] if is_empty else max(box[2 + k], other[2 + k])


@exact
def _follow(head, marks, cover):
    """Move the window, by whole blocks, where what bodies cover comes near its edge; whether it did.

    What leaves it is left behind.
    """
    origin, size, first, last = (
        (head.row, head.column),
        (marks.rows, marks.columns),
        (cover[0], cover[1]),
        (cover[2], cover[3]),
    )
    to = doubles(stack_doubles(2), 2)
    for axis in range(2):
        room = size[axis] // _WINDOW
        to[axis] = origin[axis]
        if first[axis] < origin[axis] + room or last[axis] > origin[axis] + size[axis] - room:
            middle = 0.5 * (first[axis] + last[axis] - size[axis])
            to[axis] = BLOCK_SIDE * np.floor(middle / BLOCK_SIDE + 0.5)
    if to[0] == origin[0] and to[1] == origin[1]:
        return False
    values, left = doubles(marks.cells, marks.rows * marks.columns), 0.0
    for i in range(marks.rows):
        for j in range(marks.columns):
            row, column = marks.row + i, marks.column + j
            if not (to[0] <= row < to[0] + marks.rows and to[1] <= column < to[1] + marks.columns):
                place = ruts.place_of(marks, row, column)
                left += values[place]
                values[place] = 0.0
    head.left += left * marks.spacing * marks.spacing
    head.row, head.column = to[0], to[1]
    return True


@exact
def _average(marks):
    """Fill the means of all blocks."""
    count = marks.rows * marks.columns
    values, blocks = doubles(marks.cells, count), doubles(marks.blocks, count // BLOCK_SIDE**2)
    for k in range(blocks.size):
        blocks[k] = 0.0
    for row in range(marks.row, marks.row + marks.rows):
        for column in range(marks.column, marks.column + marks.columns):
            value = values[ruts.place_of(marks, row, column)]
            blocks[ruts.block_place(marks, row // BLOCK_SIDE, column // BLOCK_SIDE)] += value / BLOCK_SIDE**2


@exact
def _fill_heights(p, field, marks):
    """Fill the heights of a patch's cells, and no body over them; the highest [m]."""
    head, heights, lowest, top = patch.head(p), patch.height(p), patch.lowest(p), -np.inf
    values = doubles(marks.cells, marks.rows * marks.columns)
    for i in range(head.rows):
        for j in range(head.columns):
            row, column = head.row + i, head.column + j
            height, _, _ = fields.surface_over(field, column * marks.spacing, row * marks.spacing)
            heights[i, j] = height + values[ruts.place_of(marks, row, column)]
            lowest[i, j] = np.inf
            top = max(top, heights[i, j])
    return top


@exact
def _lay_out(p, marks, box):
    """Lay out a patch of a box of cells and a margin, as far as it lies in the window; bytes, or zero for no cells."""
    table = patch.head(p)
    row, column = max(box[0] - MARGIN, float(marks.row)), max(box[1] - MARGIN, float(marks.column))
    end = min(box[2] + MARGIN, float(marks.row + marks.rows)), min(box[3] + MARGIN, float(marks.column + marks.columns))
    table.row, table.column = int(row), int(column)
    table.rows, table.columns = int(end[0]) - table.row, int(end[1]) - table.column
    return patch.lay_out(p) if table.rows > 2 and table.columns > 2 else 0


@exact
def _is_over(p, t, marks, body, surface):
    """Whether a body's box lies over cells of a patch."""
    box, head = doubles(stack_doubles(6), 6), patch.head(p)
    _box(t, body, surface, box)
    apart = ruts.cell(box[4], marks.spacing) < head.row or ruts.cell(box[1], marks.spacing) >= head.row + head.rows
    beside = ruts.cell(box[3], marks.spacing) < head.column
    return not (apart or beside or ruts.cell(box[0], marks.spacing) >= head.column + head.columns)


@exact
def _work(model, m, t, address, field, head, marks, box, repose):
    """Mark and slide in a box of cells, first row and column and behind the last, (4,)."""
    p = stack_doubles(_TABLE)
    size = _lay_out(p, marks, box)
    memory = take(size) if size > 0 else 0
    if memory == 0:
        return
    patch.place(p, memory)
    patch.head(p).has_targets = 0
    top = _fill_heights(p, field, marks)
    for k in range(instance.head(address).nbody):
        body, surface = instance.body(address, k), instance.surface(model, m, address, k)
        if _is_over(p, t, marks, body, surface):
            sweeps.press(p, t, marks, top, body, k, surface)
    head.moved += sweeps.lower(model, m, t, address, p, marks, repose)
    slid, on = slides.settle(p, marks, repose), doubles(stack_doubles(4), 4)
    on[0], on[1] = patch.head(p).row + slid[0], patch.head(p).column + slid[1]
    on[2], on[3] = patch.head(p).row + slid[2], patch.head(p).column + slid[3]
    _join(head.unsettled, on)
    release(memory)


@exact
def _look(model, m, t, address, sand, at):
    """Mark what was swept since the ruts were looked at, and let sand slide."""
    head, bed = ruts.ruts_at(at), bed_at(fields.sand_at(sand).bed)
    marks, field = ruts.marks_of(fields.sand_at(sand).bed, at), fields.field_of(sand, False)
    box, cover, sliding = doubles(stack_doubles(4), 4), doubles(stack_doubles(4), 4), doubles(stack_doubles(4), 4)
    for k in range(4):
        sliding[k], head.unsettled[k], cover[k] = head.unsettled[k], 0.0, 0.0
    head.travel = head.clock = 0.0
    for k in range(instance.head(address).nbody):
        if _covers(model, m, t, address, k, field, marks, box):
            _join(cover, box)
    if cover[2] > cover[0] and _follow(head, marks, cover):
        marks = ruts.marks_of(fields.sand_at(sand).bed, at)
        _average(marks)
    for k in range(instance.head(address).nbody):
        if _covers(model, m, t, address, k, field, marks, box):
            _work(model, m, t, address, field, head, marks, box, bed.mu_int)
    if sliding[2] > sliding[0]:
        _work(model, m, t, address, field, head, marks, sliding, bed.mu_int)


@exact
def remember(model, data, m, d, number):
    """End a step of an instance whose bed remembers: mark what was swept, and let sand slide."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0 or instance.head(address).ruts_size == 0:
        return
    sand = stack_doubles(_SAND)
    instance.fill_sand(model, m, address, sand)
    at, t = fields.sand_at(sand).ruts, bodies.tree(model, data, m, d)
    marks, h = ruts.marks_of(fields.sand_at(sand).bed, at), doubles(m + model.opt_timestep, 1)[0]
    if _is_due(model, m, t, address, marks, ruts.ruts_at(at), h):
        _look(model, m, t, address, sand, at)
