"""The laws' loops as functions of plain addresses, which everything else calls by name; see `rftsim.machine`.

Addresses are of a record SAND and of a packed surface, see `layout`; of xpos (3,), xmat (9,), velocity (3,), omega
(3,), a twist (6,); and of what is filled; all float64.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numba import types

from rftsim.law import derivative as derivatives
from rftsim.law import step_frame, sums
from rftsim.law.body import bed_of, body_at, frame_over, header_at, medium_of
from rftsim.law.field import is_relief
from rftsim.law.frame import sunk
from rftsim.law.free_surface import lowest_depth
from rftsim.law.grounds import GROUNDS, Ground
from rftsim.law.laws import RESPONSES, Response
from rftsim.law.layout import PRESSED, WRENCH
from rftsim.law.leading import SHARP, Edge
from rftsim.law.vectors import to_world
from rftsim.law.wheel_drop import dropped
from rftsim.machine.compiling import inline
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, matrix, stack_doubles

AHEAD: Final = 2 * WRENCH + 1
"""Numbers that `ahead` fills."""
RAMP: Final = 100.0
"""Steepness of the leading-edge rule in the implicit force: faces fall out between n.v_hat = 0 and -1/RAMP."""


def by_kind(make: Callable[[Response, Ground], Any]) -> Any:
    """Make the function that calls what was made for a response and a kind of ground, from its place and arguments."""
    made = [make(response, ground(response)) for ground in GROUNDS for response in RESPONSES]

    def from_place(place: int) -> Any:
        own = made[place]
        if place == len(made) - 1:
            return inline(lambda number, arguments: own(*arguments))
        rest = from_place(place + 1)

        @inline
        def choose(number, arguments):
            if number == place:
                return own(*arguments)
            return rest(number, arguments)

        return choose

    return from_place(0)


_drop, _sums, _tractions = by_kind(dropped), by_kind(sums.sums), by_kind(sums.tractions)
_pressures = by_kind(sums.pressures)
_ahead, _derivative = by_kind(sums.sums_ahead), by_kind(derivatives.derivative)
_ANSWERS: Final = len(RESPONSES)


@inline
def _kind(sand):
    """The place of what was made for a sand's response and ground."""
    return bed_of(sand).response + (_ANSWERS if is_relief(sand) else 0)


@inline
def deepest_corner(surface, frame):
    """The depth of the deepest corner of the bounding box of the surface at an address [m]."""
    header = header_at(surface)
    return lowest_depth(header.lowest, header.highest, frame)


@inline
def _edge(surface, ramp):
    """The treatment of edges of the surface at an address."""
    return Edge(header_at(surface).edge_on, ramp)


@inline
def _level(sand, surface, xpos, xmat, velocity, omega):
    """The frame of a body over undisturbed sand, from addresses."""
    motion = doubles(velocity, 3), doubles(omega, 3)
    return frame_over(sand, surface, doubles(xpos, 3), doubles(xmat, 9), motion[0], motion[1], 0.0)


@inline
def _to_world(rotation, g, out):
    """Fill out with a wrench in the world frame, (6,)."""
    out[0], out[1], out[2] = to_world(rotation, g.fx, g.fy, g.fz)
    out[3], out[4], out[5] = to_world(rotation, g.tx, g.ty, g.tz)


@entry(types.void, *[address] * 7)
def wrench(sand, surface, xpos, xmat, velocity, omega, out):
    """Force and moment about the body's origin, world frame, (6,), at the velocity of the moment."""
    kind, body, total = _kind(sand), body_at(surface), doubles(out, 6)
    frame = _level(sand, surface, xpos, xmat, velocity, omega)
    if deepest_corner(surface, frame) <= 0.0:
        for k in range(6):
            total[k] = 0.0
        return
    medium, edge = medium_of(sand), _edge(surface, SHARP)
    frame = _drop(kind, (body, frame, sand, medium))
    _to_world(doubles(xmat, 9), _sums(kind, (body, frame, sand, medium, edge)), total)


@entry(types.void, *[address] * 2, types.intp, *[address] * 5)
def wrenches(sand, surface, count, xpos, xmat, velocity, omega, out):
    """The wrenches of so many poses and motions, one after another in each array."""
    for i in range(count):
        vector = 24 * i
        wrench(sand, surface, xpos + vector, xmat + 72 * i, velocity + vector, omega + vector, out + 48 * i)


@entry(types.void, *[address] * 8)
def tractions(sand, surface, xpos, xmat, velocity, omega, stress, depth):
    """Stress of each triangle in the body frame, (ntri, 3), and effective depth, (ntri,)."""
    kind, body, medium, edge = _kind(sand), body_at(surface), medium_of(sand), _edge(surface, SHARP)
    frame = _drop(kind, (body, _level(sand, surface, xpos, xmat, velocity, omega), sand, medium))
    out = matrix(stress, body.count, 3), doubles(depth, body.count)
    _tractions(kind, (body, frame, sand, medium, edge, out[0], out[1]))


@entry(types.intp, *[address] * 6, types.float64, address, address)
def pressures(sand, surface, xpos, xmat, velocity, omega, v_c, rows, force):
    """How many triangles the sand may press on; each has a row of columns PRESSED. Their force, world frame, (3,).

    The force is that at the velocity of the moment, times |v| / sqrt(|v|^2 + v_c^2); rows hold as many as there are
    triangles.
    """
    kind, body, out = _kind(sand), body_at(surface), doubles(force, 3)
    level = _level(sand, surface, xpos, xmat, velocity, omega)
    out[0] = out[1] = out[2] = 0.0
    if deepest_corner(surface, level) <= 0.0:
        return 0
    medium, edge = medium_of(sand), _edge(surface, SHARP)
    dropped_frame = _drop(kind, (body, level, sand, medium))
    table = matrix(rows, body.count, len(PRESSED))
    count, total = _pressures(kind, (body, dropped_frame, sand, medium, edge, v_c, table))
    out[0], out[1], out[2] = to_world(doubles(xmat, 9), total.fx, total.fy, total.fz)
    return count


@entry(types.void, *[address] * 7)
def frame(sand, surface, xpos, xmat, velocity, omega, out):
    """The part of a body's frame that does not change within a step, see `step_frame`."""
    body, medium = body_at(surface), medium_of(sand)
    level = _level(sand, surface, xpos, xmat, velocity, omega)
    step_frame.keep(_drop(_kind(sand), (body, level, sand, medium)), out)


@inline
def _farthest(surface, velocity, omega, h):
    """The farthest that any triangle can move in a time h [m]."""
    low, high = header_at(surface).lowest, header_at(surface).highest
    x, y, z = max(abs(low[0]), abs(high[0])), max(abs(low[1]), abs(high[1])), max(abs(low[2]), abs(high[2]))
    v, w = velocity, omega
    turn = np.sqrt((w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (x * x + y * y + z * z))
    return h * (np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turn)


@inline
def _raised(surface, frame, margin):
    """The frame whose plane is above a relief also after the body has moved as it did, and by a margin more."""
    if frame.relief == 0.0:
        return frame
    way = frame.moved
    margin += _farthest(surface, way[:3], way[3:], 1.0)
    return sunk(frame, frame.rise, frame.height + 2.0 * margin, frame.moved)


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def ahead(sand, surface, frame, xmat, twist, v_c, h, out):
    """Wrench continuous at rest, world frame: at the present depths, and at those after a time h; mean depth [m].

    That is of the triangles which the sand acts on, now or then, each by its own depth; `out` is (AHEAD,).
    """
    body, rotation, found = body_at(surface), doubles(xmat, 9), doubles(out, AHEAD)
    moving = step_frame.moving(frame, rotation, doubles(twist, 6))
    margin = _farthest(surface, moving.v0, moving.omega, h)
    moving = _raised(surface, moving, margin)
    if deepest_corner(surface, moving) + margin <= 0.0:
        for k in range(AHEAD):
            found[k] = 0.0
        return
    medium, edge = medium_of(sand), _edge(surface, RAMP)
    now, then, depth = _ahead(_kind(sand), (body, moving, sand, medium, edge, v_c, h, margin))
    _to_world(rotation, now, found[:6])
    _to_world(rotation, then, found[6:])
    found[AHEAD - 1] = depth


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def derivative(sand, surface, frame, xmat, twist, v_c, completed, out):
    """Derivative of `ahead`'s present wrench by the twist, world frame, (6, 6)."""
    body, rotation = body_at(surface), doubles(xmat, 9)
    moving = _raised(surface, step_frame.moving(frame, rotation, doubles(twist, 6)), 0.0)
    local, turned, g = matrix(stack_doubles(36), 6, 6), matrix(stack_doubles(36), 6, 6), matrix(out, 6, 6)
    for i in range(6):
        for k in range(6):
            local[i, k] = g[i, k] = 0.0
    if deepest_corner(surface, moving) <= 0.0:
        return
    edge = _edge(surface, RAMP)
    _derivative(_kind(sand), (body, moving, sand, medium_of(sand), edge, v_c, completed, local))
    for half in range(0, 6, 3):  # R G R'
        for k in range(6):
            x, y, z = to_world(rotation, local[half, k], local[half + 1, k], local[half + 2, k])
            turned[half, k], turned[half + 1, k], turned[half + 2, k] = x, y, z
    for half in range(0, 6, 3):
        for k in range(6):
            x, y, z = to_world(rotation, turned[k, half], turned[k, half + 1], turned[k, half + 2])
            g[k, half], g[k, half + 1], g[k, half + 2] = x, y, z
