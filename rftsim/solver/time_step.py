"""One time step of the sand: predict, solve, and split the step where it is too long for the depth.

What must last from step to step is a state, see `state`; the step's equation is a table, see `equation`.
"""

from typing import Final

import numpy as np
from numba import types

from rftsim.machine.compiling import exact
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation, linear_algebra, matrices
from rftsim.solver.equation import POINT
from rftsim.solver.motion import size_of, twist_of
from rftsim.solver.newton import STRAIN, solve
from rftsim.solver.parts import parts_needed
from rftsim.solver.split_step import affordable, finish, remember, split_step
from rftsim.solver.state import KEPT_NUMBERS
from rftsim.solver.step_equation import answer_to, force_to, prepare, reset
from rftsim.solver.steps import BUDGET, worth

MOST_PARTS: Final = (24.0, 1.0)
"""Parts of a step; where those did work, it is taken whole."""
UNSOLVED_PARTS: Final = 4.0
"""Parts at least of a step that was not solved as a whole."""
PART_COSTS: Final = 0.5
"""Share of what the solution of a whole step took that one of a part is thought to take."""
LATE: Final = 0.5
"""Share of the evaluations' worth of a step from which on what is found is kept: there are too few for another way."""
HUGE: Final = 1e9
"""Size from which on a force [N] or a velocity [m/s] is not taken for one."""
GAIN: Final = 1e-7
"""Work that the sand may do in a step, over v'Mv, twice the kinetic energy: more than rounding is taken back."""


@entry(types.void, address)
def step(p):
    """The sand's generalised force of one step: fills `out`, `wrench`, and what is kept for the next one; counts."""
    numbers, v, momentum = equation.numbers(p), equation.velocity(p), equation.momentum(p)
    linear_algebra.copy(equation.frames(p), equation.first_frames(p))
    matrices.multiply(p, equation.plain_mass(p), v, momentum)
    allowed = GAIN * linear_algebra.dot(v, momentum) + 1e-12
    work, slack = 0.0, 0.0
    for most_parts in MOST_PARTS:
        was_split = numbers.drift > 0.0
        _one_step(p, most_parts)
        work, slack = _work(p, equation.after(p)), _slack(p, allowed)
        if work <= slack or not (was_split or numbers.drift > 0.0) or _is_late(p):
            break
        # a split step whose mean force does work: take it whole, from MuJoCo's own velocity
        _forget(p)
    if work > slack and _is_finite(p):
        _take_back(p, allowed, work)
    if not _is_finite(p):
        _let_go(p)
    _keep_numbers(p)


@exact
def _is_late(p):
    """Whether too few evaluations are left for another way."""
    return worth(p) > LATE * BUDGET


@exact
def _is_finite(p):
    """Whether the force, and the velocity that it leads to, are numbers of a size that a step can have."""
    q, after, lacking, found = equation.out(p), equation.after(p), equation.lacking(p), True
    for k in range(q.size):
        found = found and abs(q[k]) < HUGE and abs(after[k]) < HUGE and abs(lacking[k]) < HUGE
    return found


@exact
def _keep_numbers(p):
    """Clear what is kept of a body where it is no number: nothing is known of it then."""
    for b in range(equation.head(p).nbody):
        record = doubles(equation.kept_address(p, b), KEPT_NUMBERS)
        for k in range(record.size):
            if not abs(record[k]) < np.inf:
                linear_algebra.clear(record)
                break


@exact
def _let_go(p):
    """Give the step no force of the sand, where its solution came to no number."""
    _forget(p)
    linear_algebra.clear(equation.out(p))
    linear_algebra.clear(equation.after(p))
    linear_algebra.clear(equation.all_wrenches(p))
    equation.work(p).unsolved += 1.0


@exact
def _forget(p):
    """Forget the past, and begin the step anew."""
    equation.numbers(p).started = 1.0
    _forget_parts(p)
    for b in range(equation.head(p).nbody):
        equation.kept(p, b).known = 0.0
    linear_algebra.copy(equation.first_frames(p), equation.frames(p))


@exact
def _forget_parts(p):
    """Forget that a step was split: MuJoCo's velocity is the true one."""
    equation.numbers(p).drift = 0.0
    linear_algebra.clear(equation.lacking(p))
    for b in range(equation.head(p).nbody):
        equation.kept(p, b).drift = equation.kept(p, b).parts = 0.0


@exact
def _work(p, after):
    """Work of the sand on MuJoCo's step that ends in a velocity [J]."""
    q, v, h, work = equation.out(p), equation.velocity(p), equation.numbers(p).timestep, 0.0
    for k in range(q.size):
        work += 0.5 * h * q[k] * (v[k] + after[k])
    return work


@exact
def _slack(p, allowed):
    """Work that the sand may do in a step [J]: what is allowed, and what the strain of bodies at rest gives back."""
    numbers, twist = equation.numbers(p), doubles(stack_doubles(6), 6)
    if numbers.solved == 0.0:
        return allowed
    for b in range(equation.head(p).nbody):
        twist_of(p, b, equation.velocity(p), twist)
        if size_of(twist, equation.length(p)[b]) <= STRAIN * numbers.v_c:
            wrench = equation.wrench(p, b)
            given = abs(linear_algebra.dot(wrench, equation.strain(p, b))) + abs(linear_algebra.dot(wrench, twist))
            allowed += numbers.timestep * given
    return allowed


@exact
def _take_back(p, allowed, work):
    """Shrink a force that did work until it does no more than is allowed, and the wrenches with it."""
    h, q, answer = equation.numbers(p).timestep, equation.out(p), equation.end(p)
    wrench, changed = equation.all_wrenches(p), equation.momentum(p)
    # the force's own share of the work, and the rest's: where there are no constraints, they cancel at once
    matrices.substitute(p, equation.mass_factors(p), q, changed)
    own = 0.5 * h * linear_algebra.dot(q, changed)
    rest = work / h - own
    share = 0.0 if rest >= 0.0 else min(1.0, -rest / own)
    for trial in range(6):
        for k in range(q.size):
            q[k] *= share
        for k in range(wrench.size):
            wrench[k] *= share
        answer_to(p, q, answer)
        if _work(p, answer) <= _slack(p, allowed):
            break
        share = 0.5 if trial < 4 else 0.0
    linear_algebra.copy(answer, equation.after(p))
    _forget_parts(p)


@exact
def _parts(p, cost):
    """Into how many parts to split a step that was solved as a whole, if one costs so many evaluations' worth.

    Where the evaluations that are left would not solve them, it stays whole.
    """
    numbers = equation.numbers(p)
    needed = parts_needed(p, numbers.timestep)
    if numbers.solved == 0.0:
        needed = max(needed, UNSOLVED_PARTS)
    return needed if affordable(p, cost) >= 2.0 else 1.0


@exact
def _one_step(p, most_parts):
    """A step from the state before: in parts where the last one asks for that, or its own solution does; else whole."""
    numbers, start, lacking = equation.numbers(p), equation.start(p), equation.lacking(p)
    h, drift = numbers.timestep, numbers.drift if numbers.drift > 0.0 else numbers.timestep
    before = worth(p)
    reset(p)
    for k in range(start.size):
        start[k] += lacking[k]
    if numbers.parts <= 1.0 or most_parts == 1:
        prepare(p, 0.5 * (drift + h))
        numbers.budget, numbers.is_whole = BUDGET, 1.0 if most_parts > 1 else 0.0
        solve(p)
        numbers.parts = _parts(p, PART_COSTS * (worth(p) - before))
    if numbers.parts > 1.0 and most_parts > 1:
        split_step(p, min(numbers.parts, most_parts))
        return
    if numbers.solved == 0.0:
        equation.work(p).unsolved += 1.0
    end, after = equation.end(p), equation.after(p)
    linear_algebra.copy(end, after)
    remember(p)
    numbers.drift = numbers.parts = 0.0
    finish(p, end)
    for b in range(equation.head(p).nbody):
        linear_algebra.copy(equation.wrench_of(p, POINT.best, b, 0), equation.wrench(p, b))
    if drift != h:
        prepare(p, h)
    force_to(p, end, equation.out(p))
