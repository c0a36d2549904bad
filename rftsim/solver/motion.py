"""Bodies' motion at a generalised velocity, and the sand's wrenches on it.

All twists and wrenches are about the body's origin, in world axes: velocity or force first.
"""

from typing import Final

import numpy as np

from rftsim.law import exports, step_frame
from rftsim.law.layout import WRENCH
from rftsim.machine import lanes
from rftsim.machine.compiling import exact, fast
from rftsim.machine.memory import doubles, peek, poke, stack_doubles
from rftsim.solver import equation, linear_algebra

AT_REST: Final = 0.1
"""Error of a body's velocity that is allowed however slow it is, over v_c."""
ALIKE: Final = 0.5
"""Difference of two twists of a body, over that error, up to which its derivative tells the force of one from that of
the other, where that changes little."""


@fast
def twist_of(p, b, v, out):
    """Fill out with the twist of body b at a generalised velocity, (6,)."""
    lanes.gather(equation.path(p, b), v, equation.motion(p, b, 0), equation.path_length(p)[b], out)


@exact
def felt_twist(p, b, v, out):
    """Fill out with the twist that the law feels of body b at a generalised velocity: with its strain, (6,)."""
    strain = equation.strain(p, b)
    twist_of(p, b, v, out)
    for r in range(6):
        out[r] += strain[r]


@exact
def size_of(twist, length):
    """|velocity| + |angular velocity| times a length [m/s]."""
    u, w = twist[:3], twist[3:]
    speed, rate = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return np.sqrt(speed) + length * np.sqrt(rate)


@exact
def square_of(twist, length):
    """The square of a velocity and that of an angular velocity times a length [m^2/s^2]."""
    u, w = twist[:3], twist[3:]
    return linear_algebra.dot(u, u) + length * length * linear_algebra.dot(w, w)


@exact
def pace_of(p, b, twist):
    """The root of the square of a twist of body b, see `square_of`, and that of v_c [m/s]."""
    return np.sqrt(square_of(twist, equation.length(p)[b]) + equation.numbers(p).v_c ** 2)


@exact
def told(p, b, twist, out):
    """Fill out with the wrench that the secant of body b tells at a twist, see `secants`, (6,)."""
    share = equation.pace(p)[b] / pace_of(p, b, twist)
    linear_algebra.multiply(equation.secant(p, b), twist, out)
    for r in range(6):
        out[r] *= share


@exact
def speed_of(p, b, v):
    """The size of body b's twist at a generalised velocity [m/s]."""
    twist = doubles(stack_doubles(6), 6)
    twist_of(p, b, v, twist)
    return size_of(twist, equation.length(p)[b])


@exact
def frame_at(p, b, twist):
    """The frame of body b that moves with a twist."""
    return step_frame.moving(equation.frame(p, b).ctypes.data, equation.rotation(p, b), twist)


@fast
def add_wrench(p, b, wrench, share, out):
    """Add a share of a wrench on body b to a generalised force."""
    path = equation.path(p, b)
    a, c, d, e, f, g = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    for k in range(equation.path_length(p)[b]):
        dof, j = peek(path, k), equation.motion(p, b, k)
        power = a * j[0] + c * j[1] + d * j[2] + e * j[3] + f * j[4] + g * j[5]
        poke(out, dof, peek(out, dof) + share * power)


@exact
def generalised(p, k, later, out):
    """Fill out with the generalised force of the wrenches of point k, (ndof,)."""
    linear_algebra.clear(out)
    for b in range(equation.head(p).nbody):
        add_wrench(p, b, equation.wrench_of(p, k, b, later), 1.0, out)


@exact
def respond(p, b, twist, out):
    """Fill out with what the sand answers to a twist of body b, see `exports.ahead`, (AHEAD,)."""
    sand, numbers, f, r = equation.head(p).sand, equation.numbers(p), equation.frame(p, b), equation.rotation(p, b)
    fixed = equation.surface(p)[b], f.ctypes.data, r.ctypes.data
    exports.ahead(sand, *fixed, twist.ctypes.data, numbers.v_c, numbers.h, out.ctypes.data)


@exact
def evaluate(p, v, k):
    """Evaluate the wrenches at a velocity into point k, of bodies whose motion differs from when they last were."""
    twist, seen = doubles(stack_doubles(6), 6), equation.is_seen(p)
    nbody, count = equation.head(p).nbody, 0.0
    for b in range(nbody):
        answer = equation.answer_of(p, k, b)
        felt_twist(p, b, v, twist)
        if seen[b] == 0.0 or not _is_foreseen(p, b, twist, answer):
            respond(p, b, twist, answer)
            linear_algebra.copy(twist, equation.seen_twist(p, b))
            linear_algebra.copy(answer, equation.seen_answer(p, b))
            seen[b], count = 1.0, count + 1.0
    equation.work(p).evaluations += count / nbody


@exact
def _is_foreseen(p, b, twist, out):
    """Whether a twist of body b hardly differs from the last evaluated one; then out is filled, see `_fill_change`."""
    change, wrench, known = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6), equation.seen_twist(p, b)
    for r in range(6):
        change[r] = twist[r] - known[r]
    length = equation.length(p)[b]
    if size_of(change, length) > ALIKE * allowed_at(p, size_of(twist, length)) or not _fill_change(p, b, twist, wrench):
        return False
    most = equation.numbers(p).tolerance * size_of(equation.seen_answer(p, b)[:WRENCH], 1.0 / length)
    if not size_of(wrench, 1.0 / length) <= most:  # at rest the force jumps, and a derivative is that of elsewhere
        return False
    linear_algebra.copy(equation.seen_answer(p, b), out)
    for r in range(WRENCH):
        out[r] += wrench[r]
        out[WRENCH + r] += wrench[r]
    return True


@exact
def _fill_change(p, b, twist, out):
    """Fill out with the change of body b's wrench since it was evaluated, if a derivative or secant tells it."""
    change, known = doubles(stack_doubles(6), 6), equation.seen_twist(p, b)
    if equation.is_hard(p)[b] > 0.0:
        if equation.pace(p)[b] == 0.0:
            return False
        told(p, b, twist, out)
        told(p, b, known, change)
        for r in range(6):
            out[r] -= change[r]
        return True
    for r in range(6):
        change[r] = twist[r] - known[r]
    linear_algebra.multiply(equation.derivative(p, b), change, out)
    return equation.kept(p, b).known > 0.0


@exact
def allowed_at(p, speed):
    """The error that a body's velocity may have at a speed [m/s]."""
    return equation.numbers(p).tolerance * speed + AT_REST * equation.numbers(p).v_c


@exact
def differentiate(p, b, twist, completed):
    """Evaluate the derivative of body b's wrench by its twist: the exact one (0.0), or the completed one (1.0)."""
    sand, numbers, f, r = equation.head(p).sand, equation.numbers(p), equation.frame(p, b), equation.rotation(p, b)
    fixed = equation.surface(p)[b], f.ctypes.data, r.ctypes.data
    g = equation.secant(p, b).ctypes.data if completed > 0.0 else equation.derivative(p, b).ctypes.data
    numbers.is_linearised = 0.0
    exports.derivative(sand, *fixed, twist.ctypes.data, numbers.v_c, completed, g)
    equation.work(p).derivatives += 1.0 / equation.head(p).nbody
