"""Detours of a solution, where a step of Newton's method leads nowhere: past a body's rest, or past a face's edge."""

from typing import Final

import numpy as np

from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import constraint_rows, equation, linear_algebra, residual, secants
from rftsim.solver.equation import POINT
from rftsim.solver.motion import (
    add_wrench,
    differentiate,
    felt_twist,
    generalised,
    respond,
    size_of,
    speed_of,
    twist_of,
)
from rftsim.solver.parts import parts_needed
from rftsim.solver.residual import attempt
from rftsim.solver.steps import (
    BRAKE,
    DERIVATIVE,
    is_affordable,
    is_misled,
    keep_best,
    move_on,
    note_misfits,
    predict,
    try_along,
)

NEAR: Final = 0.25
"""Square of the share of a body's speed that is left where a step is said to pass its rest."""
BESIDE: Final = 0.3
"""Speed, over v_c, at which a body is tried beside its rest."""
CLOSE: Final = (0.5, 0.1)
"""Missing impulse, over all impulses, up to which less of a step is tried: of a body that is alone, and of several."""
STAGES: Final = 2
"""Stages, after the first, in which a body that is alone comes to its equation by way of smoother ones."""
SLIDES: Final = 4.0
"""Speed over v_c from which on a body slides on, whatever v_c is."""
TIGHTER: Final = 0.3
"""Share of the missing impulse up to which secants were followed, up to which they are next."""
LEAST: Final = 0.01
"""Least missing impulse, over all impulses, up to which secants are followed."""


@exact
def is_refused(p):
    """Whether the new point is no step on; then the next trial is arranged."""
    progress, now, new = equation.progress(p), equation.scores(p, POINT.now), equation.scores(p, POINT.new)
    if new.error <= progress.loosened:
        return False
    direction = equation.search(p)
    before = linear_algebra.dot(equation.residual_of(p, POINT.now), direction)
    after = linear_algebra.dot(equation.residual_of(p, POINT.new), direction)
    crossing = -before / (after - before) if after > 0.0 and before < 0.0 else 0.5
    if new.missing < 0.5 * now.missing or (new.missing < 0.9 * now.missing and after <= 0.2 * abs(before)):
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
    """After a step that led nowhere: derivatives of now, beside a body's rest, less of the step, or along secants."""
    progress, now = equation.progress(p), equation.scores(p, POINT.now)
    note_misfits(p)
    if is_misled(p):
        progress.is_stale, progress.shortened = 1.0, 0.0
        return
    is_alone = equation.head(p).nbody == 1
    is_close = now.missing < (CLOSE[0] if is_alone else CLOSE[1]) * now.scale
    is_asked = progress.shortened == 0.0 and progress.rested == 0.0 and is_affordable(p, 1.0 + BRAKE)
    rest = _rest_along(p, equation.search(p), progress.share) if is_asked else 0.0
    if rest > 0.0:
        progress.rested = 1.0
        try_along(p, equation.search(p), rest, POINT.new)
        keep_best(p, POINT.new)
        note_misfits(p)
        move_on(p)
    elif is_close and progress.shortened < 2.0 and not (is_alone and progress.eased == 0.0):
        _shorten(p, crossing)  # a face changes its side along the way
        return
    elif is_alone and progress.eased == 0.0:
        if equation.numbers(p).is_whole > 0.0 and parts_needed(p, equation.numbers(p).h) > 1.0:
            equation.numbers(p).budget = 0.0  # shorter equations are easier, and the step is to be split anyway
            return
        progress.eased = 1.0
        _ease(p)
        secants.follow(p, progress.enough)
    else:
        _follow_on(p)
    linear_algebra.clear(equation.is_fresh(p))
    progress.is_stale, progress.shortened = 1.0, 0.0


@exact
def _follow_on(p):
    """Follow secants to where less is missing than they have led to before."""
    progress, now = equation.progress(p), equation.scores(p, POINT.now)
    if now.missing <= progress.enough * now.scale:
        progress.enough = max(TIGHTER * progress.enough, LEAST)
    secants.follow(p, progress.enough)
    progress.enough = max(TIGHTER * progress.enough, LEAST)


@exact
def _ease(p):
    """Come to the equation by way of smoother ones, where a step of Newton's method leads nowhere.

    At first v_c is as large as the speeds, and falls stage by stage to what it is. A body that the sand holds creeps
    at a speed that goes with v_c, so it is foreseen to slow down as v_c falls; the completed derivative is exact for
    that, and does not overshoot for bodies that slide on.
    """
    numbers = equation.numbers(p)
    sharp, soft = numbers.v_c, _softest(p)
    fall = (soft / sharp) ** (1.0 / STAGES)
    for stage in range(STAGES + 1):
        if not is_affordable(p, 1.0 + DERIVATIVE + 1.0 + BRAKE):
            break
        numbers.v_c = soft if stage == 0 else numbers.v_c / fall
        _linearise_apart(p, 1.0 if stage == 0 else fall)
        predict(p)
    numbers.v_c = sharp
    linear_algebra.clear(equation.is_seen(p))
    linear_algebra.clear(equation.misfit(p))
    attempt(p, POINT.now)
    keep_best(p, POINT.now)


@exact
def _softest(p):
    """The largest speed of a body, or that to which it is driven within the step [m/s]."""
    numbers, v, driven = equation.numbers(p), equation.velocity_of(p, POINT.now), equation.driven(p)
    soft = numbers.v_c
    for b in range(equation.head(p).nbody):
        speed = max(speed_of(p, b, equation.start(p)), speed_of(p, b, v))
        soft = max(soft, max(speed, speed_of(p, b, driven)))
    return soft


@exact
def _linearise_apart(p, fall):
    """Take each body's force and its derivative at the present point, slowed down by `fall` where the sand holds it."""
    numbers, v, out = equation.numbers(p), equation.velocity_of(p, POINT.now), equation.answer_of(p, POINT.spare, 0)
    for b in range(equation.head(p).nbody):
        kept = equation.kept(p, b)
        felt_twist(p, b, v, kept.twist)
        speed = size_of(kept.twist, equation.length(p)[b]) / (SLIDES * fall * numbers.v_c)
        slowed = min(max(speed * speed, 1.0 / fall), 1.0)
        for r in range(6):
            kept.twist[r] *= slowed
        respond(p, b, kept.twist, out)
        for r in range(6):
            kept.wrench[r] = out[r]
        differentiate(p, b, kept.twist, 1.0)
        linear_algebra.copy_matrix(equation.secant(p, b), equation.derivative(p, b))
        kept.known, kept.trend = 1.0, 0.0
    equation.work(p).evaluations += 1.0


@exact
def _share_to_rest(p, b, direction, share):
    """The part of a share of a direction from POINT.now on at which body b is nearest to rest, and its change squared.

    The former is negative where the body does not come near to rest on the way.
    """
    a, c = doubles(stack_doubles(6), 6), doubles(stack_doubles(6), 6)
    felt_twist(p, b, equation.velocity_of(p, POINT.now), a)
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
        constraint_rows.errors_at(p, there, equation.row_tried(p))
        residual.fill(p, there, equation.row_tried(p), q, missing)
        side = 1.0 if linear_algebra.dot(missing, direction) < 0.0 else -1.0
        found = max(t + side * BESIDE * equation.numbers(p).v_c / np.sqrt(square), 1e-12)
    return found * share
