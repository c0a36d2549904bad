"""A step in parts: kicks of half the neighbouring parts, and drifts that only the depths follow.

A body that crosses its own depth within a step needs the depths in between. Such a step is sub-cycled with mass,
Jacobians and normals frozen and only the depths moving; MuJoCo is then handed the force whose step ends where the
sub-cycled path ends. MuJoCo's velocity is the mean one of that path; what it lacks to the true one is carried to the
next step.
"""

from typing import Final

from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra, matrices
from rftsim.solver.equation import KIND, POINT
from rftsim.solver.motion import felt_twist
from rftsim.solver.newton import hold, solve
from rftsim.solver.parts import parts_needed
from rftsim.solver.sinking import sink
from rftsim.solver.step_equation import answer_to, force_to, prepare, reset
from rftsim.solver.steps import BRAKE, BUDGET, worth

LEAST_COST: Final = 3.0
"""Evaluations' worth of a part, at least."""
BEGUN: Final = 2.0
"""Evaluations' worth of a part that is begun and ends at once."""
LAST: Final = BEGUN + BRAKE
"""Evaluations' worth that is kept for the last part."""
MORE: Final = 2.0
"""Factor to which a step is split finer than was foreseen, where a part of it asks for that."""


@exact
def affordable(p, cost):
    """How many parts can be solved with what is left, if one costs so many evaluations' worth."""
    return (BUDGET - BRAKE - worth(p)) / max(LEAST_COST, cost)


@exact
def has_next(p):
    """Whether a part can be begun that is not the last."""
    return worth(p) + BEGUN + LAST <= BUDGET


@exact
def split_step(p, parts):
    """Take the step in parts, and shorter ones where the equation of one is not solved, as far as evaluations last."""
    h, end = equation.numbers(p).timestep, equation.end(p)
    equation.numbers(p).is_whole, drift = 0.0, _begin(p)
    part, done, needed = h / parts, 0.0, 1.0
    while done < h * (1.0 - 1e-9):
        part = min(max(part, (h - done) / max(affordable(p, LEAST_COST), 1.0)), h - done)
        if h - done - part < 0.3 * part or not has_next(p):
            part = h - done
        equation.numbers(p).budget = BUDGET if part == h - done else BUDGET - LAST
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
