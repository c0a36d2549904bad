"""A step in parts: kicks of half the neighbouring parts, and drifts that only the depths follow.

A body that crosses its own depth within a step needs the depths in between. Such a step is sub-cycled with mass,
Jacobians and normals frozen and only the depths moving; MuJoCo is then handed the force whose step ends where the
sub-cycled path ends. MuJoCo's velocity is the mean one of that path; what it lacks to the true one is carried to the
next step.
"""

from rftsim.machine.compiling import exact
from rftsim.solver import constraint_rows, equation, linear_algebra, state
from rftsim.solver.equation import KIND, POINT
from rftsim.solver.motion import generalised
from rftsim.solver.newton import solve
from rftsim.solver.sinking import sink
from rftsim.solver.step_equation import answer_to, force_to, prepare, reset


@exact
def split_step(p, parts):
    """Take the step in parts, and shorter ones where the equation of one is not solved."""
    h, end = equation.numbers(p).timestep, equation.end(p)
    drift = _begin(p)
    part, done = h / parts, 0.0
    while done < h * (1.0 - 1e-9):
        part = min(part, h - done)
        if h - done - part < 0.3 * part:
            part = h - done
        _solve_part(p, drift, part)
        if equation.numbers(p).solved == 0.0:
            if part > h / (8.0 * parts):
                part *= 0.25
                continue
            equation.work(p).unsolved += 1.0
        _add_contacts(p, part / h, equation.touched(p))
        sink(p, end, part)
        generalised(p, POINT.best, 1, equation.foreseen(p))
        _add_part(p, part)
        drift, done = part, done + part
        part = min(2.0 * part, h / parts)
    _end(p)
    state.flags_at(equation.head(p).new).drift = drift


@exact
def _begin(p):
    """Set all means to zero; the drift before the first part [s]."""
    mean, moved, touched = equation.mean_velocity(p), equation.moved(p), equation.touched(p)
    foreseen, wrench = equation.foreseen(p), equation.all_wrenches(p)
    for k in range(mean.size):
        foreseen[k] = mean[k] = moved[k] = touched[k] = 0.0
    for k in range(wrench.size):
        wrench[k] = 0.0
    equation.numbers(p).knows_derivative = 0.0
    # a velocity that was set by hand belongs to the start of the step, and MuJoCo's own to half a drift before it
    before = state.flags_at(equation.head(p).before)
    if before.split > 0.0:
        return before.drift
    return equation.numbers(p).timestep if before.started > 0.0 else 0.0


@exact
def _solve_part(p, drift, part):
    """Solve the equation of a part, after a drift, with rows and drag as they have become."""
    prepare(p, 0.5 * (drift + part))
    start, v, kicked, moved = equation.start(p), equation.velocity(p), equation.kicked(p), equation.moved(p)
    for k in range(kicked.size):
        kicked[k] = start[k] - v[k]
    reference, first, j = equation.row_reference(p), equation.first_reference(p), equation.row_jacobian(p)
    damping, spring = equation.row_damping(p), equation.row_spring(p)
    for i in range(reference.size):
        damped, sprung = linear_algebra.dot(j[i], kicked), linear_algebra.dot(j[i], moved)
        reference[i] = first[i] - damping[i] * damped - spring[i] * sprung
    force, smooth = equation.force(p), equation.smooth_force(p)
    linear_algebra.multiply(equation.drag(p), kicked, force)
    for k in range(force.size):
        force[k] = smooth[k] - force[k]
    linear_algebra.copy(start, equation.last(p))
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


@exact
def _end(p):
    """Find the force whose step ends where the parts have led, and fill the new state."""
    true_end, answer, q = equation.true_end(p), equation.end(p), equation.out(p)
    linear_algebra.copy(equation.start(p), true_end)
    reset(p)
    has_contacts = _leave_to_mujoco(p, equation.touched(p))
    linear_algebra.copy(equation.mean_velocity(p), answer)
    prepare(p, equation.numbers(p).timestep)
    force_to(p, answer, q)
    if has_contacts:
        answer_to(p, q, answer)
    finish(p, equation.foreseen(p), true_end, answer, 1.0)


@exact
def _add_contacts(p, share, out):
    """Add a share of the contacts' generalised force, in the part of a step that was just solved, to out."""
    start, end, change = equation.start(p), equation.end(p), equation.change(p)
    x, force, kind = equation.row_error(p), equation.row_force(p), equation.row_kind(p)
    if x.size == 0:
        return
    for k in range(out.size):
        change[k] = end[k] - start[k]
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    for i in range(x.size):
        if kind[i] < KIND.contact:
            force[i] = 0.0
    linear_algebra.add_transposed(equation.row_jacobian(p), force, share, out)


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
def finish(p, foreseen, true_end, after, split):
    """Fill the new state, of a step that was split or not.

    Args:
        p: The equation, whose solution is in point POINT.best.
        foreseen: The sand's generalised force foreseen for the next step, (nv,).
        true_end: The true velocity at the end, (nv,).
        after: MuJoCo's velocity there, (nv,).
        split: Whether the step was split, 0.0 or 1.0.
    """
    new = equation.state(p, equation.head(p).new)
    linear_algebra.copy(foreseen, state.foreseen(new))
    linear_algebra.copy(equation.velocity_of(p, POINT.best), state.last(new))
    lacking = state.lacking(new)
    for k in range(after.size):
        lacking[k] = true_end[k] - after[k]
    linear_algebra.copy(after, state.after(new))
    linear_algebra.copy(equation.derivatives(p), state.derivatives(new))
    flags = state.flags_at(new.address)
    flags.knows_force, flags.split = 1.0, split
    flags.knows_derivative = equation.numbers(p).knows_derivative
