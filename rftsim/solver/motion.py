"""Bodies' motion at a generalised velocity, and the sand's wrenches on it.

All twists and wrenches are about the body's origin, in world axes: velocity or force first.
"""

import numpy as np

from rftsim.law import exports, step_frame
from rftsim.machine import lanes
from rftsim.machine.compiling import exact, fast
from rftsim.machine.memory import doubles, peek, poke, stack_doubles
from rftsim.solver import equation, linear_algebra


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
    """Evaluate the wrenches at a velocity into point k."""
    twist = doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        felt_twist(p, b, v, twist)
        respond(p, b, twist, equation.answer_of(p, k, b))
    equation.work(p).evaluations += 1.0


@exact
def differentiate(p, b, twist, completed):
    """Evaluate the derivative of body b's wrench by its twist: the exact one (0.0), or the completed one (1.0)."""
    sand, numbers, f, r = equation.head(p).sand, equation.numbers(p), equation.frame(p, b), equation.rotation(p, b)
    fixed = equation.surface(p)[b], f.ctypes.data, r.ctypes.data
    g = equation.completed(p, b).ctypes.data if completed > 0.0 else equation.derivative(p, b).ctypes.data
    numbers.is_linearised = 0.0
    exports.derivative(sand, *fixed, twist.ctypes.data, numbers.v_c, completed, g)
    equation.work(p).derivatives += 1.0 / equation.head(p).nbody
