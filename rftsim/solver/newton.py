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
from rftsim.solver.motion import add_wrench, differentiate, generalised, respond, size_of, speed_of, twist_of
from rftsim.solver.residual import allowed, attempt, copy_point

V_C: Final = 3e-7
"""Least speed v_c [m/s] below which a triangle's stress falls to zero; where all is at rest, bodies creep slower."""
CREEP: Final = 1e-4
"""v_c over the speed of the fastest body. A body at rest amid moving ones, loaded to near what the sand bears, is the
hardest of all to solve for, and is so less often."""
KEPT_LEAVES: Final = 0.3
FRESH_LEAVES: Final = 0.1
LEAST_LEFT: Final = 0.02
"""Share of the missing impulse that a step is thought to leave: of a kept derivative, of one that was just taken, and
at least, where the last step showed it."""
FORCE: Final = 2.0
"""Missing impulse that is allowed, over all impulses and the tolerance."""
PATIENCE: Final = 6.0
"""Iterations after which the tolerance is loosened."""
LOOSEST: Final = 20.0
"""Factor to which that is."""
BUDGET: Final = 60.0
"""Evaluations' worth of one step of all bodies."""
DERIVATIVE: Final = 2.0
"""Evaluations that a derivative is worth."""
RESERVE: Final = 4.0
"""Evaluations' worth that is left unspent by one solution, for what follows it."""
NEAR: Final = 0.25
"""Square of the share of a body's speed that is left where a step is said to pass its rest."""
BESIDE: Final = 0.3
"""Speed, over v_c, at which a body is tried beside its rest."""
EASED: Final = 2.0
"""The failure after which a solution of several bodies is eased; a single one is at the first."""
STAGES: Final = 4
"""Stages of that, after the first."""
SLIDES: Final = 4.0
"""Speed over v_c from which on a body slides on, whatever v_c is."""
HELD: Final = 30.0
"""Speed over v_c below which a body is held by the sand, or nearly."""
HELD_FORCE: Final = 0.1
"""Missing impulse that is allowed where one is, over all impulses and the tolerance."""
POOR: Final = 0.2
"""Share of the largest misfit from which on a body's derivative is taken anew."""


@entry(types.void, address)
def solve(p):
    """Solve the equation: fill `end` and its numbers, leave the velocity and its wrenches in point POINT.best."""
    _begin(p)
    progress, best = equation.progress(p), equation.scores(p, POINT.best)
    accepted = False
    while not accepted:
        if progress.shortened == 0.0:
            _choose_direction(p)
            accepted = _is_short(p)
        if accepted or _is_given_up(p):
            break
        progress.iteration += 1.0
        if progress.iteration > PATIENCE:
            progress.loosened = min(1.5 * progress.loosened, LOOSEST)
        _try_along(p, equation.search(p), progress.share, POINT.new)
        _keep_best(p, POINT.new)
        if not _is_refused(p):
            _accept(p)
    if accepted:
        copy_point(p, POINT.now, POINT.best)
    near = best.error <= LOOSEST or best.missing <= 1e-2 * best.scale
    equation.numbers(p).solved = 1.0 if accepted or near else 0.0
    centre(p, accepted)


@exact
def worth(p):
    """The evaluations' worth of what was spent on the step so far."""
    spent = equation.work(p)
    return spent.evaluations + DERIVATIVE * spent.derivatives


@exact
def _is_given_up(p):
    """Whether the solution ends at its best point: too many iterations, or a face on its edge: nothing is nearer."""
    progress, best = equation.progress(p), equation.scores(p, POINT.best)
    if progress.iteration >= equation.numbers(p).iterations or worth(p) > BUDGET - RESERVE - DERIVATIVE:
        return True
    return progress.iteration > PATIENCE and (best.error <= progress.loosened or best.missing < 5e-3 * best.scale)


@exact
def _begin(p):
    """Set the equation's scales, and evaluate it where the kept derivatives lead, or at the last velocity."""
    numbers, progress = equation.numbers(p), equation.progress(p)
    numbers.scale, numbers.v_c = numbers.h * residual.size(p, equation.force(p)), V_C
    progress.is_stale, known = 0.0, True
    for b in range(equation.head(p).nbody):
        numbers.v_c = max(numbers.v_c, CREEP * speed_of(p, b, equation.start(p)))
        equation.is_fresh(p)[b], equation.misfit(p)[b] = 0.0, 0.0
        known = known and equation.kept(p, b).known > 0.0
    progress.by_secant = progress.secants_left = progress.shortened = progress.failures = progress.iteration = 0.0
    progress.loosened = progress.share = 1.0
    progress.contraction = KEPT_LEAVES
    _predict(p)
    attempt(p, POINT.now)
    now, new = equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    if not known:
        progress.is_stale = 1.0
    elif now.error > 1.0 and now.missing > 0.3 * now.scale:  # a poor guess: is the start nearer?
        linear_algebra.copy(equation.start(p), equation.velocity_of(p, POINT.new))
        attempt(p, POINT.new)
        progress.is_stale = 1.0
        if new.missing < now.missing:
            copy_point(p, POINT.new, POINT.now)
    copy_point(p, POINT.now, POINT.best)


@exact
def _predict(p):
    """Fill the velocity of POINT.now with the solution for the kept forces, linear in each body's twist."""
    start, q, missing = equation.start(p), equation.sand_force(p), equation.residual_of(p, POINT.now)
    twist, wrench = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    linear_algebra.clear(q)
    for b in range(equation.head(p).nbody):
        kept = equation.kept(p, b)
        if kept.known == 0.0:
            continue
        twist_of(p, b, start, twist)
        for r in range(6):
            twist[r] -= kept.twist[r]
        linear_algebra.multiply(equation.derivative(p, b), twist, wrench)
        for r in range(6):
            wrench[r] += kept.wrench[r]
        add_wrench(p, b, wrench, 1.0, q)
    residual.fill(p, start, q, missing)
    linearised.solution(p, start, missing, linearised.EXACT, equation.velocity_of(p, POINT.now))


@exact
def _choose_direction(p):
    """Fill `search` with the step to the solution of the linearised equation, by the derivative that is its turn."""
    progress, v = equation.progress(p), equation.velocity_of(p, POINT.now)
    progress.by_secant = 1.0 if progress.secants_left > 0.0 else 0.0
    if progress.by_secant > 0.0:
        twist = doubles(stack_doubles(6), 6)
        for b in range(equation.head(p).nbody):
            twist_of(p, b, v, twist)
            differentiate(p, b, twist, 1.0)
        progress.secants_left -= 1.0
    elif progress.is_stale > 0.0:
        _refresh(p)
    which = linearised.COMPLETED if progress.by_secant > 0.0 else linearised.EXACT
    direction = equation.search(p)
    linearised.solution(p, v, equation.residual_of(p, POINT.now), which, direction)
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
        if fresh[b] == 0.0 and (misfit[b] >= POOR * largest):
            twist_of(p, b, equation.velocity_of(p, POINT.now), twist)
            differentiate(p, b, twist, 0.0)
            fresh[b], misfit[b], equation.kept(p, b).known = 1.0, 0.0, 1.0
    progress = equation.progress(p)
    progress.is_stale, progress.contraction = 0.0, FRESH_LEAVES if progress.failures == 0.0 else 1.0


@exact
def _is_short(p):
    """Whether the direction at hand is so short that it leads to the solution, as near as is asked for."""
    numbers, progress, now = equation.numbers(p), equation.progress(p), equation.scores(p, POINT.now)
    if progress.by_secant > 0.0:
        return False
    if now.error <= 1.0:
        return True
    left, there, force = progress.contraction, equation.there(p), FORCE
    for k in range(there.size):
        there[k] = equation.velocity_of(p, POINT.now)[k] + equation.search(p)[k]
    for b in range(equation.head(p).nbody):
        if not left * speed_of(p, b, equation.search(p)) <= allowed(p, b, there):
            return False
        if speed_of(p, b, there) < HELD * numbers.v_c:
            force = HELD_FORCE
    return left * now.missing <= force * numbers.tolerance * now.scale


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
def _all_fresh(p):
    """Whether all derivatives are those at the present point."""
    fresh, found = equation.is_fresh(p), True
    for b in range(fresh.size):
        found = found and fresh[b] > 0.0
    return found


@exact
def _arrange_other(p, crossing):
    """After a step that led nowhere: a derivative of now, beside a body's rest, less of it, or the completed one."""
    progress, now = equation.progress(p), equation.scores(p, POINT.now)
    if not _all_fresh(p):
        progress.is_stale, progress.shortened = 1.0, 0.0
        return
    if equation.head(p).nbody == 1 and progress.failures == 0.0:
        progress.failures = 1.0
        _ease(p)
        return
    rest = _rest_along(p, equation.search(p), progress.share) if progress.shortened == 0.0 else 0.0
    if rest > 0.0:
        _try_along(p, equation.search(p), rest, POINT.new)
        _keep_best(p, POINT.new)
        _move(p)
        progress.is_stale, progress.shortened = 1.0, 0.0
    elif now.missing < 0.5 * now.scale and progress.shortened < 2.0:  # a face changes its side along the way
        _shorten(p, crossing)
    else:
        progress.failures += 1.0
        progress.shortened = 0.0
        if progress.failures == EASED:
            _ease(p)
        else:
            progress.secants_left = min(2.0 * progress.failures, 8.0)


@exact
def _ease(p):
    """Come to the equation by way of smoother ones, where a step of Newton's method leads nowhere.

    At first v_c is as large as the speeds, and falls stage by stage to what it is. A body that the sand holds creeps
    at a speed that goes with v_c, so it is foreseen to slow down as v_c falls; the completed derivative is exact for
    that, and does not overshoot for bodies that slide on.
    """
    numbers, progress = equation.numbers(p), equation.progress(p)
    sharp, soft, stages = numbers.v_c, _softest(p), STAGES
    fall = (soft / sharp) ** (1.0 / stages)
    for stage in range(stages + 1):
        if worth(p) > BUDGET - RESERVE - 2.0 * DERIVATIVE:
            break
        numbers.v_c = soft if stage == 0 else numbers.v_c / fall
        _linearise_apart(p, 1.0 if stage == 0 else fall)
        _predict(p)
    numbers.v_c = sharp
    attempt(p, POINT.now)
    _keep_best(p, POINT.now)
    linear_algebra.clear(equation.is_fresh(p))
    linear_algebra.clear(equation.misfit(p))
    progress.is_stale = 1.0


@exact
def _softest(p):
    """The largest speed of a body, or that to which it is driven within the step [m/s]."""
    numbers, v, driven = equation.numbers(p), equation.velocity_of(p, POINT.now), equation.solved(p)
    residual.size(p, equation.force(p))
    soft = numbers.v_c
    for b in range(equation.head(p).nbody):
        speed = max(speed_of(p, b, equation.start(p)), speed_of(p, b, v))
        soft = max(soft, max(speed, numbers.h * speed_of(p, b, driven)))
    return soft


@exact
def _linearise_apart(p, fall):
    """Take each body's force and its derivative at the present point, slowed down by `fall` where the sand holds it."""
    numbers, v, out = equation.numbers(p), equation.velocity_of(p, POINT.now), equation.wrench_of(p, POINT.spare, 0, 0)
    for b in range(equation.head(p).nbody):
        kept = equation.kept(p, b)
        twist_of(p, b, v, kept.twist)
        speed = size_of(kept.twist, equation.length(p)[b]) / (SLIDES * fall * numbers.v_c)
        slowed = min(max(speed * speed, 1.0 / fall), 1.0)
        for r in range(6):
            kept.twist[r] *= slowed
        respond(p, b, kept.twist, out)
        for r in range(6):
            kept.wrench[r] = out[r]
        differentiate(p, b, kept.twist, 1.0)
        linear_algebra.copy_matrix(equation.completed(p, b), equation.derivative(p, b))
        kept.known = 1.0
    equation.work(p).evaluations += 1.0


@exact
def _accept(p):
    """Go on from the new point."""
    progress, now, new = equation.progress(p), equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    progress.shortened = 0.0
    if progress.by_secant > 0.0:
        progress.is_stale = 1.0
    else:
        left = new.missing / now.missing
        progress.is_stale = 1.0 if left > 0.3 else 0.0
        progress.contraction = min(max(left, LEAST_LEFT), 1.0)
        _update(p, POINT.now, POINT.new)
    _move(p)


@exact
def _move(p):
    """Make the new point the present one."""
    copy_point(p, POINT.new, POINT.now)
    linear_algebra.clear(equation.is_fresh(p))


@exact
def _try_along(p, direction, t, k):
    """Evaluate the equation a share t of a direction from point POINT.now on, into point k."""
    v, new = equation.velocity_of(p, POINT.now), equation.velocity_of(p, k)
    for i in range(new.size):
        new[i] = v[i] + t * direction[i]
    attempt(p, k)


@exact
def _update(p, old, new):
    """Broyden's rank-one update of each body's derivative from two points; what they did not foresee."""
    moved, twist, missed = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        twist_of(p, b, equation.velocity_of(p, new), moved)
        twist_of(p, b, equation.velocity_of(p, old), twist)
        length, square = equation.length(p)[b], 0.0
        for r in range(6):
            moved[r] -= twist[r]
            moved[r] *= 1.0 if r < 3 else length
            square += moved[r] * moved[r]
        if square <= 0.0:
            continue
        g = equation.derivative(p, b)
        before, after = equation.wrench_of(p, old, b, 0), equation.wrench_of(p, new, b, 0)
        for r in range(6):
            missed[r] = after[r] - before[r]
            for k in range(6):
                missed[r] -= g[r, k] * moved[k] / (1.0 if k < 3 else length)
            for k in range(6):
                g[r, k] += missed[r] / square * (1.0 if k < 3 else length) * moved[k]
        equation.misfit(p)[b] = size_of(missed, 1.0 / length)


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
        add_wrench(p, b, wrench, -1.0, q)
        residual.fill(p, there, q, missing)
        side = 1.0 if linear_algebra.dot(missing, direction) < 0.0 else -1.0
        found = max(t + side * BESIDE * equation.numbers(p).v_c / np.sqrt(square), 1e-12)
    return found * share
