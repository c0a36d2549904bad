"""The sand's force at the end of a time step: a velocity that the force it causes would lead to.

Resistive force knows the direction of motion and not the speed, so at rest it is a jump. Taken from the start of a step
it chatters and is biased; here v+ solves

    M (v+ - v) = h (tau + J' f(v+) + Q(v+)),

tau the other smooth forces, f the constraints' by MuJoCo's own law, Q the sand's with |v| / sqrt(|v|^2 + v_c^2) before
each triangle's stress. What rests does not creep for that: the law feels a body's twist and its strain, a twist that
takes up the motion from step to step, up to some v_c, as sand gives way a little before it flows.

The solver is Newton's method with kept derivatives of the sand (a rank-one update per body and iteration); each of its
steps solves the constraints exactly for the sand's force linearised, which costs no evaluation. Where a step passes
rest or the edge of a face, the next trial is at rest, or less of it, or along secants that cannot overshoot.

`p` is the address of the equation's table.
"""

from typing import Final

from numba import types

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, residual
from rftsim.solver.centring import centre
from rftsim.solver.detours import is_refused
from rftsim.solver.equation import POINT
from rftsim.solver.motion import size_of, speed_of
from rftsim.solver.residual import allowed, attempt, copy_point
from rftsim.solver.steps import (
    BRAKE,
    DERIVATIVE,
    ENOUGH,
    KEPT_LEAVES,
    LEAST_LEFT,
    choose_direction,
    is_affordable,
    keep_best,
    missed_by,
    move_on,
    note_trends,
    predict,
    try_along,
)

V_C: Final = 1e-5
"""Least speed v_c [m/s] below which a triangle's stress falls to zero."""
OF_FASTEST: Final = 3e-4
"""v_c over the speed of the fastest body. A body at rest amid moving ones, loaded to near what the sand bears, is the
hardest of all to solve for, and is so less often."""
STRAIN: Final = 30.0
"""The largest strain over v_c: the sand then bears 0.9994 of its strength at rest."""
FORCE: Final = 2.0
"""Missing impulse that is allowed, over all impulses and the tolerance."""
MOST_FORCE: Final = 6e-3
"""The same over all impulses at most: what holds a plate on its way edge-on jumps within a hundredth of its speed."""
PATIENCE: Final = 6.0
"""Iterations after which the tolerance is loosened."""
LOOSEST: Final = 20.0
"""Factor to which that is."""
HELD: Final = 30.0
"""Speed over v_c below which a body is held by the sand, or nearly."""
HELD_FORCE: Final = 0.1
"""Missing impulse that is allowed where one is, over all impulses and the tolerance."""
STRICT: Final = 2.0
"""Iterations in which that holds."""
ROUGH: Final = (2.0, 2e-2)
"""Iterations after which more may be missing, and how much, over all impulses. Where many small faces switch, no
derivative tells how the force goes on; the velocities are right then, and the force of a step is off by that."""


@entry(types.void, address)
def solve(p):
    """Solve the equation: fill `end` and its numbers, leave the velocity and its wrenches in point POINT.best."""
    _begin(p)
    progress, best = equation.progress(p), equation.scores(p, POINT.best)
    accepted = False
    while not accepted and (progress.is_stale == 0.0 or is_affordable(p, DERIVATIVE)):
        if progress.shortened == 0.0:
            choose_direction(p)
            accepted = _is_short(p)
        if accepted or _is_given_up(p):
            break
        progress.iteration += 1.0
        if progress.iteration > PATIENCE:
            progress.loosened = min(1.5 * progress.loosened, LOOSEST)
        try_along(p, equation.search(p), progress.share, POINT.new)
        keep_best(p, POINT.new)
        if not is_refused(p):
            _accept(p)
    if accepted:
        copy_point(p, POINT.now, POINT.best)
    near = best.error <= LOOSEST or best.missing <= ROUGH[1] * best.scale
    equation.numbers(p).solved = 1.0 if accepted or near else 0.0
    centre(p, accepted)


@exact
def hold(p, b, twist, out):
    """Fill out with the strain of body b, over v_c, after a step in which the law felt a twist, (6,)."""
    share = min(1.0 / equation.numbers(p).v_c, STRAIN / (size_of(twist, equation.length(p)[b]) + TINY))
    for r in range(6):
        out[r] = share * twist[r]


@exact
def _is_given_up(p):
    """Whether the solution ends at its best point: too many iterations, or a face on its edge: nothing is nearer."""
    progress, best = equation.progress(p), equation.scores(p, POINT.best)
    if progress.iteration >= equation.numbers(p).iterations or not is_affordable(p, 1.0 + BRAKE):
        return True
    return progress.iteration > PATIENCE and (best.error <= progress.loosened or best.missing < ROUGH[1] * best.scale)


@exact
def _begin(p):
    """Set the equation's scales, and evaluate it where the kept derivatives lead, or at the last velocity."""
    numbers, progress = equation.numbers(p), equation.progress(p)
    numbers.scale, numbers.v_c = numbers.h * residual.size(p, equation.force(p)), V_C
    driven, acceleration = equation.driven(p), equation.solved(p)
    for k in range(driven.size):
        driven[k] = numbers.h * acceleration[k]
    progress.is_stale, known = 0.0, True
    for b in range(equation.head(p).nbody):
        numbers.v_c = max(numbers.v_c, OF_FASTEST * speed_of(p, b, equation.start(p)))
    for b in range(equation.head(p).nbody):
        strain, held = equation.strain(p, b), equation.kept(p, b).strain
        for r in range(6):
            strain[r] = numbers.v_c * held[r]
        equation.is_fresh(p)[b] = equation.misfit(p)[b] = equation.is_seen(p)[b] = equation.is_hard(p)[b] = 0.0
        known = known and equation.kept(p, b).known > 0.0
    progress.shortened = progress.rested = progress.eased = progress.iteration = 0.0
    progress.loosened = progress.share = 1.0
    progress.contraction, progress.enough = KEPT_LEAVES, ENOUGH
    predict(p)
    attempt(p, POINT.now)
    note_trends(p)
    now, new = equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    if not known:
        progress.is_stale = 1.0
    elif now.error > 1.0 and now.missing > 0.3 * now.scale:  # a poor guess: is the start nearer?
        linear_algebra.copy(equation.start(p), equation.velocity_of(p, POINT.new))
        constraint_rows.errors_at_start(p, equation.errors_of(p, POINT.new))
        attempt(p, POINT.new)
        progress.is_stale = 1.0
        if new.missing < now.missing:
            copy_point(p, POINT.new, POINT.now)
    copy_point(p, POINT.now, POINT.best)


@exact
def _is_short(p):
    """Whether the direction at hand is so short that it leads to the solution, as near as is asked for."""
    numbers, progress, now = equation.numbers(p), equation.progress(p), equation.scores(p, POINT.now)
    if now.error <= 1.0:
        return True
    left, there, force = progress.contraction, equation.there(p), min(FORCE * numbers.tolerance, MOST_FORCE)
    for k in range(there.size):
        there[k] = equation.velocity_of(p, POINT.now)[k] + equation.search(p)[k]
    for b in range(equation.head(p).nbody):
        if not left * speed_of(p, b, equation.search(p)) <= allowed(p, b, there):
            return False
        if speed_of(p, b, there) < HELD * numbers.v_c and progress.iteration < STRICT:
            force = HELD_FORCE * numbers.tolerance
    if progress.iteration >= ROUGH[0]:
        force = max(force, ROUGH[1])
    return left * now.missing <= force * now.scale


@exact
def _accept(p):
    """Go on from the new point."""
    progress, now, new = equation.progress(p), equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    progress.shortened = 0.0
    left = new.missing / max(now.missing, TINY)
    progress.is_stale = 1.0 if left > 0.3 else 0.0
    progress.contraction = min(max(left, LEAST_LEFT), 1.0)
    _update(p, POINT.now, POINT.new)
    move_on(p)


@exact
def _update(p, old, new):
    """Broyden's rank-one update of each body's derivative from two points; what they did not foresee.

    A new point within the tolerance is left by one short step more, for which the matrix that led to it will do.
    """
    moved, missed = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        length, square = equation.length(p)[b], missed_by(p, b, old, new, moved, missed)
        if square <= 0.0:
            continue
        g = equation.derivative(p, b)
        for r in range(6):
            for k in range(6):
                g[r, k] += missed[r] / square * (1.0 if k < 3 else length) * moved[k]
        equation.misfit(p)[b] = size_of(missed, 1.0 / length)
    if equation.scores(p, new).error > 1.0:
        equation.numbers(p).is_linearised = 0.0
