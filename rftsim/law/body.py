"""Packed sand and surface for compiled code, from their addresses; see `layout`."""

from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.law import field as fields
from rftsim.law.bound import over_relief
from rftsim.law.frame import level_frame
from rftsim.law.free_surface import box_is_clear
from rftsim.law.laws import RESPONSES
from rftsim.law.layout import BED, BLOCK, BOX_NUMBERS, COLUMN, COLUMNS, HEADER, HEADER_NUMBERS, Medium, prints_start
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, peek
from rftsim.machine.records import record_at, values_at

bed_at = record_at(BED)
"""The record BED at an address."""
_medium_at = values_at(BED, Medium)
header_at = record_at(HEADER)
"""The header of the packed surface at an address."""


_PLANAR: Final = np.array([response.planar for response in RESPONSES])


@inline
def bed_of(sand):
    """The record BED of a sand, from the address of its record SAND."""
    return bed_at(fields.sand_at(sand).bed)


@inline
def medium_of(sand):
    """The same as a law reads it, see `layout.Medium`."""
    return _medium_at(fields.sand_at(sand).bed)


@exact
def frame_over(sand, surface, xpos, xmat, velocity, omega, reach):
    """The frame of a body over undisturbed sand; of a relief also where the body comes within a reach [m]."""
    bed, header = bed_of(sand), header_at(surface)
    frame = level_frame(bed, xpos, xmat, velocity, omega)
    if not fields.is_relief(sand):
        return frame
    field = fields.field_of(sand, _PLANAR[int(bed.response)])
    return over_relief(frame, field, header.lowest, header.highest, reach)


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
    behind = prints_start(header) - HEADER_NUMBERS
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
