"""The kinds of free surface that the laws' loops are made for: a plane, and a relief.

Of a plane depth and normal follow from the frame. Of a relief they are looked up once for each triangle that counts,
and kept behind its columns.
"""

from typing import Any, Final, NamedTuple

from rftsim.law import field as fields
from rftsim.law import free_surface, relief
from rftsim.law.laws import Response
from rftsim.law.layout import COLUMNS
from rftsim.machine.compiling import inline
from rftsim.machine.memory import peek

ALL_COLUMNS: Final = COLUMNS + 4
"""Columns of a triangle whose depth and normal of the surface, body frame, stand behind those of a packed surface."""


class Ground(NamedTuple):
    """What the loops ask of a free surface, for one response of the sand.

    Undisturbed depth [m], up, shape (3,), and the gradient of the height over the surface, shape (3,), come together.
    """

    is_relief: bool
    """Whether its depths are not those below a frame's plane, which is nowhere below it."""
    columns: int
    """Columns of a chosen triangle."""
    field: Any
    """The surface, from a sand and a frame; for `settle` and `look`."""
    look: Any
    """The three at a face of the body: from its centre and outward normal, the frame and the field."""
    settle: Any
    """Look for n triangles, and keep what is found; their centres lie in columns of a stride in an array."""
    found: Any
    """The three of the i-th of them, whose columns start at a base, from its centre and frame."""
    local: Any
    """The frame over a place, from the body's and the normal there."""


def plane(response: Response) -> Ground:
    """Make what the loops ask of a plane."""

    @inline
    def field(sand):
        return 0

    @inline
    def look(x, y, z, n, frame, field):
        return free_surface.plane_depth(x, y, z, frame), frame.up, frame.rise

    @inline
    def settle(chosen, stride, n, frame, field):
        return

    @inline
    def found(chosen, base, stride, i, x, y, z, frame):
        return free_surface.plane_depth(x, y, z, frame), frame.up, frame.rise

    @inline
    def local(frame, up):
        return frame

    return Ground(False, COLUMNS, field, look, settle, found, local)


def uneven(response: Response) -> Ground:
    """Make what the loops ask of a relief."""
    is_planar = response.planar

    @inline
    def field(sand):
        return fields.field_of(sand, is_planar)

    @inline
    def look(x, y, z, n, frame, field):
        deep, nx, ny, nz = relief.look(x, y, z, n, frame, field)
        return deep, (nx, ny, nz), (nx, ny, nz)

    @inline
    def found(chosen, base, stride, i, x, y, z, frame):
        at = i + (base + COLUMNS) * stride
        up = peek(chosen, at + stride), peek(chosen, at + 2 * stride), peek(chosen, at + 3 * stride)
        return peek(chosen, at), up, up

    return Ground(True, ALL_COLUMNS, field, look, relief.settle, found, relief.local)


GROUNDS: Final = (plane, uneven)
"""Every kind, by whether it is a relief."""
