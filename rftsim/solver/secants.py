"""Where Newton's method leads nowhere: along secants of the bodies' forces, which do not overshoot.

The completed derivative of a body is that of a force which falls to zero with the speed: taken for the force it gives
the velocity to which that would lead, and so on, as one iterates for dry friction. That comes to rest and past edges,
but takes its time; so each step is extrapolated by the change from the one before (Anderson's acceleration, of depth
one). Bodies whose force their derivative tells keep that.
"""

from typing import Final

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, linearised, matrices
from rftsim.solver.equation import POINT
from rftsim.solver.motion import differentiate, felt_twist
from rftsim.solver.residual import attempt, copy_point
from rftsim.solver.steps import BUDGET, DERIVATIVE, RESERVE, keep_best, note_misfits, poor_misfit, worth

WORSE: Final = 1.5
"""Factor on the missing impulse, over all impulses, up to which an extrapolated step is taken."""
FARTHEST: Final = 1.0
"""Most of the last change by which a step is extrapolated."""


@exact
def follow(p, enough):
    """Lead POINT.now to where less than a share of all impulses is missing, as far as evaluations last."""
    progress, numbers, now = equation.progress(p), equation.numbers(p), equation.scores(p, POINT.now)
    has_last = False
    linear_algebra.clear(equation.is_hard(p))
    _note_hard(p)
    while now.missing > enough * now.scale and progress.iteration < numbers.iterations:
        if worth(p) > BUDGET - RESERVE - DERIVATIVE - 1.0:
            break
        progress.iteration += 1.0
        _fill_step(p)
        has_last = _take(p, has_last)


@exact
def _note_hard(p):
    """Note of which bodies secants are followed: those whose derivatives miss their forces worst at the new point."""
    note_misfits(p)
    misfit, hard, poor = equation.misfit(p), equation.is_hard(p), poor_misfit(p)
    for b in range(misfit.size):
        hard[b] = 1.0 if misfit[b] >= poor else hard[b]


@exact
def _fill_step(p):
    """Fill `search` with the way to where the forces' secants lead from POINT.now."""
    v, search, twist = equation.velocity_of(p, POINT.now), equation.search(p), doubles(stack_doubles(6), 6)
    equation.numbers(p).is_linearised = 0.0
    for b in range(equation.head(p).nbody):
        if equation.is_hard(p)[b] > 0.0:
            felt_twist(p, b, v, twist)
            differentiate(p, b, twist, 1.0)
    errors, residual = equation.errors_of(p, POINT.now), equation.residual_of(p, POINT.now)
    linearised.solution(p, v, errors, residual, linearised.COMPLETED, search)
    for k in range(v.size):
        search[k] -= v[k]


@exact
def _take(p, has_last):
    """Go on by `search`, extrapolated if there is a last step; whether that may be extrapolated from."""
    v, search, now, new = (
        equation.velocity_of(p, POINT.now),
        equation.search(p),
        equation.scores(p, POINT.now),
        equation.scores(p, POINT.new),
    )
    last, last_step, most = equation.last(p), equation.last_step(p), WORSE * now.missing / now.scale
    share = _extrapolation(p) if has_last else 0.0
    _try(p, share)
    is_kept = new.missing <= most * new.scale
    if share != 0.0 and not is_kept:
        copy_point(p, POINT.new, POINT.spare)
        _try(p, 0.0)
        spare = equation.scores(p, POINT.spare)
        if spare.missing * new.scale < new.missing * spare.scale:
            copy_point(p, POINT.spare, POINT.new)
    _note_hard(p)
    linear_algebra.copy(v, last)
    linear_algebra.copy(search, last_step)
    copy_point(p, POINT.new, POINT.now)
    keep_best(p, POINT.now)
    return is_kept


@exact
def _try(p, share):
    """Evaluate in POINT.new the end of `search`, less a share of the change that led to it from the last one."""
    v, new, search = equation.velocity_of(p, POINT.now), equation.velocity_of(p, POINT.new), equation.search(p)
    last, last_step = equation.last(p), equation.last_step(p)
    for k in range(v.size):
        new[k] = v[k] + search[k]
        if share != 0.0:
            new[k] -= share * (new[k] - last[k] - last_step[k])
    constraint_rows.errors_at(p, new, equation.errors_of(p, POINT.new))
    attempt(p, POINT.new)


@exact
def _extrapolation(p):
    """The share of the last change by which `search` would be smallest, were it linear, in the metric of the mass."""
    search, last_step, grown, impulse = equation.search(p), equation.last_step(p), equation.there(p), equation.change(p)
    for k in range(search.size):
        grown[k] = search[k] - last_step[k]
    matrices.multiply(p, equation.mass(p), grown, impulse)
    share = linear_algebra.dot(impulse, search) / (linear_algebra.dot(impulse, grown) + TINY)
    return min(max(share, -FARTHEST), FARTHEST)
