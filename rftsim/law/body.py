"""Packed sand and surface for compiled code, from their addresses; see `layout`."""

from typing import Any, NamedTuple

from rftsim.law.free_surface import box_is_clear
from rftsim.law.layout import BED, BLOCK, BOX_NUMBERS, COLUMN, COLUMNS, HEADER, HEADER_NUMBERS, Medium, packed_size
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles, peek
from rftsim.machine.records import record_at, values_at

bed_at = record_at(BED)
"""The packed sand at an address."""
medium_at = values_at(BED, Medium)
"""The sand at an address as a law reads it."""
header_at = record_at(HEADER)
"""The header of the packed surface at an address."""


class Body(NamedTuple):
    """A packed surface in memory, as the compiled loops read it."""

    address: Any
    """Where its header lies, see `header_at`."""
    count: Any
    """Number of triangles."""
    numbers: Any
    """Everything behind the header: columns, boxes, and a wheel's angles."""


@inline
def body_at(address):
    """The packed surface at an address."""
    header = header_at(address)
    behind = packed_size(header) - HEADER_NUMBERS
    return Body(address, int(header.ntri), doubles(address + 8 * HEADER_NUMBERS, behind))


@inline
def at(body, column, i):
    """The number of triangle i in a column."""
    return peek(body.numbers, i + column * body.count)


@inline
def centre(body, i):
    """The centre of triangle i [m], (3,)."""
    return at(body, COLUMN.x, i), at(body, COLUMN.y, i), at(body, COLUMN.z, i)


@inline
def normal(body, i):
    """The outward normal of triangle i, (3,)."""
    return at(body, COLUMN.nx, i), at(body, COLUMN.ny, i), at(body, COLUMN.nz, i)


@inline
def rim_angle(body, i):
    """The angle of triangle i of a wheel about its axis [rad]; NO_RIM where it is not of the rim."""
    boxes = (body.count + BLOCK - 1) // BLOCK
    return peek(body.numbers, i + COLUMNS * body.count + BOX_NUMBERS * boxes)


@inline
def block_is_clear(body, block, frame, margin):
    """Whether a block of triangles lies more than a margin above the undisturbed sand."""
    start = COLUMNS * body.count + BOX_NUMBERS * block
    middle = peek(body.numbers, start), peek(body.numbers, start + 1), peek(body.numbers, start + 2)
    half = peek(body.numbers, start + 3), peek(body.numbers, start + 4), peek(body.numbers, start + 5)
    return box_is_clear(middle, half, frame, margin)
