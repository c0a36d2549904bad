"""One time step of the sand: predict, solve, and split the step where it is too long for the depth.

A body that crosses its own depth within a step needs the depths in between. Such a step is sub-cycled with mass,
Jacobians and normals frozen and only the depths moving; MuJoCo is then handed the force whose step ends where the
sub-cycled path ends. MuJoCo's velocity is the mean one of that path; what it lacks to the true one is carried to the
next step.

What must last from step to step is one array of numbers, see `state`.
"""

import numpy as np
from numba import njit

from rftsim import dense, implicit, kernels, native_ahead, native_solver, packed
from rftsim.implicit import CONTACT, Rows, Step
from rftsim.state import DRIFT, HEAD, KNOWS_DERIVATIVE, KNOWS_FORCE, SPLIT, STARTED, part_of

FINENESS = 5e-3
"""Error of the position in a step, over the depth, above which the step is split."""
SHALLOWEST = 1e-4
"""Depth [m] below which none is resolved."""
MOST_PARTS = 256
GAIN = 1e-4
"""Work that the sand may do in a step over the kinetic energy: rounding, not physics, and more is taken back."""
FALL = 30.0
"""Acceleration that bodies are watched for on their way to the sand [m/s^2]."""


@njit
def _write(target, origin):
    for i in range(target.size):
        target[i] = origin[i]


@njit
def _is_near(bodies, v, h):
    """Whether any triangle can be in the sand within the step."""
    for b in range(bodies.length.size):
        surface = implicit.surface_of(bodies, b)
        twist = implicit.twist_of(bodies, b, v)
        frame = implicit.frame_at(bodies, b, twist)
        depth = frame.height
        for k in range(3):
            depth -= min(frame.rise[k] * surface[1 + k], frame.rise[k] * surface[4 + k])
        if depth + h * (implicit.speed(twist, 2.0 * bodies.length[b]) + h * FALL) > 0.0:
            return True
    return False


@njit
def _deepest(bodies, b, twist, h):
    """Largest depth of a body's triangles, now or after a time h [m]."""
    surface = implicit.surface_of(bodies, b)
    cx, cy, cz, _, _, _, area = packed.columns(surface)
    frame = implicit.frame_at(bodies, b, twist)
    found = kernels.deepest(cx, cy, cz, 0, area.size, frame)
    v, w, r = frame.v0, frame.omega, frame.rise
    height = frame.height - h * (v[0] * r[0] + v[1] * r[1] + v[2] * r[2])
    rise = (
        r[0] + h * (r[1] * w[2] - r[2] * w[1]),
        r[1] + h * (r[2] * w[0] - r[0] * w[2]),
        r[2] + h * (r[0] * w[1] - r[1] * w[0]),
    )
    later = kernels.Frame(v, w, frame.up, rise, frame.forward, height, frame.rear, frame.drop)
    return max(found, kernels.deepest(cx, cy, cz, 0, area.size, later))


@njit
def _parts(step, after, wrenches, h, first_step, solved):
    """Into how many parts a step must be split."""
    bodies = step.bodies
    grown = implicit.generalised(bodies, wrenches, 6) - implicit.generalised(bodies, wrenches, 0)
    late = h * dense.multiply(step.inverse, grown)
    stopped = after - step.start
    worst = 0.0
    for b in range(bodies.length.size):
        length = bodies.length[b]
        travel = h * implicit.speed(implicit.twist_of(bodies, b, step.start), length)
        jumped = implicit.speed(implicit.twist_of(bodies, b, late), length)
        braked = implicit.speed(implicit.twist_of(bodies, b, stopped), length)
        error = min(h * max(jumped, braked) / 8.0, travel)
        if error <= FINENESS * SHALLOWEST:
            continue
        depth = _deepest(bodies, b, implicit.twist_of(bodies, b, after), h)
        if depth <= 0.0:
            continue
        allowed = FINENESS * max(depth, SHALLOWEST)
        worst = max(worst, error / allowed)
        if first_step and travel > allowed:
            worst = max(worst, 3.9)
    parts = 1 if worst <= 1.0 else min(int(np.ceil(np.sqrt(worst))), MOST_PARTS)
    return parts if solved else max(parts, 4)


@njit
def _rows_with(rows, inverse, mass, stiffness, reference):
    """Constraint rows seen through another mass matrix."""
    n, nv = rows.jacobian.shape
    acceleration = np.zeros((n, nv))
    for i in range(n):
        a = dense.multiply_transposed(inverse, rows.jacobian[i])
        b = dense.multiply_transposed(mass, a)
        for k in range(nv):
            acceleration[i, k] = b[k]
    return Rows(rows.jacobian, acceleration, stiffness, reference, rows.kind, rows.bound, rows.damping, rows.spring)


@njit
def _force_of(mass, rows, change, h, tau):
    """The sand's force that changes the velocity so in one step."""
    return dense.multiply(mass, change) / h - tau - implicit.constrained(rows, change, h)


@njit
def is_needed(old, new, bodies, v, h):
    """Whether the sand can act in the step; where not, the new state is filled."""
    if old[SPLIT] > 0.0 or _is_near(bodies, v, h):
        return True
    for i in range(new.size):
        new[i] = 0.0
    new[STARTED] = 1.0
    return False


@njit
def sand_force(old, new, bodies, rows, mass, mass_h, v, h, tau, count, wrench):
    """The sand's generalised force of one step, (nv,).

    Args:
        old: State after the last step.
        new: State after this one, filled.
        bodies: The bodies in the sand; their frames are spoilt.
        rows: Constraint rows; `acceleration` is filled in here.
        mass: Mass matrix, (nv, nv).
        mass_h: With what the integrator takes implicitly.
        v: Velocity at the start, (nv,).
        h: Length of the step [s].
        tau: Other smooth forces, (nv,).
        count: Evaluations, Jacobians, unsolved equations; counted up.
        wrench: Mean wrench on each body over the step, (nbody, 6), filled.
    """
    nv, nb = v.size, bodies.length.size
    inverse, frames = dense.inverse(mass), bodies.frame.copy()
    allowed = GAIN * dense.dot(v, dense.multiply(mass, v)) + 1e-12
    before, most_parts = old.copy(), MOST_PARTS
    q, work, slack = np.zeros(nv), 0.0, 0.0
    for _ in range(2):
        for i in range(new.size):
            new[i] = 0.0
        new[STARTED] = 1.0
        q = _one_step(before, new, bodies, rows, mass, inverse, mass_h, v, h, tau, most_parts, count, wrench)
        work, slack = 0.0, allowed
        for k in range(nv):
            work += 0.5 * h * q[k] * (v[k] + part_of(new, 3, nv)[k])
            slack += 3.0 * h * native_ahead.V_C * abs(q[k])
        if work <= slack or (before[SPLIT] == 0.0 and new[SPLIT] == 0.0):
            break
        # a split step whose mean force does work: take it whole, from MuJoCo's own velocity
        for i in range(before.size):
            before[i] = 0.0
        before[STARTED], most_parts = 1.0, 1
        for b in range(nb):
            _write(bodies.frame[b], frames[b])
    if work > slack:
        # the force's own share of the work, and the rest's: scale it until they cancel
        own = 0.5 * h * dense.dot(q, dense.multiply(dense.inverse(mass_h), q))
        rest = work / h - own
        share = 0.0 if rest >= 0.0 else min(1.0, -rest / own)
        for k in range(nv):
            q[k] *= share
        for b in range(nb):
            for k in range(6):
                wrench[b, k] *= share
    return q


@njit
def _one_step(old, new, bodies, rows, mass, inverse, mass_h, v, h, tau, most_parts, count, wrench):
    nv, nb = v.size, bodies.length.size
    split_before = old[SPLIT] > 0.0
    drift = old[DRIFT] if split_before else h
    start = v + part_of(old, 2, nv) if split_before else v.copy()
    g = np.empty((nb, 6, 6))
    _write(g.reshape(36 * nb), old[HEAD + 4 * nv :])
    known, foreseen = old[KNOWS_DERIVATIVE] > 0.0, old[KNOWS_FORCE] > 0.0
    last = part_of(old, 1, nv).copy() if foreseen else v.copy()
    rows = _rows_with(rows, inverse, mass_h, rows.stiffness, rows.reference)
    step = Step(bodies, rows, mass_h, dense.inverse(mass_h), start, 0.5 * (drift + h), tau)
    after, wrenches, known, solved = native_solver.solve(step, last, part_of(old, 0, nv), g, known, count)
    parts = min(_parts(step, after, wrenches, h, old[STARTED] == 0.0, solved), most_parts)
    if parts == 1:
        count[2] += 0 if solved else 1
        _write(part_of(new, 0, nv), implicit.generalised(bodies, wrenches, 6))
        _write(part_of(new, 1, nv), after)
        _write(part_of(new, 2, nv), np.zeros(nv))
        _write(part_of(new, 3, nv), after)
        _write(new[HEAD + 4 * nv :], g.reshape(36 * nb))
        new[KNOWS_FORCE], new[KNOWS_DERIVATIVE], new[SPLIT] = 1.0, 1.0 if known else 0.0, 0.0
        for b in range(nb):
            for k in range(6):
                wrench[b, k] = wrenches[b, k]
        if not split_before:
            return implicit.generalised(bodies, wrenches, 0)
        return _force_of(mass_h, rows, after - v, h, tau)
    return _split_step(old, new, step, after, mass, inverse, v, h, parts, count, wrench)


@njit
def _split_step(old, new, whole, after, mass, inverse, v, h, parts, count, wrench):
    """The step in parts: kicks of half the neighbouring parts, and drifts that only the depths follow."""
    nv, nb = v.size, whole.bodies.length.size
    bodies, rows, mass_h, tau = whole.bodies, whole.rows, whole.mass, whole.tau
    # contacts keep the force that the whole step gave them: MuJoCo will give them one force
    force, active = np.empty(rows.kind.size), np.empty(rows.kind.size)
    implicit.constraint_force(rows, after - v, h, force, active)
    stiffness, tau = rows.stiffness.copy(), tau.copy()
    for i in range(rows.kind.size):
        if rows.kind[i] == CONTACT:
            stiffness[i] = 0.0
            tau += rows.jacobian[i] * force[i]
    held = Rows(
        rows.jacobian, rows.acceleration, stiffness, rows.reference, rows.kind, rows.bound, rows.damping, rows.spring
    )
    drag = (mass_h - mass) / h
    kicked, foreseen, mean, moved = whole.start.copy(), np.zeros(nv), np.zeros(nv), np.zeros(nv)
    g, known = np.zeros((nb, 6, 6)), False
    # a velocity that was set by hand belongs to the start of the step, and MuJoCo's own to half a drift before it
    drift = old[DRIFT] if old[SPLIT] > 0.0 else (h if old[STARTED] > 0.0 else 0.0)
    part, done = h / parts, 0.0
    for b in range(nb):
        for k in range(6):
            wrench[b, k] = 0.0
    while done < h * (1.0 - 1e-9):
        part = min(part, h - done)
        if h - done - part < 0.3 * part:
            part = h - done
        kick = 0.5 * (drift + part)
        mass_k = mass + kick * drag
        reference = rows.reference.copy()
        for i in range(rows.kind.size):
            reference[i] -= rows.damping[i] * dense.dot(rows.jacobian[i], kicked - v)
            reference[i] -= rows.spring[i] * dense.dot(rows.jacobian[i], moved)
        seen = _rows_with(rows, inverse, mass_k, stiffness, reference)
        pushed = tau - dense.multiply(drag, kicked - v)
        step = Step(bodies, seen, mass_k, dense.inverse(mass_k), kicked, kick, pushed)
        after, wrenches, known, solved = native_solver.solve(step, kicked, foreseen, g, known, count)
        if not solved:
            if part > h / (8.0 * parts):
                part *= 0.25
                continue
            count[2] += 1
        implicit.sink(bodies, after, part)
        foreseen = implicit.generalised(bodies, wrenches, 6)
        mean += after * (part / h)
        moved += after * part
        for b in range(nb):
            for k in range(6):
                wrench[b, k] += wrenches[b, k] * (part / h)
        kicked, drift, done = after, part, done + part
        part = min(2.0 * part, h / parts)
    _write(part_of(new, 0, nv), foreseen)
    _write(part_of(new, 1, nv), kicked)
    _write(part_of(new, 2, nv), kicked - mean)
    _write(part_of(new, 3, nv), mean)
    _write(new[HEAD + 4 * nv :], g.reshape(36 * nb))
    new[KNOWS_FORCE], new[KNOWS_DERIVATIVE], new[SPLIT], new[DRIFT] = 1.0, 1.0 if known else 0.0, 1.0, drift
    return _force_of(mass_h, held, mean - v, h, tau)
