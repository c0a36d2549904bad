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
from rftsim.law.layout import BLOCK_SIDE
from rftsim.law.vectors import to_world
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, release, stack_doubles, take
from rftsim.solver.motion import size_of

PART: Final = 0.25
"""How far a body may move before its marks are made [cells]."""
SLIDING: Final = 5e-3
"""Time between two goes at sand that slides [s]."""
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
def _cover(model, m, t, address, field, marks, out):
    """Fill out with the rows and columns that bodies near the sand cover, first and behind the last, (4,); or none."""
    box, reach = doubles(stack_doubles(6), 6), BLOCK_SIDE * marks.spacing
    out[0], out[1], out[2], out[3] = 1e15, 1e15, -1e15, -1e15
    for k in range(instance.head(address).nbody):
        _box(t, instance.body(address, k), instance.surface(model, m, address, k), box)
        x, y = 0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4])
        height, along, across = fields.surface_over(field, x, y)
        rise = abs(along) * 0.5 * (box[3] - box[0]) + abs(across) * 0.5 * (box[4] - box[1])
        if not box[2] <= height + rise + reach:
            continue
        out[0] = min(out[0], ruts.cell(box[1], marks.spacing))
        out[1] = min(out[1], ruts.cell(box[0], marks.spacing))
        out[2] = max(out[2], ruts.cell(box[4], marks.spacing) + 1)
        out[3] = max(out[3], ruts.cell(box[3], marks.spacing) + 1)
    return out[2] > out[0]


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
def _average(marks, row, column, rows, columns):
    """Fill the means of the blocks that a rectangle of cells touches, within the window."""
    wide = marks.columns // BLOCK_SIDE
    high = marks.rows // BLOCK_SIDE
    values, blocks = doubles(marks.cells, marks.rows * marks.columns), doubles(marks.blocks, wide * high)
    for i in range(row // BLOCK_SIDE, (row + rows + BLOCK_SIDE - 1) // BLOCK_SIDE):
        for j in range(column // BLOCK_SIDE, (column + columns + BLOCK_SIDE - 1) // BLOCK_SIDE):
            total = 0.0
            for a in range(BLOCK_SIDE):
                for b in range(BLOCK_SIDE):
                    total += values[ruts.place_of(marks, BLOCK_SIDE * i + a, BLOCK_SIDE * j + b)]
            blocks[(i & (high - 1)) * wide + (j & (wide - 1))] = total / (BLOCK_SIDE * BLOCK_SIDE)


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
def _clip(head, marks, cover, is_covered):
    """The rectangle to be worked on: what bodies cover and what slides, and a margin, within the window; (4,)."""
    low, high = (1e15, 1e15), (-1e15, -1e15)
    if is_covered:
        low, high = (cover[0], cover[1]), (cover[2], cover[3])
    on = head.unsettled
    if on[2] > on[0]:
        low = min(low[0], on[0]), min(low[1], on[1])
        high = max(high[0], on[2]), max(high[1], on[3])
    row, column = max(low[0] - MARGIN, float(marks.row)), max(low[1] - MARGIN, float(marks.column))
    end = (
        min(high[0] + MARGIN, float(marks.row + marks.rows)),
        min(high[1] + MARGIN, float(marks.column + marks.columns)),
    )
    return int(row), int(column), int(end[0]), int(end[1])


@exact
def _work(model, m, t, address, field, head, marks, rectangle, repose):
    """Mark and slide in a rectangle of cells, see `_clip`."""
    p = stack_doubles(_TABLE)
    table = patch.head(p)
    table.row, table.column = rectangle[0], rectangle[1]
    table.rows, table.columns = rectangle[2] - rectangle[0], rectangle[3] - rectangle[1]
    memory = take(patch.lay_out(p))
    if memory == 0:
        return
    patch.place(p, memory)
    top = _fill_heights(p, field, marks)
    for k in range(instance.head(address).nbody):
        sweeps.press(p, t, marks, top, instance.body(address, k), k, instance.surface(model, m, address, k))
    head.moved += sweeps.lower(model, m, t, address, p, marks)
    slid = slides.settle(p, marks, repose)
    on = head.unsettled
    on[0], on[1], on[2], on[3] = 0.0, 0.0, 0.0, 0.0
    if slid[2] >= 0:
        on[0], on[1] = table.row + slid[0], table.column + slid[1]
        on[2], on[3] = table.row + slid[2] + 1, table.column + slid[3] + 1
    _average(marks, table.row, table.column, table.rows, table.columns)
    release(memory)


@exact
def remember(model, data, m, d, number):
    """End a step of an instance whose bed remembers: mark what was swept, and let sand slide."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0 or instance.head(address).ruts_size == 0:
        return
    sand = stack_doubles(_SAND)
    instance.fill_sand(model, m, address, sand)
    at = fields.sand_at(sand).ruts
    head, bed = ruts.ruts_at(at), bed_at(fields.sand_at(sand).bed)
    marks, t = ruts.marks_of(fields.sand_at(sand).bed, at), bodies.tree(model, data, m, d)
    if not _is_due(model, m, t, address, marks, head, doubles(m + model.opt_timestep, 1)[0]):
        return
    head.travel = head.clock = 0.0
    field, cover = fields.field_of(sand, False), doubles(stack_doubles(4), 4)
    is_covered = _cover(model, m, t, address, field, marks, cover)
    if is_covered and _follow(head, marks, cover):
        marks = ruts.marks_of(fields.sand_at(sand).bed, at)
        _average(marks, marks.row, marks.column, marks.rows, marks.columns)
    rectangle = _clip(head, marks, cover, is_covered)
    if rectangle[2] > rectangle[0] and rectangle[3] > rectangle[1]:
        _work(model, m, t, address, field, head, marks, rectangle, bed.mu_int)
