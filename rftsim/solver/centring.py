"""The end of a step from the solution of its equation, corrected for the force at the step's mean velocity."""

from typing import Final

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation, linear_algebra, linearised
from rftsim.solver.equation import POINT
from rftsim.solver.motion import evaluate, generalised, speed_of, twist_of

CENTRED: Final = 3e-3
"""Effect of the force's change within a step on a body's velocity, relative, from which on it is counted."""


@exact
def centre(p):
    """Fill `end`: one step of Newton's method from the best point, without an evaluation.

    It is corrected to first order for the force at the step's mean velocity instead of its end. What is stiff against
    the mass is left out of that, by M A^-1: a body that stops in the step stays stopped.
    """
    known = equation.numbers(p).knows_derivative > 0.0
    v, start, end = equation.velocity_of(p, POINT.best), equation.start(p), equation.end(p)
    mean = equation.mean(p)
    linear_algebra.copy(v, end)
    for k in range(v.size):
        mean[k] = v[k] - start[k]
    is_small = not known or _is_small(p, mean, v, 0.5)
    scores = equation.scores(p, POINT.best)
    if is_small and scores.missing < 1e-4 * scores.scale:
        return
    which = linearised.EXACT if known else linearised.NONE
    linearised.solution(p, v, equation.residual_of(p, POINT.best), which, end)
    if is_small or _is_foreseen_small(p):
        return
    _correct(p)


@exact
def _is_small(p, change, v, share):
    """Whether a share of a velocity change makes no difference to any body."""
    v_c = equation.numbers(p).v_c
    for b in range(equation.head(p).nbody):
        if share * speed_of(p, b, change) > CENTRED * speed_of(p, b, v) + 10.0 * v_c:
            return False
    return True


@exact
def _is_foreseen_small(p):
    """Whether the correction by the derivative, at a velocity change in `mean`, makes no difference to any body."""
    h, mean, difference = equation.numbers(p).h, equation.mean(p), equation.difference(p)
    twist, wrench = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    for k in range(mean.size):
        difference[k] = 0.0
    for b in range(equation.head(p).nbody):
        twist_of(p, b, mean, twist)
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        linear_algebra.add_transposed(equation.jacobian(p, b), wrench, -0.5 * h, difference)
    _filter(p, difference, equation.filtered(p))
    return _is_small(p, equation.filtered(p), equation.velocity_of(p, POINT.best), 1.0)


@exact
def _correct(p):
    """Add the effect of the force at the mean velocity, from one evaluation, to `end`."""
    h, v, start = equation.numbers(p).h, equation.velocity_of(p, POINT.best), equation.start(p)
    mean, difference, changed = equation.mean(p), equation.difference(p), equation.filtered(p)
    linear_algebra.multiply(equation.mass(p), mean, difference)
    largest = 0.25 * linear_algebra.dot(mean, difference)
    for k in range(v.size):
        mean[k] = 0.5 * (start[k] + v[k])
    evaluate(p, mean, POINT.spare)
    generalised(p, POINT.spare, 0, difference)
    generalised(p, POINT.best, 0, mean)
    for k in range(v.size):
        difference[k] = h * (difference[k] - mean[k])
    _filter(p, difference, changed)
    linear_algebra.multiply(equation.mass(p), changed, difference)
    if linear_algebra.dot(changed, difference) <= largest:  # else the derivative is not to be trusted
        end = equation.end(p)
        for k in range(v.size):
            end[k] += changed[k]


@exact
def _filter(p, impulse, out):
    """Fill out with A^-1 M A^-1 impulse, A the matrix that the linearised equation left factored."""
    factors, order, between = equation.linear_factors(p), equation.linear_order(p), equation.solved(p)
    linear_algebra.substitute(factors, order, impulse, out)
    linear_algebra.multiply(equation.mass(p), out, between)
    linear_algebra.substitute(factors, order, between, out)
