"""The equation with the sand's force linearised: a convex problem in the constraints, which is solved exactly."""

from typing import Final

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, sparse

NONE: Final = 0
EXACT: Final = 1
COMPLETED: Final = 2
"""Which derivative of the sand's force the linearised equation takes."""
ITERATIONS: Final = 20
"""Steps of Newton's method on the rows, and trials of one step's length, at most."""
EXACTNESS: Final = (1e-16, 1e-6, 1e-6)
"""Square of the share of the missing impulse that may be left, by which derivative is taken."""


@exact
def _derivative(p, which, b):
    if which == COMPLETED:
        return equation.completed(p, b)
    return equation.derivative(p, b)


@exact
def _add_derivative(p, b, g, a):
    """Add -h J' G J to a matrix, G the derivative of body b's wrench by its twist."""
    path, n, h = equation.path(p, b), equation.path_length(p)[b], equation.numbers(p).h
    wrench = doubles(stack_doubles(6), 6)
    for k in range(n):
        linear_algebra.multiply(g, equation.motion(p, b, k), wrench)
        for r in range(6):
            wrench[r] *= -h
        for i in range(n):
            a[path[i], path[k]] += linear_algebra.dot(equation.motion(p, b, i), wrench)


@exact
def _linearise(p, which):
    """Fill `equation.linear` with M - h J' G J, G the sand's derivatives; with M for NONE."""
    a = equation.linear(p)
    sparse.copy(p, equation.mass(p), a)
    if which == NONE:
        return
    for b in range(equation.head(p).nbody):
        if which == COMPLETED or equation.kept(p, b).known > 0.0:
            _add_derivative(p, b, _derivative(p, which, b), a)


@exact
def _factor_with_rows(p, x, force):
    """Factor `equation.linear` with the rows' stiffness at x."""
    a = equation.linear_factors(p)
    sparse.copy(p, equation.linear(p), a)
    if equation.head(p).nrow > 0:
        constraint_rows.add_stiffness(p, x, force, a)
    sparse.factor(p, a)


@exact
def solution(p, v, residual, which, out):
    """Fill out with the velocity that solves the equation for the sand's force linearised at v, the rows exactly."""
    _linearise(p, which)
    if equation.head(p).nrow > 0:
        _solve_with_rows(p, v, residual, which, out)
        return
    direction, nothing = equation.direction(p), equation.missing(p)
    _factor_with_rows(p, nothing, nothing)
    sparse.substitute(p, equation.linear_factors(p), residual, direction)
    for k in range(v.size):
        out[k] = v[k] - direction[k]


@exact
def _begin_with_rows(p, v, residual, out):
    """Take the linearised equation to v: fill out, the rows' x and forces, and what is missing but for the rows."""
    h, start, change = equation.numbers(p).h, equation.start(p), equation.change(p)
    x, force, fixed, missing = equation.row_error(p), equation.row_force(p), equation.fixed(p), equation.missing(p)
    for k in range(v.size):
        change[k] = v[k] - start[k]
        out[k] = v[k]
        fixed[k] = residual[k]
        missing[k] = residual[k]
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    constraint_rows.add_forces(p, force, h, fixed)


@exact
def _solve_with_rows(p, v, residual, which, out):
    """Newton's method on the rows, each step to where the missing impulse along it vanishes."""
    _begin_with_rows(p, v, residual, out)
    h = equation.numbers(p).h
    x, force, moved = equation.row_error(p), equation.row_force(p), equation.row_moved(p)
    change, fixed, missing = equation.change(p), equation.fixed(p), equation.missing(p)
    direction = equation.direction(p)
    first = True
    target = EXACTNESS[which] * (linear_algebra.dot(residual, residual) + TINY)
    for _ in range(ITERATIONS):
        if constraint_rows.note_zones(p, x) or first:
            _factor_with_rows(p, x, force)
        first = False
        sparse.substitute(p, equation.linear_factors(p), missing, direction)
        for k in range(v.size):
            direction[k] = -direction[k]
        sparse.multiply(p, equation.linear(p), direction, change)
        stiff, slope = linear_algebra.dot(direction, change), linear_algebra.dot(direction, fixed)
        constraint_rows.changes(p, direction, moved)
        t = _crossing(p, slope, stiff)
        for k in range(v.size):
            out[k] += t * direction[k]
            fixed[k] += t * change[k]
            missing[k] = fixed[k]
        for i in range(x.size):
            x[i] += t * moved[i]
        constraint_rows.forces(p, x, force)
        constraint_rows.add_forces(p, force, -h, missing)
        if linear_algebra.dot(missing, missing) <= target:
            break


@exact
def _along(p, slope, stiff, t):
    """Missing impulse along `equation.direction` after a share t of it; slope and stiff are what is not the rows'."""
    x, moved, tried, force = equation.row_error(p), equation.row_moved(p), equation.row_tried(p), equation.row_force(p)
    h, share = equation.numbers(p).h, equation.row_share(p)
    for i in range(x.size):
        tried[i] = x[i] + t * moved[i]
    constraint_rows.forces(p, tried, force)
    return slope + t * stiff - h * linear_algebra.dot(force, share)


@exact
def _crossing(p, slope, stiff):
    """The share t of `equation.direction`, at most one, after which the missing impulse along it vanishes."""
    share, direction = equation.row_share(p), equation.direction(p)
    for i in range(share.size):
        share[i] = constraint_rows.product(p, i, direction)
    low, at_low = 0.0, _along(p, slope, stiff, 0.0)
    high, at_high = 1.0, _along(p, slope, stiff, 1.0)
    if at_high <= 1e-6 * abs(at_low) or at_low >= 0.0:
        return 1.0
    wanted, t = 1e-3 * abs(at_low), 1.0
    for _ in range(ITERATIONS):
        t = low - at_low * (high - low) / (at_high - at_low)
        margin = 0.05 * (high - low)
        t = min(max(t, low + margin), high - margin)
        found = _along(p, slope, stiff, t)
        if abs(found) < wanted:
            break
        if found < 0.0:
            low, at_low = t, found
        else:
            high, at_high = t, found
    return t
