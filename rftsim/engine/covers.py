"""Which cells of sand that remembers lie below bodies: boxes of cells, first row and column and behind the last, (4,).

A box that holds no cell ends where it starts.
"""

from typing import Final

from rftsim.law import field as fields
from rftsim.law import ruts
from rftsim.law.body import header_at
from rftsim.law.layout import BLOCK, BLOCK_SIDE, BOX_NUMBERS, prints_start
from rftsim.law.vectors import to_world
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles

NEAR: Final = 2.0
"""Height over the sand at which prints are looked at [cells]."""


@exact
def empty(box):
    """Let a box hold no cell."""
    for k in range(4):
        box[k] = 0.0


@exact
def is_empty(box):
    """Whether a box holds no cell."""
    return box[2] <= box[0]


@exact
def join(box, other):
    """Widen a box to hold another, where that holds any cell."""
    if is_empty(other):
        return
    is_new = is_empty(box)
    for k in range(2):
        box[k] = other[k] if is_new else min(box[k], other[k])
        box[2 + k] = other[2 + k] if is_new else max(box[2 + k], other[2 + k])


@exact
def meet(box, other):
    """Whether two boxes have cells in common."""
    apart = box[0] >= other[2] or other[0] >= box[2]
    beside = box[1] >= other[3] or other[1] >= box[3]
    return not (apart or beside or is_empty(box) or is_empty(other))


@exact
def merge(boxes):
    """Join those of many boxes, (n, 4), that have cells in common, in the first of them."""
    k = 0
    while k < len(boxes):
        for other in range(len(boxes)):
            if other != k and meet(boxes[k], boxes[other]):
                join(boxes[k], boxes[other])
                empty(boxes[other])
                k = -1
                break
        k += 1


@exact
def extent(t, body, surface, out):
    """Fill out with the centre of a body's box and half its size, along the world's axes [m], (6,)."""
    low, high, box = header_at(surface).lowest, header_at(surface).highest, doubles(stack_doubles(6), 6)
    for k in range(3):
        box[k], box[3 + k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k])
    place_box(t.xmat[9 * body : 9 * body + 9], t.xpos[3 * body : 3 * body + 3], box, out)


@exact
def _is_near(field, marks, at, more):
    """Whether a box, by its centre and half its size [m], (6,), comes within so many cells of the free surface."""
    height, along, across = fields.surface_over(field, at[0], at[1])
    height += max(ruts.height(marks, at[0], at[1]), 0.0) + abs(along) * at[3] + abs(across) * at[4]
    return at[2] - at[5] <= height + more * marks.spacing


@exact
def _join_cells(marks, at, out):
    """Widen a box of cells by those below a box in the world, by its centre and half its size [m], (6,)."""
    cells = doubles(stack_doubles(4), 4)
    for k in range(2):
        middle, half = at[1 - k], at[4 - k]
        cells[k], cells[2 + k] = ruts.cell(middle - half, marks.spacing), ruts.cell(middle + half, marks.spacing) + 1
    join(out, cells)


@exact
def add_body(t, body, surface, field, marks, out):
    """Widen a box by all cells that a body is above, if it is near the sand."""
    at = doubles(stack_doubles(6), 6)
    extent(t, body, surface, at)
    if _is_near(field, marks, at, BLOCK_SIDE):
        _join_cells(marks, at, out)


@exact
def add_prints(t, body, surface, field, marks, out):
    """Widen a box by those cells that prints of a body which are near the sand lie above."""
    r, position = t.xmat[9 * body : 9 * body + 9], t.xpos[3 * body : 3 * body + 3]
    header, at = header_at(surface), doubles(stack_doubles(6), 6)
    extent(t, body, surface, at)
    if not _is_near(field, marks, at, BLOCK_SIDE):
        return
    n = int(header.prints)
    count = (n + BLOCK - 1) // BLOCK
    boxes = doubles(surface + 8 * (prints_start(header) + 3 * n), BOX_NUMBERS * count)
    for block in range(count):
        box = boxes[BOX_NUMBERS * block : BOX_NUMBERS * (block + 1)]
        place_box(r, position, box, at)
        if _is_near(field, marks, at, NEAR):
            _join_cells(marks, at, out)


@exact
def place_box(r, position, box, out):
    """Fill out with the centre of a record BOX in the world and half its size along the world's axes [m], (6,)."""
    out[0], out[1], out[2] = to_world(r, box[0], box[1], box[2])
    for k in range(3):
        out[k] += position[k]
        out[3 + k] = abs(r[3 * k]) * box[3] + abs(r[3 * k + 1]) * box[4] + abs(r[3 * k + 2]) * box[5]
