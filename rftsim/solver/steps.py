"""Steps of a solution: what is foreseen, the direction of Newton's method, and the points that are tried."""

from typing import Final

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, linearised, residual
from rftsim.solver.equation import POINT
from rftsim.solver.motion import add_wrench, differentiate, felt_twist
from rftsim.solver.residual import attempt, copy_point

BUDGET: Final = 60.0
"""Evaluations' worth of one step of all bodies."""
DERIVATIVE: Final = 2.0
"""Evaluations that a derivative is worth."""
RESERVE: Final = 4.0
"""Evaluations' worth that is left unspent by one solution, for what follows it."""
KEPT_LEAVES: Final = 0.3
FRESH_LEAVES: Final = 0.1
LEAST_LEFT: Final = 0.02
"""Share of the missing impulse that a step is thought to leave: of a kept derivative, of one that was just taken, and
at least, where the last step showed it."""
POOR: Final = 0.2
"""Share of the largest misfit from which on a body's derivative is taken anew."""


@exact
def worth(p):
    """The evaluations' worth of what was spent on the step so far."""
    spent = equation.work(p)
    return spent.evaluations + DERIVATIVE * spent.derivatives


@exact
def predict(p):
    """Fill the velocity of POINT.now with the solution for the kept forces, linear in each body's twist."""
    start, q, missing = equation.start(p), equation.sand_force(p), equation.residual_of(p, POINT.now)
    twist, wrench = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    linear_algebra.clear(q)
    for b in range(equation.head(p).nbody):
        kept = equation.kept(p, b)
        if kept.known == 0.0:
            continue
        felt_twist(p, b, start, twist)
        for r in range(6):
            twist[r] -= kept.twist[r]
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        for r in range(6):
            wrench[r] += kept.wrench[r]
        add_wrench(p, b, wrench, 1.0, q)
    errors = equation.errors_of(p, POINT.now)
    constraint_rows.errors_at_start(p, errors)
    residual.fill(p, start, errors, q, missing)
    linearised.solution(p, start, errors, missing, linearised.EXACT, equation.velocity_of(p, POINT.now))
    linear_algebra.copy(equation.row_error(p), errors)


@exact
def choose_direction(p):
    """Fill `search` with the step to the solution of the linearised equation, by the derivative that is its turn."""
    progress, v = equation.progress(p), equation.velocity_of(p, POINT.now)
    progress.by_secant = 1.0 if progress.secants_left > 0.0 else 0.0
    if progress.by_secant > 0.0:
        twist = doubles(stack_doubles(6), 6)
        for b in range(equation.head(p).nbody):
            felt_twist(p, b, v, twist)
            differentiate(p, b, twist, 1.0)
        progress.secants_left -= 1.0
    elif progress.is_stale > 0.0:
        _refresh(p)
    which = linearised.COMPLETED if progress.by_secant > 0.0 else linearised.EXACT
    direction = equation.search(p)
    linearised.solution(p, v, equation.errors_of(p, POINT.now), equation.residual_of(p, POINT.now), which, direction)
    for k in range(v.size):
        direction[k] -= v[k]
    progress.share = 1.0


@exact
def _refresh(p):
    """Take the derivatives anew that are unknown, or that foresaw the last change of force worst; else all."""
    misfit, fresh, largest, twist = equation.misfit(p), equation.is_fresh(p), 0.0, doubles(stack_doubles(6), 6)
    for b in range(fresh.size):
        if equation.kept(p, b).known == 0.0:
            misfit[b] = 1e300
        largest = max(largest, misfit[b] if fresh[b] == 0.0 else 0.0)
    for b in range(fresh.size):
        if fresh[b] == 0.0 and (misfit[b] >= POOR * largest or equation.progress(p).is_stale > 1.0):
            felt_twist(p, b, equation.velocity_of(p, POINT.now), twist)
            differentiate(p, b, twist, 0.0)
            fresh[b], misfit[b], equation.kept(p, b).known = 1.0, 0.0, 1.0
    progress = equation.progress(p)
    progress.is_stale, progress.contraction = 0.0, FRESH_LEAVES if progress.failures == 0.0 else 1.0


@exact
def keep_best(p, k):
    """Take point k for the best where its error is smaller."""
    if equation.scores(p, k).error < equation.scores(p, POINT.best).error:
        copy_point(p, k, POINT.best)


@exact
def move_on(p):
    """Make the new point the present one."""
    copy_point(p, POINT.new, POINT.now)
    linear_algebra.clear(equation.is_fresh(p))


@exact
def try_along(p, direction, t, k):
    """Evaluate the equation a share t of the direction that was chosen from point POINT.now on, into point k."""
    v, new = equation.velocity_of(p, POINT.now), equation.velocity_of(p, k)
    for i in range(new.size):
        new[i] = v[i] + t * direction[i]
    solved, errors, tried = equation.row_error(p), equation.errors_of(p, POINT.now), equation.errors_of(p, k)
    for i in range(tried.size):
        tried[i] = errors[i] + t * (solved[i] - errors[i])
    attempt(p, k)
