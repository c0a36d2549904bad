"""Bodies' motion at a generalised velocity, and the sand's wrenches on it.

All twists and wrenches are about the body's origin, in world axes: velocity or force first.
"""

import numpy as np

from rftsim.law import exports, step_frame
from rftsim.machine.compiling import exact, fast
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation, linear_algebra


@exact
def twist_of(p, b, v, out):
    """Fill out with the twist of body b at a generalised velocity, (6,)."""
    linear_algebra.multiply(equation.jacobian(p, b), v, out)


@fast
def speed_of(p, b, v, lengths=1.0):
    """|velocity| + |angular velocity| times so many lengths of body b, at a generalised velocity [m/s]."""
    j, length = equation.jacobian(p, b), equation.length(p)[b]
    square, total = 0.0, 0.0
    for r in range(6):
        y = 0.0
        for k in range(v.size):
            y += j[r, k] * v[k]
        square += y * y
        if r == 2:
            total, square = np.sqrt(square), 0.0
    return total + lengths * length * np.sqrt(square)


@exact
def frame_at(p, b, twist):
    """The frame of body b that moves with a twist."""
    return step_frame.moving(equation.frame(p, b).ctypes.data, equation.rotation(p, b), twist)


@exact
def generalised(p, k, later, out):
    """Fill out with the generalised force of the wrenches of point k, (nv,)."""
    for i in range(out.size):
        out[i] = 0.0
    for b in range(equation.head(p).nbody):
        linear_algebra.add_transposed(equation.jacobian(p, b), equation.wrench_of(p, k, b, later), 1.0, out)


@exact
def evaluate(p, v, k):
    """Evaluate the wrenches at a velocity into point k."""
    h, v_c = equation.numbers(p).h, equation.numbers(p).v_c
    twist = doubles(stack_doubles(6), 6)
    sand = equation.head(p).sand
    for b in range(equation.head(p).nbody):
        twist_of(p, b, v, twist)
        f, r = equation.frame(p, b).ctypes.data, equation.rotation(p, b).ctypes.data
        out = equation.wrench_of(p, k, b, 0).ctypes.data
        exports.ahead(sand, equation.surface(p)[b], f, r, twist.ctypes.data, v_c, h, out)
    equation.work(p).evaluations += 1.0


@exact
def differentiate(p, v, completed):
    """Evaluate the derivative of each body's wrench by its twist: the exact one (0.0), or the completed one (1.0)."""
    twist = doubles(stack_doubles(6), 6)
    sand, v_c = equation.head(p).sand, equation.numbers(p).v_c
    for b in range(equation.head(p).nbody):
        twist_of(p, b, v, twist)
        f, r = equation.frame(p, b).ctypes.data, equation.rotation(p, b).ctypes.data
        g = equation.completed(p, b) if completed > 0.0 else equation.derivative(p, b)
        exports.derivative(sand, equation.surface(p)[b], f, r, twist.ctypes.data, v_c, completed, g.ctypes.data)
    equation.work(p).derivatives += 1.0
