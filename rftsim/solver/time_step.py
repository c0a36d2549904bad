"""One time step of the sand: predict, solve, and split the step where it is too long for the depth.

What must last from step to step is a state, see `state`; the step's equation is a table, see `equation`.
"""

from typing import Final

import numpy as np
from numba import types

from rftsim.machine.compiling import exact
from rftsim.machine.exports import address, entry
from rftsim.solver import equation, linear_algebra, state
from rftsim.solver.equation import POINT
from rftsim.solver.motion import generalised, speed_of
from rftsim.solver.newton import V_C, solve
from rftsim.solver.sinking import deepest, is_near
from rftsim.solver.split_step import finish, split_step
from rftsim.solver.step_equation import answer_to, force_to, prepare, reset

FINENESS: Final = 5e-3
"""Error of the position in a step, over the depth, above which the step is split."""
SHALLOWEST: Final = 1e-4
"""Depth [m] below which none is resolved."""
MOST_PARTS: Final = (256, 1)
"""Parts of a step; where those did work, it is taken whole."""
GAIN: Final = 1e-7
"""Work that the sand may do in a step over the kinetic energy: rounding, not physics, and more is taken back."""


@entry(types.intc, address)
def is_needed(p):
    """Whether the sand can act in the step; where not, the new state is filled."""
    head = equation.head(p)
    if state.flags_at(head.old).split > 0.0 or is_near(p):
        return 1
    state.begin(equation.state(p, head.new))
    return 0


@entry(types.void, address)
def step(p):
    """The sand's generalised force of one step: fills `out`, `wrench` and the new state, and counts."""
    head, v, momentum = equation.head(p), equation.velocity(p), equation.momentum(p)
    before, new = equation.state(p, head.before), equation.state(p, head.new)
    linear_algebra.copy(state.numbers(equation.state(p, head.old)), state.numbers(before))
    linear_algebra.copy(equation.frames(p), equation.first_frames(p))
    linear_algebra.multiply(equation.plain_mass(p), v, momentum)
    allowed = GAIN * linear_algebra.dot(v, momentum) + 1e-12
    work, slack = 0.0, 0.0
    for most_parts in MOST_PARTS:
        state.begin(new)
        _one_step(p, most_parts)
        work, slack = _work(p, state.after(new)), _slack(p, allowed)
        if work <= slack or (state.flags_at(head.before).split == 0.0 and state.flags_at(head.new).split == 0.0):
            break
        # a split step whose mean force does work: take it whole, from MuJoCo's own velocity
        state.begin(before)
        linear_algebra.copy(equation.first_frames(p), equation.frames(p))
    if work > slack:
        _take_back(p, slack, work)


@exact
def _work(p, after):
    """Work of the sand on MuJoCo's step that ends in a velocity [J]."""
    q, v, h, work = equation.out(p), equation.velocity(p), equation.numbers(p).timestep, 0.0
    for k in range(q.size):
        work += 0.5 * h * q[k] * (v[k] + after[k])
    return work


@exact
def _slack(p, allowed):
    """Work that the sand may do in a step [J]: what is allowed, and that of creep."""
    q, h = equation.out(p), equation.numbers(p).timestep
    for k in range(q.size):
        allowed += 3.0 * h * V_C * abs(q[k])
    return allowed


@exact
def _take_back(p, slack, work):
    """Shrink a force that did work until it does none, and the wrenches with it."""
    h, q, answer = equation.numbers(p).timestep, equation.out(p), equation.end(p)
    wrench, changed = equation.all_wrenches(p), equation.momentum(p)
    # the force's own share of the work, and the rest's: where there are no constraints, they cancel at once
    linear_algebra.substitute(equation.mass_factors(p), equation.mass_order(p), q, changed)
    own = 0.5 * h * linear_algebra.dot(q, changed)
    rest = work / h - own
    share = 0.0 if rest >= 0.0 else min(1.0, -rest / own)
    for trial in range(6):
        for k in range(q.size):
            q[k] *= share
        for k in range(wrench.size):
            wrench[k] *= share
        answer_to(p, q, answer)
        if _work(p, answer) <= slack:
            break
        share = 0.5 if trial < 4 else 0.0
    linear_algebra.copy(answer, state.after(equation.state(p, equation.head(p).new)))


@exact
def _parts(p, first_step, solved):
    """Into how many parts a step must be split; its solution is in point POINT.best."""
    h = equation.numbers(p).timestep
    after, start = equation.velocity_of(p, POINT.best), equation.start(p)
    grown, late, stopped = equation.grown(p), equation.late(p), equation.stopped(p)
    generalised(p, POINT.best, 1, grown)
    generalised(p, POINT.best, 0, late)
    for k in range(after.size):
        grown[k] = h * (grown[k] - late[k])
        stopped[k] = after[k] - start[k]
    linear_algebra.substitute(equation.mass_factors(p), equation.mass_order(p), grown, late)
    worst = 0.0
    for b in range(equation.head(p).nbody):
        travel = h * speed_of(p, b, start)
        error = h * max(speed_of(p, b, late), speed_of(p, b, stopped)) / 8.0
        error = min(error, travel)
        if error <= FINENESS * SHALLOWEST:
            continue
        depth = deepest(p, b, after, h)
        if depth <= 0.0:
            continue
        allowed = FINENESS * max(depth, SHALLOWEST)
        worst = max(worst, error / allowed)
        if first_step and travel > allowed:
            worst = max(worst, 3.9)
    parts = 1 if worst <= 1.0 else min(int(np.ceil(np.sqrt(worst))), MOST_PARTS[0])
    return parts if solved else max(parts, 4)


@exact
def _predict(p):
    """Set the equation to the whole step, with what the state before foresees of it; the drift before it [s]."""
    numbers, before = equation.numbers(p), equation.state(p, equation.head(p).before)
    flags, last = state.flags_at(before.address), equation.last(p)
    reset(p)
    linear_algebra.copy(equation.velocity(p), last)
    if flags.split > 0.0:
        start, lacking = equation.start(p), state.lacking(before)
        for k in range(start.size):
            start[k] += lacking[k]
    if flags.knows_force > 0.0:
        linear_algebra.copy(state.last(before), last)
    linear_algebra.copy(state.foreseen(before), equation.foreseen(p))
    linear_algebra.copy(state.derivatives(before), equation.derivatives(p))
    numbers.knows_derivative = flags.knows_derivative
    return flags.drift if flags.split > 0.0 else numbers.timestep


@exact
def _one_step(p, most_parts):
    """A step from the state before, whole or in parts."""
    numbers, head = equation.numbers(p), equation.head(p)
    h, drift = numbers.timestep, _predict(p)
    prepare(p, 0.5 * (drift + h))
    solve(p)
    solved = numbers.solved > 0.0
    parts = min(_parts(p, state.flags_at(head.before).started == 0.0, solved), most_parts)
    if parts > 1:
        split_step(p, parts)
        return
    if not solved:
        equation.work(p).unsolved += 1.0
    end, later = equation.end(p), equation.later_force(p)
    generalised(p, POINT.best, 1, later)
    finish(p, later, end, end, 0.0)
    for b in range(head.nbody):
        linear_algebra.copy(equation.wrench_of(p, POINT.best, b, 0), equation.wrench(p, b))
    if drift != h:
        prepare(p, h)
    force_to(p, end, equation.out(p))
