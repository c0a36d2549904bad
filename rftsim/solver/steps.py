"""Steps of a solution: what is foreseen, the direction of Newton's method, and the points that are tried."""

from typing import Final

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, linearised, residual
from rftsim.solver.equation import POINT
from rftsim.solver.motion import add_wrench, differentiate, felt_twist, size_of, twist_of
from rftsim.solver.residual import attempt, copy_point

BUDGET: Final = 60.0
"""Evaluations' worth of one step of all bodies."""
DERIVATIVE: Final = 2.0
"""Evaluations that a derivative is worth."""
BRAKE: Final = DERIVATIVE + 1.0
"""Evaluations' worth of the end of a solution that found none."""
KEPT_LEAVES: Final = 0.3
FRESH_LEAVES: Final = 0.1
LEAST_LEFT: Final = 0.02
"""Share of the missing impulse that a step is thought to leave: of a kept derivative, of one that was just taken, and
at least, where the last step showed it."""
ENOUGH: Final = 0.05
"""Missing impulse, over all impulses, up to which secants are followed at first."""
STEADY: Final = 0.5
"""Share of the square of what was missed that may be left by the trend that is foreseen."""
POOR: Final = 0.2
"""Share of the largest misfit from which on a body's derivative is taken anew."""


@exact
def worth(p):
    """The evaluations' worth of what was spent on the step so far."""
    spent = equation.work(p)
    return spent.evaluations + DERIVATIVE * spent.derivatives


@exact
def is_affordable(p, cost):
    """Whether so many evaluations' worth can be spent on the solution at hand."""
    return worth(p) + cost <= equation.numbers(p).budget


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
            wrench[r] += kept.wrench[r] + kept.trend * kept.missed[r]
        add_wrench(p, b, wrench, 1.0, q)
    errors = equation.errors_of(p, POINT.now)
    constraint_rows.errors_at_start(p, errors)
    residual.fill(p, start, errors, q, missing)
    linearised.solution(p, start, errors, missing, linearised.EXACT, equation.velocity_of(p, POINT.now))
    linear_algebra.copy(equation.row_error(p), errors)


@exact
def note_trends(p):
    """Note by how much the forces at a step's first point were missed without their trends, and what it tells.

    What turns normals and brings faces into the sand goes on from step to step; what is at random does not. Parts of a
    step are too short to tell.
    """
    twist, wrench, is_whole = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6), _is_whole(p)
    for b in range(equation.head(p).nbody):
        kept, answer = equation.kept(p, b), equation.wrench_of(p, POINT.now, b, 0)
        before, along, square = linear_algebra.dot(kept.missed, kept.missed), 0.0, 0.0
        felt_twist(p, b, equation.velocity_of(p, POINT.now), twist)
        for r in range(6):
            twist[r] -= kept.twist[r]
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        for r in range(6):
            wrench[r] = answer[r] - kept.wrench[r] - wrench[r] if is_whole and kept.known > 0.0 else 0.0
            along += wrench[r] * kept.missed[r]
            square += wrench[r] * wrench[r]
        share = min(max(along / (before + TINY), 0.0), 1.0)
        left = square - share * (2.0 * along - share * before)
        kept.trend = share if left < STEADY * square else 0.0
        linear_algebra.copy(wrench, kept.missed)


@exact
def _is_whole(p):
    """Whether the equation is that of a step after one of the same length, and of no part of one."""
    return equation.numbers(p).h == equation.numbers(p).timestep


@exact
def choose_direction(p):
    """Fill `search` with the step to the solution of the linearised equation, by derivatives that did not mislead."""
    v, search = equation.velocity_of(p, POINT.now), equation.search(p)
    if equation.progress(p).is_stale > 0.0:
        _refresh(p)
    errors, residual = equation.errors_of(p, POINT.now), equation.residual_of(p, POINT.now)
    linearised.solution(p, v, errors, residual, linearised.EXACT, search)
    for k in range(v.size):
        search[k] -= v[k]
    equation.progress(p).share = 1.0


@exact
def missed_by(p, b, old, new, moved, missed):
    """Fill by how much body b moved from one point to another, and by how much its derivative misses its force there.

    Both are (6,), the angular velocity times the body's length; returns the square of the former's size.
    """
    twist, length, square, g = doubles(stack_doubles(6), 6), equation.length(p)[b], 0.0, equation.derivative(p, b)
    twist_of(p, b, equation.velocity_of(p, new), moved)
    twist_of(p, b, equation.velocity_of(p, old), twist)
    for r in range(6):
        moved[r] -= twist[r]
        moved[r] *= 1.0 if r < 3 else length
        square += moved[r] * moved[r]
    before, after = equation.wrench_of(p, old, b, 0), equation.wrench_of(p, new, b, 0)
    for r in range(6):
        missed[r] = after[r] - before[r]
        for k in range(6):
            missed[r] -= g[r, k] * moved[k] / (1.0 if k < 3 else length)
    return square


@exact
def note_misfits(p):
    """Note by how much the derivatives miss the bodies' forces at the new point from the present one."""
    moved, missed = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        missed_by(p, b, POINT.now, POINT.new, moved, missed)
        equation.misfit(p)[b] = size_of(missed, 1.0 / equation.length(p)[b])


@exact
def poor_misfit(p):
    """The misfit from which on a body's derivative is said to have missed its force by far [N]."""
    misfit, largest = equation.misfit(p), 0.0
    for b in range(misfit.size):
        largest = max(largest, misfit[b])
    return POOR * largest


@exact
def is_misled(p):
    """Whether a derivative missed a force by far that is not that at the present point."""
    misfit, fresh, poor, found = equation.misfit(p), equation.is_fresh(p), poor_misfit(p), False
    for b in range(fresh.size):
        found = found or (fresh[b] == 0.0 and misfit[b] >= poor)
    return found


@exact
def _refresh(p):
    """Take the derivatives anew that are unknown, or that foresaw the last change of force worst."""
    misfit, fresh, largest, twist = equation.misfit(p), equation.is_fresh(p), 0.0, doubles(stack_doubles(6), 6)
    for b in range(fresh.size):
        if equation.kept(p, b).known == 0.0:
            misfit[b] = 1e300
        largest = max(largest, misfit[b] if fresh[b] == 0.0 else 0.0)
    for b in range(fresh.size):
        if fresh[b] == 0.0 and misfit[b] >= POOR * largest:
            felt_twist(p, b, equation.velocity_of(p, POINT.now), twist)
            differentiate(p, b, twist, 0.0)
            fresh[b], misfit[b], equation.kept(p, b).known = 1.0, 0.0, 1.0
    progress = equation.progress(p)
    progress.is_stale, progress.contraction = 0.0, FRESH_LEAVES if progress.enough == ENOUGH else 1.0


@exact
def keep_best(p, k):
    """Take point k for the best where less is missing."""
    tried, best = equation.scores(p, k), equation.scores(p, POINT.best)
    if tried.missing * best.scale < best.missing * tried.scale:
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
