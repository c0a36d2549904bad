"""The derivative of a body's wrench by its twist, for the implicit force.

A law depends on the direction of motion alone but for the scale at rest and the inertial term, so two differences
across the motion and those two closed forms give all of it.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import carray, types

from rftsim.law import leading
from rftsim.law.frame import point_velocity
from rftsim.law.free_surface import drop
from rftsim.law.grounds import ALL_COLUMNS, Ground
from rftsim.law.laws import Response
from rftsim.law.layout import BLOCK, COLUMN
from rftsim.law.leading import Edge
from rftsim.law.selection import CAPACITY, FULL, choosing, chosen_on_stack, filled_up
from rftsim.law.stress import TINY
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import loop, merged
from rftsim.machine.memory import on_stack, peek, poke

STEP_ASIDE: Final = 1e-7
"""Turn of the direction of motion [rad] by which the laws are differentiated."""
_MATRIX: Final = 9
"""Numbers of a triangle's derivative, which lie before the triangles' columns: LLVM tells parts of one array apart."""
_scratch = on_stack((_MATRIX + ALL_COLUMNS) * BLOCK, types.float64)


class Aside(NamedTuple):
    """The direction of a motion and two across it, all unit vectors, (3,) each."""

    ahead: Any
    first: Any
    second: Any


@merged
def _column(k, column, i):
    """A number of the i-th triangle in the scratch of a derivative."""
    return k[i + (_MATRIX + column) * BLOCK]


@merged
def _aside(v, inverse):
    """The direction of a motion and two across it, without a branch."""
    a, b, c = v[0] * inverse, v[1] * inverse, v[2] * inverse
    sign = 1.0 if c >= 0.0 else -1.0
    turn = -1.0 / (sign + c)
    first = 1.0 + sign * a * a * turn, sign * a * b * turn, -sign * a
    return Aside((a, b, c), first, (a * b * turn, sign + b * b * turn, -b))


@merged
def _turned(ahead, aside):
    """The direction of motion turned aside by STEP_ASIDE, (3,)."""
    d = STEP_ASIDE
    return ahead[0] + d * aside[0], ahead[1] + d * aside[1], ahead[2] + d * aside[2]


@merged
def _changed(share, after, before):
    """A share of the change of a stress, (3,)."""
    return share * (after[0] - before[0]), share * (after[1] - before[1]), share * (after[2] - before[2])


class Terms(NamedTuple):
    """The vectors that make the derivative of one triangle's force, and what multiplies their products."""

    aside: Any
    first: Any
    """Change of the force per turn to the first direction across the motion, (3,)."""
    second: Any
    """Change of the force per turn to the second direction, (3,)."""
    along: Any
    resistance: Any
    """Stress per depth, which changes along the motion by `along` times itself, (3,)."""
    brake: Any
    inertial: Any
    """Inertial stress, which changes by `brake` times itself times its component, (3,)."""
    edge: Any
    normal: Any
    """The normal as the law sees it, along which the pressure jumps at the face's edge by `edge`, (3,)."""


@merged
def _fill_matrix(k, i, t):
    """Fill the derivative of the i-th triangle's force by its velocity into a scratch, row by row."""
    (a, b, c), (p0, p1, p2), (q0, q1, q2) = t.aside.ahead, t.aside.first, t.aside.second
    (e0, e1, e2), (f0, f1, f2), along, (s0, s1, s2) = t.first, t.second, t.along, t.resistance
    brake, (i0, i1, i2), edge, (m0, m1, m2) = t.brake, t.inertial, t.edge, t.normal
    k[i] = e0 * p0 + f0 * q0 + along * s0 * a + brake * i0 * i0 + edge * m0 * m0
    k[i + 1 * BLOCK] = e0 * p1 + f0 * q1 + along * s0 * b + brake * i0 * i1 + edge * m0 * m1
    k[i + 2 * BLOCK] = e0 * p2 + f0 * q2 + along * s0 * c + brake * i0 * i2 + edge * m0 * m2
    k[i + 3 * BLOCK] = e1 * p0 + f1 * q0 + along * s1 * a + brake * i1 * i0 + edge * m1 * m0
    k[i + 4 * BLOCK] = e1 * p1 + f1 * q1 + along * s1 * b + brake * i1 * i1 + edge * m1 * m1
    k[i + 5 * BLOCK] = e1 * p2 + f1 * q2 + along * s1 * c + brake * i1 * i2 + edge * m1 * m2
    k[i + 6 * BLOCK] = e2 * p0 + f2 * q0 + along * s2 * a + brake * i2 * i0 + edge * m2 * m0
    k[i + 7 * BLOCK] = e2 * p1 + f2 * q1 + along * s2 * b + brake * i2 * i1 + edge * m2 * m1
    k[i + 8 * BLOCK] = e2 * p2 + f2 * q2 + along * s2 * c + brake * i2 * i2 + edge * m2 * m2


def derivative(response: Response, ground: Ground) -> Any:
    """Make the derivative of `sums_ahead`'s present force and moment by the body's twist."""
    choose, stress, felt_depth = choosing(response, ahead=False), response.stress, response.felt_depth
    columns = ground.columns

    @loop
    def fill(n, frame, medium, edge, v_c, completed, k):
        """Derivative of each of n triangles' force by its velocity: nine runs of BLOCK in k, before their columns."""
        bare = Edge(edge.tolerance, (1.0 - completed) * edge.ramp)  # the completed one takes the edge's rule apart
        for i in range(n):
            x, y, z = _column(k, COLUMN.x, i), _column(k, COLUMN.y, i), _column(k, COLUMN.z, i)
            normal = _column(k, COLUMN.nx, i), _column(k, COLUMN.ny, i), _column(k, COLUMN.nz, i)
            area, v = _column(k, COLUMN.area, i), point_velocity(frame, x, y, z)
            speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            speed = np.sqrt(speed2 + TINY)
            inverse = 1.0 / speed
            deep, up, _ = ground.found(k, _MATRIX, BLOCK, i, x, y, z, frame)
            aside, around = _aside(v, inverse), ground.local(frame, up)
            s = stress(normal, v, up, around, medium, bare)
            one = stress(normal, _turned(aside.ahead, aside.first), up, around, medium, bare).per_depth
            two = stress(normal, _turned(aside.ahead, aside.second), up, around, medium, bare).per_depth
            (s0, s1, s2), (m0, m1, m2) = s.per_depth, s.along
            deep -= drop(x, y, z, frame)
            radius = 1.0 / np.sqrt(speed2 + v_c * v_c + TINY)
            weight = area * larger(felt_depth(deep, medium), 0.0) * radius if speed2 > 0.0 else 0.0
            vn = v[0] * m0 + v[1] * m1 + v[2] * m2
            share = completed * leading.share(vn * inverse, speed2, edge) + (1.0 - completed)
            # a face's pressure P (1 + sign n.v) / 2 jumps at its edge: 1 / |n.v| is the secant of that sign
            width = 0.5 / (radius * edge.ramp)
            jump = -0.5 * completed * abs(s0 * m0 + s1 * m1 + s2 * m2) / larger(abs(vn + width), width) * weight * speed
            inertial = s.inertia * m0, s.inertia * m1, s.inertia * m2
            i0, i1, i2 = inertial
            along = share * weight * (completed + (1.0 - completed) * v_c * v_c * radius * radius)
            across = share * weight / STEP_ASIDE
            brake = (2.0 * area if deep > 0.0 else 0.0) / smaller(v[0] * i0 + v[1] * i1 + v[2] * i2, -TINY)
            first, second = _changed(across, one, s.per_depth), _changed(across, two, s.per_depth)
            _fill_matrix(k, i, Terms(aside, first, second, along, s.per_depth, brake, inertial, jump, s.along))

    @loop
    def add_chosen(chosen, n, frame, medium, edge, v_c, completed, out):
        """Add the derivative of n chosen triangles to out, BLOCK by BLOCK."""
        k = carray(_scratch(), ((_MATRIX + ALL_COLUMNS) * BLOCK,))
        for first in range(0, n, BLOCK):
            some = min(BLOCK, n - first)
            for column in range(columns):
                for i in range(some):
                    poke(k, i + (_MATRIX + column) * BLOCK, peek(chosen, first + i + column * CAPACITY))
            fill(some, frame, medium, edge, v_c, completed, k)
            for row in range(3):
                _add_rows(some, k, row, out)

    @loop
    def added(body, frame, sand, medium, edge, v_c, completed, out):
        """Add the derivative to out, (6, 6).

        `completed` (0 or 1) asks for a matrix that cannot overshoot where the law jumps: tangent across the motion and
        secant along it (1 / r instead of v_c^2 / r^3, r^2 = |v|^2 + v_c^2), and secant where a face's edge leads.
        """
        chosen, n, last, field = chosen_on_stack(), 0, 0, ground.field(sand)
        reach = leading.ALL if completed > 0.0 else leading.reach2(edge)
        while last < body.count:
            n, last = choose(body, last, frame, 0.0, reach, 0.0, chosen, n)
            if n > FULL or last >= body.count:
                n = filled_up(chosen, n)
                ground.settle(chosen, CAPACITY, n, frame, field)
                add_chosen(chosen, n, frame, medium, edge, v_c, completed, out)
                n = 0

    return added


@loop
def _add_rows(n, k, row, out):
    """Add the share of one component of n triangles' forces to out, (6, 6); k is a derivative's scratch."""
    f0 = f1 = f2 = f3 = f4 = f5 = 0.0
    x0 = x1 = x2 = x3 = x4 = x5 = 0.0
    y0 = y1 = y2 = y3 = y4 = y5 = 0.0
    z0 = z1 = z2 = z3 = z4 = z5 = 0.0
    start = 3 * row * BLOCK
    for i in range(n):
        x, y, z = _column(k, COLUMN.x, i), _column(k, COLUMN.y, i), _column(k, COLUMN.z, i)
        u, v, w = peek(k, start + i), peek(k, start + i + BLOCK), peek(k, start + i + 2 * BLOCK)
        p, q, r = w * y - v * z, u * z - w * x, v * x - u * y  # by the angular velocity: velocity is omega x r
        f0, f1, f2, f3, f4, f5 = f0 + u, f1 + v, f2 + w, f3 + p, f4 + q, f5 + r
        x0, x1, x2, x3, x4, x5 = x0 + x * u, x1 + x * v, x2 + x * w, x3 + x * p, x4 + x * q, x5 + x * r
        y0, y1, y2, y3, y4, y5 = y0 + y * u, y1 + y * v, y2 + y * w, y3 + y * p, y4 + y * q, y5 + y * r
        z0, z1, z2, z3, z4, z5 = z0 + z * u, z1 + z * v, z2 + z * w, z3 + z * p, z4 + z * q, z5 + z * r
    force = (f0, f1, f2, f3, f4, f5)
    arms = ((x0, x1, x2, x3, x4, x5), (y0, y1, y2, y3, y4, y5), (z0, z1, z2, z3, z4, z5))
    after, before = (row + 1) % 3, (row + 2) % 3
    for c in range(6):
        out[row, c] += force[c]
        out[3 + after, c] += arms[before][c]
        out[3 + before, c] -= arms[after][c]
