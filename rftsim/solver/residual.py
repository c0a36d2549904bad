"""The impulse that is missing in the equation at a tried velocity, and how far that is from the solution."""

from typing import Final

import numpy as np

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra
from rftsim.solver.motion import evaluate, generalised, speed_of

TOLERANCE: Final = 3e-3
"""Allowed error of a sand body's velocity, relative; v_c is added."""


@exact
def size(p, impulse):
    """Length of an impulse in the mass metric; leaves the velocity change by it in `equation.solved`."""
    solved = equation.solved(p)
    linear_algebra.substitute(equation.mass_factors(p), equation.mass_order(p), impulse, solved)
    return np.sqrt(max(linear_algebra.dot(impulse, solved), 0.0))


@exact
def fill(p, v, q, out):
    """Fill out with the impulse that is missing at a velocity under a generalised force of the sand, (nv,).

    Returns:
        Size of the impulse of the constraints.
    """
    h = equation.numbers(p).h
    start, tau, change = equation.start(p), equation.force(p), equation.change(p)
    for k in range(v.size):
        change[k] = v[k] - start[k]
    linear_algebra.multiply(equation.mass(p), change, out)
    for k in range(v.size):
        out[k] -= h * (tau[k] + q[k])
    if equation.head(p).nrow == 0:
        return 0.0
    x, force = equation.row_error(p), equation.row_force(p)
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    for k in range(v.size):
        change[k] = 0.0
    linear_algebra.add_transposed(equation.row_jacobian(p), force, -h, change)
    for k in range(v.size):
        out[k] += change[k]
    return size(p, change)


@exact
def attempt(p, k):
    """Evaluate the equation at the velocity of point k, and score it; the velocity's error is in `equation.solved`."""
    v, residual = equation.velocity_of(p, k), equation.residual_of(p, k)
    evaluate(p, v, k)
    q, step = equation.sand_force(p), equation.numbers(p)
    generalised(p, k, 0, q)
    scale = fill(p, v, q, residual) + step.h * size(p, q) + step.impulse
    wrong, error = equation.solved(p), 0.0
    missing = size(p, residual)
    for b in range(equation.head(p).nbody):
        error = max(error, speed_of(p, b, wrong) / (TOLERANCE * speed_of(p, b, v) + step.v_c))
    scores = equation.scores(p, k)
    scores.missing, scores.scale, scores.error = missing, scale + TINY, error


@exact
def copy_point(p, origin, target):
    """Copy a point: its velocity, residual, wrenches and scores."""
    linear_algebra.copy(equation.velocity_of(p, origin), equation.velocity_of(p, target))
    linear_algebra.copy(equation.residual_of(p, origin), equation.residual_of(p, target))
    linear_algebra.copy(equation.wrenches_of(p, origin), equation.wrenches_of(p, target))
    known, copied = equation.scores(p, origin), equation.scores(p, target)
    copied.missing, copied.scale, copied.error = known.missing, known.scale, known.error
