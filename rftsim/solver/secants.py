"""Where Newton's method leads nowhere: along secants of the bodies' forces, which do not overshoot.

The completed derivative S of a body is that of a force which falls to zero with the speed: taken for the force it gives
the velocity to which that would lead, and so on, as one iterates for dry friction. So one comes to rest and past edges,
but slowly: a held body's speed falls at each step by the share of its load in what the sand bears. Yet along a twist
the force is known: it only falls to zero below v_c. So each step goes to where the wrenches S y r / r(y) lead, with
r(y)^2 = |y|^2 + v_c^2, and S such that they are the bodies' own at the twist where it was taken; that is solved for by
Newton's method, which costs no evaluation. The steps are extrapolated by the change from the one before (Anderson's
acceleration, of depth one). Bodies whose force their derivative tells keep that.
"""

from typing import Final

import numpy as np

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, linearised, matrices, residual
from rftsim.solver.equation import POINT
from rftsim.solver.motion import differentiate, felt_twist, generalised, pace_of, square_of, told
from rftsim.solver.residual import attempt, copy_point
from rftsim.solver.steps import BRAKE, DERIVATIVE, is_affordable, keep_best, note_misfits, poor_misfit

WORSE: Final = 1.5
"""Factor on the missing impulse, over all impulses, up to which an extrapolated step is taken."""
FARTHEST: Final = 0.5
"""Most of the last change by which a step is extrapolated."""
LASTS: Final = 2
"""Steps for which a secant is taken, but for its size."""
FEW: Final = 6
"""Steps after which secants are followed of all bodies."""
STEPS: Final = 3
"""Steps of Newton's method, at most, to where secants lead."""
DROP: Final = 0.8
"""Share of what is missing that one of these leaves at most; else the wrenches are taken for linear."""
LEFT: Final = 0.1
"""Share of what was missing at which they end."""
FASTER: Final = 3.0
"""Size of a velocity that may be led to, over that at the start or of the best point: sand takes energy out."""


@exact
def follow(p, enough):
    """Lead POINT.now to where less than a share of all impulses is missing, as far as evaluations last.

    The bodies of which secants were followed are left noted in `misfit`: derivatives must be taken of them.
    """
    progress, numbers, now = equation.progress(p), equation.numbers(p), equation.scores(p, POINT.now)
    has_last, count, hard, most = False, 0, equation.is_hard(p), FASTER * _reach(p)
    linear_algebra.clear(equation.pace(p))
    _note_hard(p)
    while now.missing > enough * now.scale and progress.iteration < numbers.iterations:
        if not is_affordable(p, DERIVATIVE + 2.0 + BRAKE):
            break
        progress.iteration += 1.0
        _take_secants(p, count % LASTS == 0)
        _fill_step(p, most)
        has_last = _take(p, has_last)
        count += 1
        for b in range(hard.size):
            hard[b] = 1.0 if count >= FEW else hard[b]
    linear_algebra.copy(hard, equation.misfit(p))
    linear_algebra.clear(hard)


@exact
def _size(p, v):
    """Size of a generalised velocity in the metric of the mass."""
    momentum = equation.change(p)
    matrices.multiply(p, equation.mass(p), v, momentum)
    return np.sqrt(linear_algebra.dot(v, momentum))


@exact
def _reach(p):
    """The size of the velocities that are to be expected; POINT.now is set back to the best point if it is beyond."""
    driven = _size(p, equation.start(p)) + _size(p, equation.driven(p))
    reach = max(driven, _size(p, equation.velocity_of(p, POINT.best)))
    if not _size(p, equation.velocity_of(p, POINT.now)) <= FASTER * reach:
        copy_point(p, POINT.best, POINT.now)
    return reach


@exact
def _note_hard(p):
    """Note of which bodies secants are followed: those whose derivatives miss their forces worst at the new point."""
    note_misfits(p)
    misfit, hard, poor = equation.misfit(p), equation.is_hard(p), poor_misfit(p)
    for b in range(misfit.size):
        hard[b] = 1.0 if misfit[b] >= poor else hard[b]


@exact
def _take_secants(p, anew):
    """Fill the hard bodies' secants at POINT.now: taken there, or at hand; they give the wrench there in any case."""
    twist, wrench, pace = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6), equation.pace(p)
    for b in range(equation.head(p).nbody):
        if equation.is_hard(p)[b] == 0.0:
            continue
        s, length, known = equation.secant(p, b), equation.length(p)[b], equation.wrench_of(p, POINT.now, b, 0)
        felt_twist(p, b, equation.velocity_of(p, POINT.now), twist)
        now, share = pace_of(p, b, twist), 1.0
        if anew or pace[b] == 0.0:
            differentiate(p, b, twist, 1.0)
        else:
            share = pace[b] / now
        linear_algebra.multiply(s, twist, wrench)
        square = square_of(twist, length) + TINY
        for r in range(6):
            missed = (known[r] - share * wrench[r]) / square
            for k in range(6):
                s[r, k] = share * s[r, k] + missed * (1.0 if k < 3 else length * length) * twist[k]
        pace[b] = now


@exact
def _fill_step(p, most):
    """Fill `search` with the way from POINT.now to where the told wrenches lead, by velocities of at most a size."""
    v, end, search = equation.velocity_of(p, POINT.now), equation.velocity_of(p, POINT.spare), equation.search(p)
    first = missing = equation.scores(p, POINT.now).missing
    copy_point(p, POINT.now, POINT.spare)
    for _ in range(STEPS):
        left = _step_on(p, 1.0, most)
        if not left < DROP * missing:
            left = _step_on(p, 0.0, most)
        missing = left
        copy_point(p, POINT.new, POINT.spare)
        if missing <= LEFT * first:
            break
    for k in range(v.size):
        search[k] = end[k] - v[k]


@exact
def _step_on(p, exact_slope, most):
    """Step from POINT.spare to POINT.new, where the told wrenches lead if linear; what they leave missing there.

    They are taken for linear by their derivatives (1.0), or by their secants (0.0). The step is cut where it would lead
    to a velocity of more than a size.
    """
    twist, wrench = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    v, new = equation.velocity_of(p, POINT.spare), equation.velocity_of(p, POINT.new)
    equation.numbers(p).is_linearised = 0.0
    for b in range(equation.head(p).nbody):
        if equation.is_hard(p)[b] == 0.0:
            continue
        s, g, length = equation.secant(p, b), equation.slope(p, b), equation.length(p)[b]
        felt_twist(p, b, v, twist)
        told(p, b, twist, wrench)
        pace = pace_of(p, b, twist)
        share, turn = equation.pace(p)[b] / pace, exact_slope / (pace * pace)
        for r in range(6):
            for k in range(6):
                g[r, k] = share * s[r, k] - turn * wrench[r] * (1.0 if k < 3 else length * length) * twist[k]
    errors, missing = equation.errors_of(p, POINT.spare), equation.residual_of(p, POINT.spare)
    linearised.solution(p, v, errors, missing, linearised.TOLD, new)
    linear_algebra.copy(equation.row_error(p), equation.errors_of(p, POINT.new))
    if not _size(p, new) <= most:
        _cut(p, most)
    return _tell(p, POINT.new)


@exact
def _cut(p, most):
    """Take POINT.new back towards POINT.spare until its velocity is of no more than a size."""
    v, new, way = equation.velocity_of(p, POINT.spare), equation.velocity_of(p, POINT.new), equation.there(p)
    for k in range(v.size):
        way[k] = new[k] - v[k]
    share = max((most - _size(p, v)) / (_size(p, way) + TINY), 0.0)
    for k in range(v.size):
        new[k] = v[k] + share * way[k]
    constraint_rows.errors_at(p, new, equation.errors_of(p, POINT.new))


@exact
def _tell(p, k):
    """Fill what is missing at point k by the wrenches that secants tell, or derivatives; the size of that."""
    v, now, q = equation.velocity_of(p, k), equation.velocity_of(p, POINT.now), equation.sand_force(p)
    twist, before = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        wrench, known = equation.wrench_of(p, k, b, 0), equation.wrench_of(p, POINT.now, b, 0)
        felt_twist(p, b, v, twist)
        if equation.is_hard(p)[b] > 0.0:
            told(p, b, twist, wrench)
            continue
        felt_twist(p, b, now, before)
        for r in range(6):
            twist[r] -= before[r]
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        for r in range(6):
            wrench[r] += known[r]
    generalised(p, k, 0, q)
    missing = equation.residual_of(p, k)
    residual.fill(p, v, equation.errors_of(p, k), q, missing)
    return residual.size(p, missing)


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
