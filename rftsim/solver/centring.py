"""The end of a step from the solution of its equation, corrected for the force at the step's mean velocity."""

from typing import Final

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation, linear_algebra, linearised, matrices
from rftsim.solver.equation import POINT
from rftsim.solver.motion import add_wrench, differentiate, evaluate, felt_twist, generalised, speed_of, twist_of
from rftsim.solver.residual import attempt
from rftsim.solver.steps import BRAKE, is_affordable, keep_best

CENTRED: Final = 3e-3
"""Effect of the force's change within a step on a body's velocity, relative, from which on it is counted."""
CURVED: Final = 10.0
"""That effect, over the smallest that is counted, from which on the force at the mean velocity is evaluated."""


@exact
def centre(p, accepted):
    """Fill `end`: one step of Newton's method from the best point, without an evaluation, where that is short.

    It is corrected to first order for the force at the time step's mean velocity instead of its end. What is stiff
    against the mass is left out of that, by M A^-1: a body that stops in the step stays stopped. Else it is the best
    point itself, or what is better a step along secants on, where it is not near.

    Args:
        p: The equation.
        accepted: Whether `search` holds that short step.
    """
    v, start, end, mean = equation.velocity_of(p, POINT.best), equation.start(p), equation.end(p), equation.mean(p)
    if not accepted:
        if equation.numbers(p).solved == 0.0 and is_affordable(p, BRAKE):
            _brake(p)
        linear_algebra.copy(v, end)
        return
    for k in range(v.size):
        end[k] = v[k] + equation.search(p)[k]
    _follow(p)
    for k in range(v.size):
        mean[k] = end[k] - start[k]
    if _largest(p, mean, end) <= 2.0:
        return
    effect = _foresee(p)
    if effect > CURVED and is_affordable(p, 1.0):
        _evaluate(p)
    if effect > 1.0:
        _correct(p)


@exact
def _brake(p):
    """Take a step from the best point along the bodies' secants, which become their derivatives, if that is better.

    A long step that nothing has checked kicks bodies: rows hold against any force, and forces of a thousand times
    what the sand bears are then a solution of what is linear.
    """
    v, twist = equation.velocity_of(p, POINT.best), doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        felt_twist(p, b, v, twist)
        differentiate(p, b, twist, 1.0)
        linear_algebra.copy_matrix(equation.secant(p, b), equation.derivative(p, b))
        equation.kept(p, b).known = 1.0
    errors, missing = equation.errors_of(p, POINT.best), equation.residual_of(p, POINT.best)
    linearised.solution(p, v, errors, missing, linearised.EXACT, equation.velocity_of(p, POINT.new))
    linear_algebra.copy(equation.row_error(p), equation.errors_of(p, POINT.new))
    attempt(p, POINT.new)
    keep_best(p, POINT.new)


@exact
def _follow(p):
    """Take the best point, and its wrenches, to `end`, as the derivatives foresee."""
    change, twist, wrench = equation.change(p), doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    v, end = equation.velocity_of(p, POINT.best), equation.end(p)
    for k in range(v.size):
        change[k] = end[k] - v[k]
    for b in range(equation.head(p).nbody):
        if equation.kept(p, b).known == 0.0:
            continue
        twist_of(p, b, change, twist)
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        now, later = equation.wrench_of(p, POINT.best, b, 0), equation.wrench_of(p, POINT.best, b, 1)
        for r in range(6):
            now[r] += wrench[r]
            later[r] += wrench[r]
    linear_algebra.copy(end, v)


@exact
def _largest(p, change, end):
    """The largest change of a body's velocity over the smallest that is counted."""
    v_c, largest = equation.numbers(p).v_c, 0.0
    for b in range(equation.head(p).nbody):
        largest = max(largest, speed_of(p, b, change) / (CENTRED * speed_of(p, b, end) + 10.0 * v_c))
    return largest


@exact
def _foresee(p):
    """Fill `filtered` with the effect of the mean velocity, as the derivatives foresee; its largest, see `_largest`."""
    h, mean, difference = equation.numbers(p).h, equation.mean(p), equation.difference(p)
    twist, wrench = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    linear_algebra.clear(difference)
    for b in range(equation.head(p).nbody):
        if equation.kept(p, b).known == 0.0:
            continue
        twist_of(p, b, mean, twist)
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        add_wrench(p, b, wrench, -0.5 * h, difference)
    _filter(p, difference, equation.filtered(p))
    return _largest(p, equation.filtered(p), equation.end(p))


@exact
def _evaluate(p):
    """Fill `filtered` with the effect of the force at the mean velocity, from one evaluation."""
    h, end, start, there = equation.numbers(p).h, equation.end(p), equation.start(p), equation.there(p)
    for k in range(end.size):
        there[k] = 0.5 * (start[k] + end[k])
    evaluate(p, there, POINT.spare)
    q, difference = equation.others(p), equation.difference(p)
    generalised(p, POINT.spare, 0, difference)
    generalised(p, POINT.best, 0, q)
    for k in range(end.size):
        difference[k] = h * (difference[k] - q[k])
    _filter(p, difference, equation.filtered(p))


@exact
def _correct(p):
    """Add the effect of the mean velocity to `end`, unless it is larger than half of the step's change of velocity."""
    mean, changed, impulse = equation.mean(p), equation.filtered(p), equation.difference(p)
    matrices.multiply(p, equation.mass(p), mean, impulse)
    largest = 0.25 * linear_algebra.dot(mean, impulse)
    matrices.multiply(p, equation.mass(p), changed, impulse)
    if linear_algebra.dot(changed, impulse) <= largest:  # else the derivative is not to be trusted
        end = equation.end(p)
        for k in range(end.size):
            end[k] += changed[k]


@exact
def _filter(p, impulse, out):
    """Fill out with A^-1 M A^-1 impulse, A the matrix that the linearised equation left factored."""
    between = equation.solved(p)
    linearised.substitute(p, impulse, equation.seen(p), out)
    matrices.multiply(p, equation.mass(p), out, between)
    linearised.substitute(p, between, equation.seen(p), out)
