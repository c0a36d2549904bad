"""Sand that remembers: when a step ends, what bodies have swept is marked in the ruts, and what is too steep slides.

The ruts are part of MuJoCo's plugin_state, see `layout.RUTS`: so they are copied, pickled and reset with the mjData.
A body's marks are made when it can have moved by a part of a cell, and when it begins to rise; what slides elsewhere is
looked at in intervals of SLIDING.
"""

from typing import Final

import numpy as np

from rftsim.engine import bodies, covers, instance, patch, slides, sweeps
from rftsim.law import field as fields
from rftsim.law import ruts
from rftsim.law.body import bed_at, header_at
from rftsim.law.layout import BLOCK_SIDE
from rftsim.law.spline import values_of
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, matrix, release, stack_doubles, take
from rftsim.solver.motion import size_of

PART: Final = 1.0
"""How far a body may move before its marks are made [cells]."""
LEAST: Final = 0.02
"""How far it must have moved for marks to be made when it begins to rise [cells]."""
SLIDING: Final = 0.02
"""Time between two goes at sand that slides where nothing moves [s]."""
MARGIN: Final = 4
"""Cells about what bodies cover that are looked at."""
_TABLE: Final = patch.TABLE
_SAND: Final = instance.SAND_NUMBERS
_WINDOW: Final = 8
"""The window follows when what it is to hold comes nearer to its edge than one in so many of its cells."""


@exact
def _move_on(model, m, t, address, k, marks, h):
    """Count the way of the k-th body in a step; whether its marks are to be made."""
    trace, twist = instance.trace(address, k), doubles(stack_doubles(6), 6)
    bodies.twist(t, instance.body(address, k), twist[:3], twist[3:])
    trace.travel += h * size_of(twist, header_at(instance.surface(model, m, address, k)).gyration)
    was_rising, trace.rising = trace.rising, 1.0 if twist[2] > 0.0 else 0.0
    rises = trace.rising > was_rising and trace.travel >= LEAST * marks.spacing
    return rises or trace.travel >= PART * marks.spacing


@exact
def _choose(model, m, t, address, marks, h, boxes):
    """Fill the first number of each body's box, (n, 4): whether its marks are to be made (1 or 0); whether any are.

    Or what slides about one is due.
    """
    head, is_due, slides_on = ruts.ruts_at(instance.ruts(address)), False, False
    head.clock += h
    for k in range(len(boxes)):
        moves = _move_on(model, m, t, address, k, marks, h)
        boxes[k, 0] = 1.0 if moves else 0.0
        is_due = is_due or moves
        slides_on = slides_on or not covers.is_empty(instance.trace(address, k).unsettled)
    return is_due or (slides_on and head.clock >= SLIDING)


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
    values, blocks = doubles(marks.cells, marks.rows * marks.columns), values_of(marks.blocks)
    for k in range(blocks.size):
        blocks[k] = 0.0
    for row in range(marks.row, marks.row + marks.rows):
        for column in range(marks.column, marks.column + marks.columns):
            value = values[ruts.place_of(marks, row, column)]
            blocks[ruts.block_place(marks, row, column)] += value / BLOCK_SIDE**2


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
def _work(model, m, t, address, field, marks, box, repose, passed):
    """Mark and slide in a box of cells, which becomes that of what still slides; the volume displaced [m^3]."""
    p = stack_doubles(_TABLE)
    size = _lay_out(p, marks, box)
    memory = take(size) if size > 0 else 0
    if memory == 0:
        covers.empty(box)
        return 0.0
    patch.place(p, memory)
    top = patch.fill(p, field, marks)
    for k in range(instance.head(address).nbody):
        sweeps.press(p, t, marks, top, instance.body(address, k), k, instance.surface(model, m, address, k))
    moved = sweeps.lower(model, m, t, address, p, marks, repose, box)
    slides.settle(p, marks, repose, passed, box)
    release(memory)
    return moved


@exact
def _recentre(model, m, t, address, field, marks):
    """Let the window follow all bodies that are near the sand; whether it moved."""
    cover = doubles(stack_doubles(4), 4)
    covers.empty(cover)
    for k in range(instance.head(address).nbody):
        covers.add_body(t, instance.body(address, k), instance.surface(model, m, address, k), field, marks, cover)
    return not covers.is_empty(cover) and _follow(ruts.ruts_at(instance.ruts(address)), marks, cover)


@exact
def _gather(model, m, t, address, field, marks, slides_all, boxes):
    """Fill the boxes, (n, 4), with the cells to look at about each body: what it covers, if it moved, and what slides.

    Those that overlap are joined. Where a body did not move, nothing slides unless all is to.
    """
    for k in range(len(boxes)):
        trace, moves = instance.trace(address, k), boxes[k, 0] > 0.0
        covers.empty(boxes[k])
        if moves:
            trace.travel = 0.0
            surface = instance.surface(model, m, address, k)
            covers.add_prints(t, instance.body(address, k), surface, field, marks, boxes[k])
        if moves or slides_all:
            covers.join(boxes[k], trace.unsettled)
            covers.empty(trace.unsettled)
    covers.merge(boxes)


@exact
def _look(model, m, t, address, sand, boxes, h):
    """Mark what was swept since the ruts were looked at, and let sand slide."""
    at, bed = instance.ruts(address), fields.sand_at(sand).bed
    head, marks, field = ruts.ruts_at(at), ruts.marks_of(bed, at), fields.field_of(sand, False)
    slides_all = head.clock >= SLIDING
    passed, head.clock = (head.clock, 0.0) if slides_all else (h, head.clock)
    if _recentre(model, m, t, address, field, marks):
        marks = ruts.marks_of(bed, at)
        _average(marks)
    _gather(model, m, t, address, field, marks, slides_all, boxes)
    for k in range(len(boxes)):
        if not covers.is_empty(boxes[k]):
            head.moved += _work(model, m, t, address, field, marks, boxes[k], bed_at(bed).mu_int, passed)
            covers.join(instance.trace(address, k).unsettled, boxes[k])


@exact
def remember(model, data, m, d, number):
    """End a step of an instance whose bed remembers: mark what was swept, and let sand slide."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0 or instance.head(address).ruts_size == 0:
        return
    sand, n = stack_doubles(_SAND), instance.head(address).nbody
    instance.fill_sand(model, m, address, sand)
    t, h = bodies.tree(model, data, m, d), doubles(m + model.opt_timestep, 1)[0]
    marks, memory = ruts.marks_of(fields.sand_at(sand).bed, instance.ruts(address)), take(8 * 4 * n)
    if memory == 0:
        return
    boxes = matrix(memory, n, 4)
    if _choose(model, m, t, address, marks, h, boxes):
        _look(model, m, t, address, sand, boxes, h)
    release(memory)
