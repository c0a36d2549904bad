"""The sand's force at the end of a time step: a velocity that the force it causes would lead to.

Resistive force knows the direction of motion and not the speed, so at rest it is a jump. Taken from the start of a step
it chatters and is biased; here v+ solves

    M (v+ - v) = h (tau + J' f(v+) + Q(v+)),

tau the other smooth forces, f the constraints' by MuJoCo's own law, Q the sand's with |v| / sqrt(|v|^2 + v_c^2) before
each triangle's stress. The solver is Newton's method with kept derivatives of the sand (a rank-one update per body and
iteration); each of its steps solves the constraints exactly for the sand's force linearised, which costs no evaluation.
Where a step passes rest or the edge of a face, the next trial is at rest, or by a derivative that cannot overshoot.

`p` is the address of the equation's table.
"""

from typing import Final

import numpy as np
from numba import types

from rftsim.machine.compiling import exact
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation, linear_algebra, linearised, residual
from rftsim.solver.centring import centre
from rftsim.solver.equation import POINT
from rftsim.solver.motion import differentiate, generalised, speed_of, twist_of
from rftsim.solver.residual import attempt, copy_point

V_C: Final = 3e-7
"""Least speed v_c [m/s] below which a triangle's stress falls to zero; where all is at rest, bodies creep slower."""
CREEP: Final = 1e-4
"""v_c over the speed of the fastest body. A body at rest amid moving ones, loaded to near what the sand bears, is the
hardest of all to solve for, and is so less often."""
MOST: Final = 40
"""Iterations of one solution."""
LOOSEST: Final = 20.0
"""Factor to which the tolerance is loosened, from the sixth iteration on."""
NEAR: Final = 0.25
"""Square of the share of a body's speed that is left where a step is said to pass its rest."""
BESIDE: Final = 0.3
"""Speed, over v_c, at which a body is tried beside its rest."""


@entry(types.void, address)
def solve(p):
    """Solve the equation: fill `end` and its numbers, leave the velocity and its wrenches in point POINT.best."""
    _begin(p)
    progress, best = equation.progress(p), equation.scores(p, POINT.best)
    while best.error > progress.loosened and progress.iteration < MOST:
        progress.iteration += 1.0
        if progress.iteration > 6.0:
            progress.loosened = min(1.5 * progress.loosened, LOOSEST)
        if progress.iteration > 10.0 and best.missing < 5e-3 * best.scale:  # a face on its edge: nothing is closer
            break
        if progress.shortened == 0.0:
            _choose_direction(p)
        _try_along(p, equation.search(p), progress.share, POINT.new)
        _keep_best(p, POINT.new)
        if not _is_refused(p):
            _accept(p)
    numbers = equation.numbers(p)
    numbers.knows_derivative = progress.knows_derivative
    numbers.solved = 1.0 if best.error <= LOOSEST or best.missing <= 1e-2 * best.scale else 0.0
    centre(p)


@exact
def _begin(p):
    """Set the equation's scales, and evaluate it where the kept derivative leads, or at the last velocity."""
    numbers, progress, last = equation.numbers(p), equation.progress(p), equation.last(p)
    numbers.impulse, numbers.v_c = numbers.h * residual.size(p, equation.force(p)), V_C
    for b in range(equation.head(p).nbody):
        numbers.v_c = max(numbers.v_c, CREEP * speed_of(p, b, equation.start(p)))
    progress.knows_derivative = numbers.knows_derivative
    progress.is_stale = progress.is_fresh = progress.by_secant = 0.0
    progress.secants_left = progress.shortened = progress.failures = progress.iteration = 0.0
    progress.loosened = progress.share = 1.0
    missing = equation.residual_of(p, POINT.now)
    residual.fill(p, last, equation.foreseen(p), missing)
    which = linearised.EXACT if numbers.knows_derivative > 0.0 else linearised.NONE
    linearised.solution(p, last, missing, which, equation.velocity_of(p, POINT.now))
    attempt(p, POINT.now)
    now, new = equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    if now.error > 1.0 and now.missing > 0.3 * now.scale:  # a poor guess: is the last velocity nearer?
        linear_algebra.copy(last, equation.velocity_of(p, POINT.new))
        attempt(p, POINT.new)
        if new.missing < now.missing:
            copy_point(p, POINT.new, POINT.now)
            progress.is_stale = 1.0
    copy_point(p, POINT.now, POINT.best)


@exact
def _choose_direction(p):
    """Fill `search` with the step to the solution of the linearised equation, by the derivative that is its turn."""
    progress, v = equation.progress(p), equation.velocity_of(p, POINT.now)
    progress.by_secant = 1.0 if progress.secants_left > 0.0 else 0.0
    if progress.by_secant > 0.0:
        differentiate(p, v, 1.0)
        progress.secants_left -= 1.0
    elif progress.is_fresh == 0.0 and (progress.is_stale > 0.0 or progress.knows_derivative == 0.0):
        differentiate(p, v, 0.0)
        progress.knows_derivative, progress.is_fresh, progress.is_stale = 1.0, 1.0, 0.0
    which = linearised.COMPLETED if progress.by_secant > 0.0 else linearised.EXACT
    direction = equation.search(p)
    linearised.solution(p, v, equation.residual_of(p, POINT.now), which, direction)
    for k in range(v.size):
        direction[k] -= v[k]
    progress.share = 1.0


@exact
def _keep_best(p, k):
    """Take point k for the best where its error is smaller."""
    if equation.scores(p, k).error < equation.scores(p, POINT.best).error:
        copy_point(p, k, POINT.best)


@exact
def _is_refused(p):
    """Whether the new point is no step on; then the next trial is arranged."""
    progress, now, new = equation.progress(p), equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    if new.error <= progress.loosened:
        return False
    direction = equation.search(p)
    before = linear_algebra.dot(equation.residual_of(p, POINT.now), direction)
    after = linear_algebra.dot(equation.residual_of(p, POINT.new), direction)
    crossing = -before / (after - before) if after > 0.0 and before < 0.0 else 0.5
    if progress.by_secant > 0.0:
        too_far = after > 0.3 * abs(before) and new.missing > 0.7 * now.missing and progress.shortened < 3.0
        if too_far:
            _shorten(p, crossing)
        return too_far
    if new.missing < 0.9 * now.missing and after <= 0.2 * abs(before):
        return False
    _arrange_other(p, crossing)
    return True


@exact
def _shorten(p, crossing):
    """Try less of the direction next, near where the missing impulse along it vanishes."""
    progress = equation.progress(p)
    progress.share *= min(max(crossing, 0.1), 0.7)
    progress.shortened += 1.0


@exact
def _arrange_other(p, crossing):
    """After a step that led nowhere: a derivative of now, beside a body's rest, less of it, or the completed one."""
    progress, now = equation.progress(p), equation.scores(p, POINT.now)
    if progress.is_fresh == 0.0:
        progress.is_stale, progress.shortened = 1.0, 0.0
        return
    rest = _rest_along(p, equation.search(p), progress.share) if progress.shortened == 0.0 else 0.0
    if rest > 0.0:
        _try_along(p, equation.search(p), rest, POINT.new)
        copy_point(p, POINT.new, POINT.now)
        _keep_best(p, POINT.now)
        progress.is_stale, progress.is_fresh, progress.shortened = 1.0, 0.0, 0.0
    elif now.missing < 0.5 * now.scale and progress.shortened < 2.0:  # a face changes its side along the way
        _shorten(p, crossing)
    else:
        progress.failures += 1.0
        progress.secants_left, progress.shortened = min(2.0 * progress.failures, 8.0), 0.0


@exact
def _accept(p):
    """Go on from the new point."""
    progress, now, new = equation.progress(p), equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    progress.shortened = 0.0
    if progress.by_secant > 0.0:
        progress.is_stale = 1.0
    else:
        progress.is_stale = 1.0 if new.missing > 0.3 * now.missing else 0.0
        _update(p, POINT.now, POINT.new)
    progress.is_fresh = 0.0
    copy_point(p, POINT.new, POINT.now)


@exact
def _try_along(p, direction, t, k):
    """Evaluate the equation a share t of a direction from point POINT.now on, into point k."""
    v, new = equation.velocity_of(p, POINT.now), equation.velocity_of(p, k)
    for i in range(new.size):
        new[i] = v[i] + t * direction[i]
    attempt(p, k)


@exact
def _update(p, old, new):
    """Broyden's rank-one update of each body's derivative from two points."""
    moved, twist = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    v, u = equation.velocity_of(p, old), equation.velocity_of(p, new)
    for b in range(equation.head(p).nbody):
        twist_of(p, b, u, moved)
        twist_of(p, b, v, twist)
        length, square = equation.length(p)[b], 0.0
        for r in range(6):
            moved[r] -= twist[r]
            square += (1.0 if r < 3 else length * length) * moved[r] * moved[r]
        if square <= 0.0:
            continue
        g = equation.derivative(p, b)
        before, after = equation.wrench_of(p, old, b, 0), equation.wrench_of(p, new, b, 0)
        for r in range(6):
            y = after[r] - before[r]
            for k in range(6):
                y -= g[r, k] * moved[k]
            y /= square
            for k in range(6):
                g[r, k] += y * (1.0 if k < 3 else length * length) * moved[k]


@exact
def _share_to_rest(p, b, direction, share):
    """The part of a share of a direction from POINT.now on at which body b is nearest to rest, and its change squared.

    The former is negative where the body does not come near to rest on the way.
    """
    a, c = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    twist_of(p, b, equation.velocity_of(p, POINT.now), a)
    twist_of(p, b, direction, c)
    aa = ac = cc = 0.0
    for k in range(6):
        weight = 1.0 if k < 3 else equation.length(p)[b] ** 2
        c[k] *= share
        aa += weight * a[k] * a[k]
        ac += weight * a[k] * c[k]
        cc += weight * c[k] * c[k]
    v_c = equation.numbers(p).v_c
    if cc == 0.0 or ac >= 0.0 or -ac >= cc or aa < (10.0 * v_c) ** 2 or aa - ac * ac / cc > NEAR * aa:
        return -1.0, cc
    return -ac / cc, cc


@exact
def _rest_along(p, direction, share):
    """Share of a direction from point POINT.now on at which a body is beside its rest; 0 where none comes near.

    Before its rest where the sand must push the body on, behind it where the sand must hold it back.
    """
    v, there, q = equation.velocity_of(p, POINT.now), equation.there(p), equation.others(p)
    missing, found = equation.fixed(p), 0.0
    for b in range(equation.head(p).nbody):
        t, square = _share_to_rest(p, b, direction, share)
        if t < 0.0 or (found > 0.0 and t >= found):
            continue
        for k in range(v.size):
            there[k] = v[k] + t * share * direction[k]
        generalised(p, POINT.now, 0, q)
        wrench = equation.wrench_of(p, POINT.now, b, 0)
        linear_algebra.add_transposed(equation.jacobian(p, b), wrench, -1.0, q)
        residual.fill(p, there, q, missing)
        side = 1.0 if linear_algebra.dot(missing, direction) < 0.0 else -1.0
        found = max(t + side * BESIDE * equation.numbers(p).v_c / np.sqrt(square), 1e-12)
    return found * share
