"""One time step of the sand: predict, solve, and split the step where it is too long for the depth.

A body that crosses its own depth within a step needs the depths in between. Such a step is sub-cycled with mass,
Jacobians and normals frozen and only the depths moving; MuJoCo is then handed the force whose step ends where the
sub-cycled path ends. MuJoCo's velocity is the mean one of that path; what it lacks to the true one is carried to the
next step.

What must last from step to step is one array of numbers, see `state`; the step's equation is a table, see `equation`.
"""

from typing import Final

import numpy as np
from numba import njit

from rftsim.law import kernels, kinematics, layout
from rftsim.law.exports_ahead import FRAME
from rftsim.machine.memory import doubles, int64s, room
from rftsim.solver import constraint_rows, equation, linear_algebra, native_solver, newton
from rftsim.solver.equation import AT, KEEP, KIND, PART, POINT, ROW
from rftsim.solver.state import DRIFT, HEAD, KNOWS_DERIVATIVE, KNOWS_FORCE, SPLIT, STARTED, part_of, state_size

FINENESS: Final = 5e-3
"""Error of the position in a step, over the depth, above which the step is split."""
SHALLOWEST: Final = 1e-4
"""Depth [m] below which none is resolved."""
MOST_PARTS: Final = (256, 1)
"""Parts of a step; where those did work, it is taken whole."""
GAIN: Final = 1e-7
"""Work that the sand may do in a step over the kinetic energy: rounding, not physics, and more is taken back."""
FALL: Final = 30.0
"""Acceleration that bodies are watched for on their way to the sand [m/s^2]."""


@njit
def _state(p, entry):
    return doubles(equation.number(p, entry), state_size(equation.number(p, AT.nbody), equation.number(p, AT.nv)))


@njit
def _timestep(p):
    return doubles(equation.number(p, AT.timestep), 1)[0]


@njit
def is_near(p):
    """Whether any triangle can be in the sand within the step."""
    v, h, twist = equation.of_dofs(p, AT.velocity), _timestep(p), doubles(room(6), 6)
    for k in range(6):
        twist[k] = 0.0
    for b in range(equation.number(p, AT.nbody)):
        surface = doubles(equation.body_surface(p, b), layout.HEADER)
        depth = kinematics.lowest_corner(surface, newton.frame_at(p, b, twist))
        if depth + h * (newton.speed_of(p, b, v, 2.0) + h * FALL) > 0.0:
            return True
    return False


@njit
def is_needed(p):
    """Whether the sand can act in the step; where not, the new state is filled."""
    if _state(p, AT.old)[SPLIT] > 0.0 or is_near(p):
        return True
    _begin(_state(p, AT.new))
    return False


@njit
def _begin(new):
    for i in range(new.size):
        new[i] = 0.0
    new[STARTED] = 1.0


@njit
def _turned(twist_frame, h):
    """The gradient of the depth after a time h."""
    r, w = twist_frame.rise, twist_frame.omega
    return (
        r[0] + h * (r[1] * w[2] - r[2] * w[1]),
        r[1] + h * (r[2] * w[0] - r[0] * w[2]),
        r[2] + h * (r[0] * w[1] - r[1] * w[0]),
    )


@njit
def _lowered(frame, h):
    """The depth of a body's origin after a time h."""
    v, r = frame.v0, frame.rise
    return frame.height - h * (v[0] * r[0] + v[1] * r[1] + v[2] * r[2])


@njit
def _sink(p, v, h):
    """Move the depths by a time h of the motion v; positions and normals stay."""
    twist = doubles(room(6), 6)
    for b in range(equation.number(p, AT.nbody)):
        newton.twist_of(p, b, v, twist)
        frame, f = newton.frame_at(p, b, twist), equation.body_frame(p, b)
        f[9] = _lowered(frame, h)
        f[3], f[4], f[5] = _turned(frame, h)


@njit
def _deepest(p, b, v, h):
    """Largest depth of a body's triangles, now or after a time h [m]."""
    twist = doubles(room(6), 6)
    newton.twist_of(p, b, v, twist)
    address = equation.body_surface(p, b)
    surface = doubles(address, kinematics.size_of(doubles(address, layout.HEADER)))
    frame, found = newton.frame_at(p, b, twist), -1e30
    for _ in range(2):
        found = max(found, kernels.deepest(surface, frame))
        turned, lowered = _turned(frame, h), _lowered(frame, h)
        frame = kernels.Frame(frame.v0, frame.omega, frame.up, turned, frame.forward, lowered, frame.rear, frame.drop)
    return found


@njit
def _parts(p, first_step, solved):
    """Into how many parts a step must be split; its solution is in point BEST."""
    h, at = _timestep(p), equation.point(p, POINT.best)
    after, start = equation.point_vector(p, at, PART.velocity), equation.of_dofs(p, AT.start)
    grown, late, stopped = (
        equation.step_vector(p, KEEP.one),
        equation.step_vector(p, KEEP.two),
        equation.step_vector(p, KEEP.three),
    )
    newton.generalised(p, at, 1, grown)
    newton.generalised(p, at, 0, late)
    for k in range(after.size):
        grown[k] = h * (grown[k] - late[k])
        stopped[k] = after[k] - start[k]
    linear_algebra.substitute(equation.square(p, AT.mass_factors), equation.order(p, AT.mass_order), grown, late)
    worst = 0.0
    for b in range(equation.number(p, AT.nbody)):
        travel = h * newton.speed_of(p, b, start)
        error = h * max(newton.speed_of(p, b, late), newton.speed_of(p, b, stopped)) / 8.0
        error = min(error, travel)
        if error <= FINENESS * SHALLOWEST:
            continue
        depth = _deepest(p, b, after, h)
        if depth <= 0.0:
            continue
        allowed = FINENESS * max(depth, SHALLOWEST)
        worst = max(worst, error / allowed)
        if first_step and travel > allowed:
            worst = max(worst, 3.9)
    parts = 1 if worst <= 1.0 else min(int(np.ceil(np.sqrt(worst))), MOST_PARTS[0])
    return parts if solved else max(parts, 4)


@njit
def _prepare(p, h):
    """Set the equation's mass and its factors, its rows and its step for a time h."""
    drag, plain, mass = equation.square(p, AT.drag), equation.square(p, AT.plain_mass), equation.square(p, AT.mass)
    for i in range(mass.shape[0]):
        for k in range(mass.shape[0]):
            mass[i, k] = plain[i, k] + h * drag[i, k]
    linear_algebra.factor_of(mass, equation.square(p, AT.mass_factors), equation.order(p, AT.mass_order))
    j, dragged = equation.rows_by_dofs(p, AT.row_jacobian), equation.rows_by_dofs(p, AT.row_drag)
    seen = equation.rows_by_dofs(p, AT.row_acceleration)
    for i in range(j.shape[0]):
        for k in range(j.shape[1]):
            seen[i, k] = j[i, k] + h * dragged[i, k]
    doubles(equation.number(p, AT.step), 1)[0] = h


@njit
def _force_of(p, velocity, out):
    """Fill out with the sand's force that makes MuJoCo's step end at a velocity; the equation is that of the step."""
    v, h = equation.of_dofs(p, AT.velocity), _timestep(p)
    linear_algebra.copy(v, equation.of_dofs(p, AT.start))
    residual, nothing = equation.step_vector(p, KEEP.four), equation.step_vector(p, KEEP.five)
    for k in range(v.size):
        nothing[k] = 0.0
    newton.residual_of(p, velocity, nothing, residual)
    for k in range(v.size):
        out[k] = residual[k] / h


@njit
def _reset(p):
    """Set the equation to the whole step from MuJoCo's own velocity."""
    n = equation.number(p, AT.nrow)
    linear_algebra.copy(equation.of_dofs(p, AT.velocity), equation.of_dofs(p, AT.start))
    linear_algebra.copy(equation.of_dofs(p, AT.smooth_force), equation.of_dofs(p, AT.force))
    linear_algebra.copy(
        doubles(equation.number(p, AT.first_stiffness), n), doubles(equation.number(p, AT.row_stiffness), n)
    )
    linear_algebra.copy(
        doubles(equation.number(p, AT.first_reference), n), doubles(equation.number(p, AT.row_reference), n)
    )


@njit
def _answer(p, q, out):
    """Fill out with the velocity in which MuJoCo's step ends under a generalised force of the sand."""
    _reset(p)
    _prepare(p, _timestep(p))
    v, residual = equation.of_dofs(p, AT.velocity), equation.step_vector(p, KEEP.four)
    newton.residual_of(p, v, q, residual)
    newton.linear_solution(p, v, residual, newton.NOTHING, out)


@njit
def _finish(p, foreseen, last, delta, after, split):
    """Fill the new state."""
    nb, nv, new = equation.number(p, AT.nbody), equation.number(p, AT.nv), _state(p, AT.new)
    linear_algebra.copy(foreseen, part_of(new, 0, nv))
    linear_algebra.copy(last, part_of(new, 1, nv))
    for k in range(nv):
        part_of(new, 2, nv)[k] = delta[k] - after[k]
    linear_algebra.copy(after, part_of(new, 3, nv))
    linear_algebra.copy(doubles(equation.number(p, AT.derivative), 36 * nb), new[HEAD + 4 * nv :])
    new[KNOWS_FORCE], new[SPLIT] = 1.0, split
    new[KNOWS_DERIVATIVE] = doubles(equation.number(p, AT.flags), 1)[0]


@njit
def step(p):
    """The sand's generalised force of one step: fills AT.out, AT.new and AT.wrench, and counts."""
    nb, nv = equation.number(p, AT.nbody), equation.number(p, AT.nv)
    before, new, v = _state(p, AT.before), _state(p, AT.new), equation.of_dofs(p, AT.velocity)
    q, moved, h = equation.of_dofs(p, AT.out), equation.step_vector(p, KEEP.one), _timestep(p)
    frames, first = (
        doubles(equation.number(p, AT.frames), FRAME * nb),
        doubles(equation.number(p, AT.first_frames), FRAME * nb),
    )
    linear_algebra.copy(_state(p, AT.old), before)
    linear_algebra.copy(frames, first)
    linear_algebra.multiply(equation.square(p, AT.plain_mass), v, moved)
    allowed = GAIN * linear_algebra.dot(v, moved) + 1e-12
    work, slack = 0.0, 0.0
    for most_parts in MOST_PARTS:
        _begin(new)
        _one_step(p, most_parts)
        work, slack = 0.0, allowed
        after = part_of(new, 3, nv)
        for k in range(nv):
            work += 0.5 * h * q[k] * (v[k] + after[k])
            slack += 3.0 * h * newton.V_C * abs(q[k])
        if work <= slack or (before[SPLIT] == 0.0 and new[SPLIT] == 0.0):
            break
        # a split step whose mean force does work: take it whole, from MuJoCo's own velocity
        for i in range(before.size):
            before[i] = 0.0
        before[STARTED] = 1.0
        linear_algebra.copy(first, frames)
    if work > slack:
        _take_back(p, work, slack)


@njit
def _take_back(p, work, slack):
    """Shrink a force that did work until it does none, and the wrenches with it."""
    nb, h, v = equation.number(p, AT.nbody), _timestep(p), equation.of_dofs(p, AT.velocity)
    q, moved, answer = equation.of_dofs(p, AT.out), equation.step_vector(p, KEEP.one), equation.of_dofs(p, AT.end)
    wrench = doubles(equation.number(p, AT.wrench), 6 * nb)
    # the force's own share of the work, and the rest's: where there are no constraints, they cancel at once
    linear_algebra.substitute(equation.square(p, AT.mass_factors), equation.order(p, AT.mass_order), q, moved)
    own = 0.5 * h * linear_algebra.dot(q, moved)
    rest = work / h - own
    share = 0.0 if rest >= 0.0 else min(1.0, -rest / own)
    for trial in range(6):
        for k in range(q.size):
            q[k] *= share
        for k in range(wrench.size):
            wrench[k] *= share
        _answer(p, q, answer)
        work = 0.0
        for k in range(q.size):
            work += 0.5 * h * q[k] * (v[k] + answer[k])
        if work <= slack:
            break
        share = 0.5 if trial < 4 else 0.0
    linear_algebra.copy(answer, part_of(_state(p, AT.new), 3, v.size))


@njit
def _one_step(p, most_parts):
    """A step from the state BEFORE."""
    nb, nv, h = equation.number(p, AT.nbody), equation.number(p, AT.nv), _timestep(p)
    before, v, flags = _state(p, AT.before), equation.of_dofs(p, AT.velocity), doubles(equation.number(p, AT.flags), 2)
    _reset(p)
    split_before = before[SPLIT] > 0.0
    drift = before[DRIFT] if split_before else h
    linear_algebra.copy(v, equation.of_dofs(p, AT.last))
    if split_before:
        start, delta = equation.of_dofs(p, AT.start), part_of(before, 2, nv)
        for k in range(nv):
            start[k] += delta[k]
    if before[KNOWS_FORCE] > 0.0:
        linear_algebra.copy(part_of(before, 1, nv), equation.of_dofs(p, AT.last))
    linear_algebra.copy(part_of(before, 0, nv), equation.of_dofs(p, AT.foreseen))
    linear_algebra.copy(before[HEAD + 4 * nv :], doubles(equation.number(p, AT.derivative), 36 * nb))
    flags[0] = before[KNOWS_DERIVATIVE]
    _prepare(p, 0.5 * (drift + h))
    native_solver.solve(p)
    solved = flags[1] > 0.0
    parts = min(_parts(p, before[STARTED] == 0.0, solved), most_parts)
    if parts > 1:
        _split_step(p, parts)
        return
    if not solved:
        doubles(equation.number(p, AT.counts), 3)[2] += 1.0
    at, foreseen, end = equation.point(p, POINT.best), equation.step_vector(p, KEEP.six), equation.of_dofs(p, AT.end)
    newton.generalised(p, at, 1, foreseen)
    _finish(p, foreseen, equation.point_vector(p, at, PART.velocity), end, end, 0.0)
    for b in range(nb):
        linear_algebra.copy(equation.point_wrench(p, at, b, 0), doubles(equation.number(p, AT.wrench) + 48 * b, 6))
    if drift != h:
        _prepare(p, h)
    _force_of(p, end, equation.of_dofs(p, AT.out))


@njit
def _add_contacts(p, share, out):
    """Add a share of the contacts' generalised force, in the part of a step that was just solved, to out."""
    start, end, change = equation.of_dofs(p, AT.start), equation.of_dofs(p, AT.end), equation.step_vector(p, KEEP.one)
    x, force = constraint_rows.row_scratch(p, ROW.x), constraint_rows.row_scratch(p, ROW.force)
    if x.size == 0:
        return
    for k in range(out.size):
        change[k] = end[k] - start[k]
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    kind = int64s(equation.number(p, AT.row_kind), x.size)
    for i in range(x.size):
        if kind[i] < KIND.contact:
            force[i] = 0.0
    linear_algebra.add_transposed(equation.rows_by_dofs(p, AT.row_jacobian), force, share, out)


@njit
def _leave_to_mujoco(p, touched):
    """Take the contacts' rows for the force that they had in the parts of a step; whether there are any.

    Whatever MuJoCo's own solution of the contacts differs by is not for the sand to make up for.
    """
    found = False
    kind = int64s(equation.number(p, AT.row_kind), equation.number(p, AT.nrow))
    stiffness, force = equation.of_rows(p, AT.row_stiffness), equation.of_dofs(p, AT.force)
    for i in range(kind.size):
        if kind[i] >= KIND.contact:
            stiffness[i], found = 0.0, True
    for k in range(touched.size):
        force[k] += touched[k]
    return found


@njit
def _split_step(p, parts):
    """The step in parts: kicks of half the neighbouring parts, and drifts that only the depths follow."""
    nb, nv, h = equation.number(p, AT.nbody), equation.number(p, AT.nv), _timestep(p)
    before, new, v = _state(p, AT.before), _state(p, AT.new), equation.of_dofs(p, AT.velocity)
    kicked, foreseen, end = equation.of_dofs(p, AT.start), equation.of_dofs(p, AT.foreseen), equation.of_dofs(p, AT.end)
    last, pushed, at = equation.of_dofs(p, AT.last), equation.of_dofs(p, AT.force), equation.point(p, POINT.best)
    mean, moved, smooth = (
        equation.step_vector(p, KEEP.three),
        equation.step_vector(p, KEEP.four),
        equation.of_dofs(p, AT.smooth_force),
    )
    change, count = equation.step_vector(p, KEEP.five), doubles(equation.number(p, AT.counts), 3)
    touched = equation.step_vector(p, KEEP.two)
    flags, j = doubles(equation.number(p, AT.flags), 2), equation.rows_by_dofs(p, AT.row_jacobian)
    reference, first = equation.of_rows(p, AT.row_reference), equation.of_rows(p, AT.first_reference)
    damping, spring = equation.of_rows(p, AT.row_damping), equation.of_rows(p, AT.row_spring)
    wrench = doubles(equation.number(p, AT.wrench), 6 * nb)
    for k in range(nv):
        foreseen[k] = mean[k] = moved[k] = touched[k] = 0.0
    for k in range(6 * nb):
        wrench[k] = 0.0
    flags[0] = 0.0
    # a velocity that was set by hand belongs to the start of the step, and MuJoCo's own to half a drift before it
    drift = before[DRIFT] if before[SPLIT] > 0.0 else (h if before[STARTED] > 0.0 else 0.0)
    part, done = h / parts, 0.0
    while done < h * (1.0 - 1e-9):
        part = min(part, h - done)
        if h - done - part < 0.3 * part:
            part = h - done
        _prepare(p, 0.5 * (drift + part))
        for k in range(nv):
            change[k] = kicked[k] - v[k]
        for i in range(reference.size):
            reference[i] = (
                first[i] - damping[i] * linear_algebra.dot(j[i], change) - spring[i] * linear_algebra.dot(j[i], moved)
            )
        linear_algebra.multiply(equation.square(p, AT.drag), change, pushed)
        for k in range(nv):
            pushed[k] = smooth[k] - pushed[k]
        linear_algebra.copy(kicked, last)
        native_solver.solve(p)
        if flags[1] == 0.0:
            if part > h / (8.0 * parts):
                part *= 0.25
                continue
            count[2] += 1.0
        _add_contacts(p, part / h, touched)
        _sink(p, end, part)
        newton.generalised(p, at, 1, foreseen)
        for k in range(nv):
            mean[k] += end[k] * (part / h)
            moved[k] += end[k] * part
            kicked[k] = end[k]
        for b in range(nb):
            now = equation.point_wrench(p, at, b, 0)
            for k in range(6):
                wrench[6 * b + k] += now[k] * (part / h)
        drift, done = part, done + part
        part = min(2.0 * part, h / parts)
    true, answer, q = equation.step_vector(p, KEEP.six), equation.of_dofs(p, AT.end), equation.of_dofs(p, AT.out)
    linear_algebra.copy(kicked, true)
    _reset(p)
    has_contacts = _leave_to_mujoco(p, touched)
    linear_algebra.copy(mean, answer)
    _prepare(p, h)
    _force_of(p, answer, q)
    if has_contacts:
        _answer(p, q, answer)
    _finish(p, foreseen, equation.point_vector(p, at, PART.velocity), true, answer, 1.0)
    new[DRIFT] = drift
