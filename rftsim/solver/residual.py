"""The impulse that is missing in the equation at a tried velocity, and how far that is from the solution."""

import numpy as np

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra, matrices
from rftsim.solver.motion import allowed_at, evaluate, generalised, speed_of


@exact
def size(p, impulse):
    """Length of an impulse in the mass metric; leaves the velocity change by it in `equation.solved`."""
    solved = equation.solved(p)
    matrices.substitute(p, equation.mass_factors(p), impulse, solved)
    return np.sqrt(max(linear_algebra.dot(impulse, solved), 0.0))


@exact
def fill(p, v, x, q, out):
    """Fill out with the impulse that is missing at a velocity under a generalised force of the sand, (ndof,).

    `x` are the rows' J a - aref there, (nrow,). The impulse of the constraints, negative, is left in `equation.change`.
    """
    h = equation.numbers(p).h
    start, tau, change = equation.start(p), equation.force(p), equation.change(p)
    for k in range(v.size):
        change[k] = v[k] - start[k]
    matrices.multiply(p, equation.mass(p), change, out)
    for k in range(v.size):
        out[k] -= h * (tau[k] + q[k])
    linear_algebra.clear(change)
    if x.size == 0:
        return
    force = equation.row_force(p)
    constraint_rows.forces(p, x, force)
    constraint_rows.add_forces(p, force, -h, change)
    for k in range(v.size):
        out[k] += change[k]


@exact
def attempt(p, k):
    """Evaluate the equation at the velocity of point k, and score it; its rows' errors are filled already."""
    v, residual = equation.velocity_of(p, k), equation.residual_of(p, k)
    evaluate(p, v, k)
    q, step, scores = equation.sand_force(p), equation.numbers(p), equation.scores(p, k)
    generalised(p, k, 0, q)
    fill(p, v, equation.errors_of(p, k), q, residual)
    scale = step.scale
    if equation.head(p).nrow > 0:
        scale += size(p, equation.change(p))
        linear_algebra.copy(equation.solved(p), equation.answered(p))
    scores.missing = size(p, residual)
    scores.scale = scale + _pressed(p, v, q) + TINY
    wrong, error = equation.solved(p), 0.0
    for b in range(equation.head(p).nbody):
        error = max(error, speed_of(p, b, wrong) / allowed(p, b, v))
    scores.error = error


@exact
def _pressed(p, v, q):
    """Length of the sand's impulse in the mass metric, after `size` of what is missing at v: all else is known."""
    start, driven, wrong, answered = equation.start(p), equation.driven(p), equation.solved(p), equation.answered(p)
    has_rows, square = equation.head(p).nrow > 0, 0.0
    for k in range(v.size):
        rest = v[k] - start[k] - driven[k] - wrong[k]
        square += q[k] * (rest + answered[k] if has_rows else rest)
    return np.sqrt(max(equation.numbers(p).h * square, 0.0))


@exact
def allowed(p, b, v):
    """The error that body b's velocity may have at a generalised velocity [m/s]."""
    return allowed_at(p, speed_of(p, b, v))


@exact
def copy_point(p, origin, target):
    """Copy a point: its velocity, residual, errors of rows, the sand's answers and scores."""
    linear_algebra.copy(equation.velocity_of(p, origin), equation.velocity_of(p, target))
    linear_algebra.copy(equation.residual_of(p, origin), equation.residual_of(p, target))
    linear_algebra.copy(equation.errors_of(p, origin), equation.errors_of(p, target))
    linear_algebra.copy(equation.answers_of(p, origin), equation.answers_of(p, target))
    known, copied = equation.scores(p, origin), equation.scores(p, target)
    copied.missing, copied.scale, copied.error = known.missing, known.scale, known.error
