"""The laws' loops as functions of plain addresses, which everything else calls by name; see `rftsim.machine`.

Addresses are of packed sand and surface, see `layout`; of xpos (3,), xmat (9,), velocity (3,), omega (3,), a twist
(6,); and of what is filled; all float64.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numba import types

from rftsim.law import derivative as derivatives
from rftsim.law import step_frame, sums
from rftsim.law.body import bed_at, body_at, header_at, medium_at
from rftsim.law.frame import level_frame
from rftsim.law.free_surface import lowest_depth
from rftsim.law.laws import RESPONSES, Response
from rftsim.law.layout import PRESSED
from rftsim.law.leading import SHARP, Edge
from rftsim.law.vectors import to_world
from rftsim.law.wheel_drop import dropped
from rftsim.machine.compiling import inline
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, matrix, stack_doubles

RAMP: Final = 100.0
"""Steepness of the leading-edge rule in the implicit force: faces fall out between n.v_hat = 0 and -1/RAMP."""


def by_response(make: Callable[[Response], Any]) -> Any:
    """Make the function that calls what was made for a response, from its place in RESPONSES and the arguments."""
    made = [make(response) for response in RESPONSES]

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


_drop, _sums, _tractions = by_response(dropped), by_response(sums.sums), by_response(sums.tractions)
_pressures = by_response(sums.pressures)
_ahead, _derivative = by_response(sums.sums_ahead), by_response(derivatives.derivative)


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
def _level(record, xpos, xmat, velocity, omega):
    """The frame of a body over undisturbed sand, from addresses."""
    return level_frame(record, doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3))


@inline
def _to_world(rotation, g, out):
    """Fill out with a wrench in the world frame, (6,)."""
    out[0], out[1], out[2] = to_world(rotation, g.fx, g.fy, g.fz)
    out[3], out[4], out[5] = to_world(rotation, g.tx, g.ty, g.tz)


@entry(types.void, *[address] * 7)
def wrench(bed, surface, xpos, xmat, velocity, omega, out):
    """Force and moment about the body's origin, world frame, (6,), at the velocity of the moment."""
    record, body, total = bed_at(bed), body_at(surface), doubles(out, 6)
    frame = _level(record, xpos, xmat, velocity, omega)
    if deepest_corner(surface, frame) <= 0.0:
        for k in range(6):
            total[k] = 0.0
        return
    medium, edge = medium_at(bed), _edge(surface, SHARP)
    frame = _drop(record.response, (body, frame, medium))
    _to_world(doubles(xmat, 9), _sums(record.response, (body, frame, medium, edge)), total)


@entry(types.void, *[address] * 2, types.intp, *[address] * 5)
def wrenches(bed, surface, count, xpos, xmat, velocity, omega, out):
    """The wrenches of so many poses and motions, one after another in each array."""
    for i in range(count):
        vector = 24 * i
        wrench(bed, surface, xpos + vector, xmat + 72 * i, velocity + vector, omega + vector, out + 48 * i)


@entry(types.void, *[address] * 8)
def tractions(bed, surface, xpos, xmat, velocity, omega, stress, depth):
    """Stress of each triangle in the body frame, (ntri, 3), and effective depth, (ntri,)."""
    record, body, medium = bed_at(bed), body_at(surface), medium_at(bed)
    edge = _edge(surface, SHARP)
    frame = _drop(record.response, (body, _level(record, xpos, xmat, velocity, omega), medium))
    out = matrix(stress, body.count, 3), doubles(depth, body.count)
    _tractions(record.response, (body, frame, medium, edge, out[0], out[1]))


@entry(types.intp, *[address] * 6, types.float64, address, address)
def pressures(bed, surface, xpos, xmat, velocity, omega, v_c, rows, force):
    """How many triangles the sand may press on; each has a row of columns PRESSED. Their force, world frame, (3,).

    The force is that at the velocity of the moment, times |v| / sqrt(|v|^2 + v_c^2); rows hold as many as there are
    triangles.
    """
    record, body, out = bed_at(bed), body_at(surface), doubles(force, 3)
    level = _level(record, xpos, xmat, velocity, omega)
    out[0] = out[1] = out[2] = 0.0
    if deepest_corner(surface, level) <= 0.0:
        return 0
    medium, edge = medium_at(bed), _edge(surface, SHARP)
    dropped_frame = _drop(record.response, (body, level, medium))
    table = matrix(rows, body.count, len(PRESSED))
    count, total = _pressures(record.response, (body, dropped_frame, medium, edge, v_c, table))
    out[0], out[1], out[2] = to_world(doubles(xmat, 9), total.fx, total.fy, total.fz)
    return count


@entry(types.void, *[address] * 7)
def frame(bed, surface, xpos, xmat, velocity, omega, out):
    """The part of a body's frame that does not change within a step, see `step_frame`."""
    record, body, medium = bed_at(bed), body_at(surface), medium_at(bed)
    level = _level(record, xpos, xmat, velocity, omega)
    step_frame.keep(_drop(record.response, (body, level, medium)), out)


@inline
def _farthest(surface, frame, h):
    """The farthest that any triangle can move in a time h [m]."""
    low, high = header_at(surface).lowest, header_at(surface).highest
    x, y, z = max(abs(low[0]), abs(high[0])), max(abs(low[1]), abs(high[1])), max(abs(low[2]), abs(high[2]))
    v, w = frame.v0, frame.omega
    turn = np.sqrt((w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (x * x + y * y + z * z))
    return h * (np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turn)


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def ahead(bed, surface, frame, xmat, twist, v_c, h, out):
    """Wrench continuous at rest, world frame: at the present depths, and at those after a time h, (12,)."""
    record, body, rotation = bed_at(bed), body_at(surface), doubles(xmat, 9)
    moving = step_frame.moving(frame, rotation, doubles(twist, 6))
    margin = _farthest(surface, moving, h)
    if deepest_corner(surface, moving) + margin <= 0.0:
        total = doubles(out, 12)
        for k in range(12):
            total[k] = 0.0
        return
    medium, edge = medium_at(bed), _edge(surface, RAMP)
    now, after = _ahead(record.response, (body, moving, medium, edge, v_c, h, margin))
    _to_world(rotation, now, doubles(out, 6))
    _to_world(rotation, after, doubles(out + 48, 6))


@entry(types.void, *[address] * 5, types.float64, types.float64, address)
def derivative(bed, surface, frame, xmat, twist, v_c, completed, out):
    """Derivative of `ahead`'s present wrench by the twist, world frame, (6, 6)."""
    record, body, rotation = bed_at(bed), body_at(surface), doubles(xmat, 9)
    moving = step_frame.moving(frame, rotation, doubles(twist, 6))
    local, turned, g = matrix(stack_doubles(36), 6, 6), matrix(stack_doubles(36), 6, 6), matrix(out, 6, 6)
    for i in range(6):
        for k in range(6):
            local[i, k] = g[i, k] = 0.0
    if deepest_corner(surface, moving) <= 0.0:
        return
    edge = _edge(surface, RAMP)
    _derivative(record.response, (body, moving, medium_at(bed), edge, v_c, completed, local))
    for half in range(0, 6, 3):  # R G R'
        for k in range(6):
            x, y, z = to_world(rotation, local[half, k], local[half + 1, k], local[half + 2, k])
            turned[half, k], turned[half + 1, k], turned[half + 2, k] = x, y, z
    for half in range(0, 6, 3):
        for k in range(6):
            x, y, z = to_world(rotation, turned[k, half], turned[k, half + 1], turned[k, half + 2])
            g[k, half], g[k, half + 1], g[k, half + 2] = x, y, z
