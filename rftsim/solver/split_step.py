"""A step in parts: kicks of half the neighbouring parts, and drifts that only the depths follow.

A body that crosses its own depth within a step needs the depths in between. Such a step is sub-cycled with mass,
Jacobians and normals frozen and only the depths moving; MuJoCo is then handed the force whose step ends where the
sub-cycled path ends. MuJoCo's velocity is the mean one of that path; what it lacks to the true one is carried to the
next step.
"""

from typing import Final

import numpy as np

from rftsim.law.exports import AHEAD
from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra, matrices
from rftsim.solver.equation import KIND, POINT
from rftsim.solver.motion import felt_twist, generalised, speed_of
from rftsim.solver.newton import hold, solve
from rftsim.solver.sinking import sink
from rftsim.solver.step_equation import answer_to, force_to, prepare, reset
from rftsim.solver.steps import BUDGET, RESERVE, worth

FINENESS: Final = 7.5
"""Error of the position in a step, over the depth and the tolerance, above which the step is split."""
SHALLOWEST: Final = 1e-4
"""Depth [m] below which none is resolved."""
FIRST: Final = 3.9
"""What counts for that error in a first step in which a body moves by more than is allowed: two parts."""
LEAST_COST: Final = 3.0
"""Evaluations' worth of a part, at least."""
MORE: Final = 2.0
"""Factor to which a step is split finer than was foreseen, where a part of it asks for that."""


@exact
def affordable(p, cost):
    """How many parts can be solved with what is left, if one costs so many evaluations' worth."""
    return (BUDGET - RESERVE - worth(p)) / max(LEAST_COST, cost)


@exact
def parts_needed(p, time):
    """Into how many parts a step must be split, by the solution of a time of it in point POINT.best."""
    h = equation.numbers(p).timestep
    after, start = equation.velocity_of(p, POINT.best), equation.start(p)
    grown, late, stopped = equation.grown(p), equation.late(p), equation.stopped(p)
    pressed = equation.pressed(p)
    generalised(p, POINT.best, 1, grown)
    matrices.substitute(p, equation.mass_factors(p), grown, pressed)
    generalised(p, POINT.best, 0, late)
    for k in range(after.size):
        grown[k] = time * (grown[k] - late[k])
        stopped[k] = after[k] - start[k]
    matrices.substitute(p, equation.mass_factors(p), grown, late)
    worst = _position_error(p, time)
    return np.ceil(np.sqrt(worst) * h / time) if worst > (time / h) ** 2 else 1.0


@exact
def _position_error(p, time):
    """The bodies' error of position over what is allowed, after `parts_needed` filled what it follows from.

    It is the mean square by the bodies' shares of the sand's force: what a grazing body errs by changes the motion
    little, for a force goes with the depth, and its share of all forces with it.
    """
    start, late = equation.start(p), equation.late(p)
    stopped, pressed, began = equation.stopped(p), equation.pressed(p), equation.numbers(p).started > 0.0
    nbody, fineness = equation.head(p).nbody, FINENESS * equation.numbers(p).tolerance
    square, first, total = 0.0, 0.0, TINY
    for b in range(nbody):
        total += _later_force(p, b)
    for b in range(nbody):
        travel, share = time * speed_of(p, b, start), _later_force(p, b) / total
        by_sand = min(speed_of(p, b, stopped), time * speed_of(p, b, pressed))
        error = min(time * max(speed_of(p, b, late), by_sand) / 8.0, travel) / fineness
        if error <= SHALLOWEST:
            continue
        depth = equation.answer_of(p, POINT.best, b)[AHEAD - 1]
        if depth <= 0.0:
            continue
        square += share * (error / max(depth, SHALLOWEST)) ** 2
        if not began and travel > fineness * max(depth, SHALLOWEST):
            first = FIRST
    return max(np.sqrt(square), first)


@exact
def _later_force(p, b):
    """Size of the sand's force on a body at the later depths [N]."""
    f = equation.wrench_of(p, POINT.best, b, 1)
    return np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])


@exact
def split_step(p, parts):
    """Take the step in parts, and shorter ones where the equation of one is not solved, as far as evaluations last."""
    h, end = equation.numbers(p).timestep, equation.end(p)
    drift = _begin(p)
    part, done, needed = h / parts, 0.0, 1.0
    while done < h * (1.0 - 1e-9):
        part = min(max(part, (h - done) / max(affordable(p, LEAST_COST), 1.0)), h - done)
        if h - done - part < 0.3 * part:
            part = h - done
        _solve_part(p, drift, part)
        if equation.numbers(p).solved == 0.0:
            if part > h / (8.0 * parts) and worth(p) < 0.5 * BUDGET:
                part *= 0.25
                continue
            equation.work(p).unsolved += 1.0
        needed = parts_needed(p, part)
        _add_contacts(p, part / h, equation.touched(p))
        sink(p, end, part)
        _add_part(p, part)
        drift, done = part, done + part
        part = min(2.0 * part, h / min(max(parts, needed), MORE * parts))
    equation.numbers(p).drift, equation.numbers(p).parts = drift, needed
    _end(p)


@exact
def _begin(p):
    """Set all means to zero; the drift before the first part [s]."""
    mean, moved, touched = equation.mean_velocity(p), equation.moved(p), equation.touched(p)
    for k in range(mean.size):
        mean[k] = moved[k] = touched[k] = 0.0
    linear_algebra.clear(equation.all_wrenches(p))
    # a velocity that was set by hand belongs to the start of the step, and MuJoCo's own to half a drift before it
    numbers = equation.numbers(p)
    if numbers.drift > 0.0:
        return numbers.drift
    return numbers.timestep if numbers.started > 0.0 else 0.0


@exact
def _solve_part(p, drift, part):
    """Solve the equation of a part, after a drift, with rows and drag as they have become."""
    prepare(p, 0.5 * (drift + part))
    start, v, kicked, moved = equation.start(p), equation.velocity(p), equation.kicked(p), equation.moved(p)
    for k in range(kicked.size):
        kicked[k] = start[k] - v[k]
    reference, first = equation.row_reference(p), equation.first_reference(p)
    damping, spring = equation.row_damping(p), equation.row_spring(p)
    for i in range(reference.size):
        damped, sprung = constraint_rows.product(p, i, kicked), constraint_rows.product(p, i, moved)
        reference[i] = first[i] - damping[i] * damped - spring[i] * sprung
    force, smooth = equation.force(p), equation.smooth_force(p)
    linear_algebra.copy(smooth, force)
    if equation.numbers(p).dragged > 0.0:
        matrices.multiply(p, equation.drag(p), kicked, force)
        for k in range(force.size):
            force[k] = smooth[k] - force[k]
    solve(p)


@exact
def _add_part(p, part):
    """Add a part that was solved to the means, and go on from its end."""
    h, end, start = equation.numbers(p).timestep, equation.end(p), equation.start(p)
    mean, moved = equation.mean_velocity(p), equation.moved(p)
    for k in range(end.size):
        mean[k] += end[k] * (part / h)
        moved[k] += end[k] * part
        start[k] = end[k]
    for b in range(equation.head(p).nbody):
        now, wrench = equation.wrench_of(p, POINT.best, b, 0), equation.wrench(p, b)
        for k in range(6):
            wrench[k] += now[k] * (part / h)
    remember(p)


@exact
def _end(p):
    """Find the force whose step ends where the parts have led."""
    true_end, answer, q = equation.true_end(p), equation.after(p), equation.out(p)
    linear_algebra.copy(equation.start(p), true_end)
    reset(p)
    has_contacts = _leave_to_mujoco(p, equation.touched(p))
    linear_algebra.copy(equation.mean_velocity(p), answer)
    prepare(p, equation.numbers(p).timestep)
    force_to(p, answer, q)
    if has_contacts:
        answer_to(p, q, answer)
    finish(p, true_end)


@exact
def _add_contacts(p, share, out):
    """Add a share of the contacts' generalised force, in the part of a step that was just solved, to out."""
    x, force, kind = equation.row_error(p), equation.row_force(p), equation.row_kind(p)
    if x.size == 0:
        return
    constraint_rows.errors_at(p, equation.end(p), x)
    constraint_rows.forces(p, x, force)
    for i in range(x.size):
        if kind[i] < KIND.contact:
            force[i] = 0.0
    constraint_rows.add_forces(p, force, share, out)


@exact
def _leave_to_mujoco(p, touched):
    """Take the contacts' rows for the force that they had in the parts of a step; whether there are any.

    Whatever MuJoCo's own solution of the contacts differs by is not for the sand to make up for.
    """
    found = False
    kind, stiffness, force = equation.row_kind(p), equation.row_stiffness(p), equation.force(p)
    for i in range(kind.size):
        if kind[i] >= KIND.contact:
            stiffness[i], found = 0.0, True
    for k in range(touched.size):
        force[k] += touched[k]
    return found


@exact
def remember(p):
    """Keep each body's force at the end of the solution at hand, at the later depths, for the next one."""
    v = equation.velocity_of(p, POINT.best)
    for b in range(equation.head(p).nbody):
        kept = equation.kept(p, b)
        felt_twist(p, b, v, kept.twist)
        hold(p, b, kept.twist, kept.strain)
        linear_algebra.copy(equation.wrench_of(p, POINT.best, b, 1), kept.wrench)


@exact
def finish(p, true_end):
    """Keep for the next step what the last part has left, and what MuJoCo's velocity lacks to the true one."""
    lacking, after = equation.lacking(p), equation.after(p)
    for k in range(after.size):
        lacking[k] = true_end[k] - after[k]
    for b in range(equation.head(p).nbody):
        equation.kept(p, b).drift, equation.kept(p, b).parts = equation.numbers(p).drift, equation.numbers(p).parts
