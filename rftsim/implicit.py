"""The sand's force at the end of a time step: a velocity that the force it causes would lead to.

Resistive force knows the direction of motion and not the speed, so at rest it is a jump. Taken from the start of a step
it chatters and is biased; here v+ solves

    M (v+ - v) = h (tau + J' f(v+) + Q(v+)),

tau the other smooth forces, f the constraints' by MuJoCo's own law, Q the sand's with |v| / sqrt(|v|^2 + V_C^2) before
each triangle's stress. The solver is Newton's method with kept Jacobians (a rank-one update per body and iteration);
where the exact Jacobian overshoots rest, one that is secant along the motion takes its place.

All twists and wrenches here are about the body's origin, in world axes: velocity or force first.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from rftsim import dense, kernels, packed
from rftsim.kernels import Frame
from rftsim.memory import doubles
from rftsim.native_ahead import V_C, ahead, jacobian

TOLERANCE = 3e-3
"""Allowed error of a sand body's velocity, relative; V_C is added."""
MOST = 40
"""Iterations of one solution."""
LOOSEST = 20.0
"""Factor to which the tolerance is loosened, from the sixth iteration on."""


class Bodies(NamedTuple):
    """The bodies in the sand, for one step."""

    jacobian: Any
    """Twist of each body by the generalised velocity, (nbody, 6, nv)."""
    rotation: Any
    """Body to world, row-major, (nbody, 9)."""
    frame: Any
    """(nbody, FRAME)."""
    length: Any
    """Length that makes a velocity of an angular one [m], (nbody,)."""
    surface: Any
    """Address and size of each packed surface, (nbody, 2)."""
    sand: Any
    """Packed sand."""


class Rows(NamedTuple):
    """MuJoCo's constraint rows: at an acceleration a, force -D (J a - aref), clamped by kind."""

    jacobian: Any
    """(n, nv)."""
    acceleration: Any
    """J M^-1 M_h, which turns (v+ - v) / h into the acceleration that the rows see, (n, nv)."""
    stiffness: Any
    """D, (n,)."""
    reference: Any
    """aref, (n,)."""
    kind: Any
    """EQUALITY, LIMIT, FRICTION or CONTACT, (n,)."""
    bound: Any
    """Largest force of a friction row, (n,)."""
    damping: Any
    """Derivative of -aref by the row's velocity, (n,)."""
    spring: Any
    """Derivative of -aref by the row's position, (n,)."""


EQUALITY, LIMIT, FRICTION, CONTACT = 0, 1, 2, 3


class Step(NamedTuple):
    """One equation M (v+ - v) = h (tau + J' f + Q)."""

    bodies: Bodies
    rows: Rows
    mass: Any
    """M_h: the mass matrix with what the integrator takes implicitly, (nv, nv)."""
    inverse: Any
    """Its inverse."""
    start: Any
    """v, (nv,)."""
    h: Any
    """[s]."""
    tau: Any
    """(nv,)."""


class Point(NamedTuple):
    """A velocity that was tried."""

    v: Any
    """(nv,)."""
    wrench: Any
    """Of each body at the present depths, and at those after the step, (nbody, 12)."""
    residual: Any
    """Impulse that is missing, (nv,)."""
    size: Any
    """Its size in the mass metric."""
    scale: Any
    """Sum of the sizes of the impulses."""
    error: Any
    """Largest velocity error of a body over what is allowed."""


@njit
def twist_of(bodies, b, v):
    """J_b v, (6,)."""
    return dense.multiply(bodies.jacobian[b], v)


@njit
def speed(twist, length):
    """|velocity| + length |angular velocity| [m/s]."""
    linear = np.sqrt(twist[0] * twist[0] + twist[1] * twist[1] + twist[2] * twist[2])
    return linear + length * np.sqrt(twist[3] * twist[3] + twist[4] * twist[4] + twist[5] * twist[5])


@njit
def frame_at(bodies, b, twist):
    """The frame of body b that moves with a twist."""
    f, xmat = bodies.frame[b], bodies.rotation[b]
    v0 = packed.to_body(xmat, twist[0], twist[1], twist[2])
    omega = packed.to_body(xmat, twist[3], twist[4], twist[5])
    up, rise, forward = (f[0], f[1], f[2]), (f[3], f[4], f[5]), (f[6], f[7], f[8])
    return Frame(v0, omega, up, rise, forward, f[9], (f[10], f[11], f[12], f[13]), f[14])


@njit
def sink(bodies, v, h):
    """Move the depths by a time h of the motion v; positions and normals stay."""
    for b in range(bodies.length.size):
        f = bodies.frame[b]
        frame = frame_at(bodies, b, twist_of(bodies, b, v))
        rise, (wx, wy, wz) = frame.rise, frame.omega
        f[9] -= h * (frame.v0[0] * rise[0] + frame.v0[1] * rise[1] + frame.v0[2] * rise[2])
        f[3] += h * (rise[1] * wz - rise[2] * wy)
        f[4] += h * (rise[2] * wx - rise[0] * wz)
        f[5] += h * (rise[0] * wy - rise[1] * wx)


@njit
def surface_of(bodies, b):
    """The packed surface of body b."""
    return doubles(bodies.surface[b, 0], bodies.surface[b, 1])


@njit
def evaluate(bodies, v, h, out):
    """Wrench of each body, at the present depths and at those after a time h, (nbody, 12)."""
    for b in range(bodies.length.size):
        twist = twist_of(bodies, b, v)
        f, r = bodies.frame[b].ctypes.data, bodies.rotation[b].ctypes.data
        ahead(bodies.sand.ctypes.data, bodies.surface[b, 0], f, r, twist.ctypes.data, h, out[b].ctypes.data)
        twist[0] = 0.0  # used after the call, so that it lives as long as its address is


@njit
def differentiate(bodies, v, completed, out):
    """Derivative of each body's wrench by its twist, (nbody, 6, 6)."""
    for b in range(bodies.length.size):
        twist = twist_of(bodies, b, v)
        f, r = bodies.frame[b].ctypes.data, bodies.rotation[b].ctypes.data
        s, o = bodies.sand.ctypes.data, out[b].ctypes.data
        jacobian(s, bodies.surface[b, 0], f, r, twist.ctypes.data, completed, o)
        twist[0] = 0.0


@njit
def generalised(bodies, wrench, offset):
    """Sum of J_b' wrench_b, (nv,), of the present wrenches (offset 0) or the later ones (offset 6)."""
    out = np.zeros(bodies.jacobian.shape[2])
    for b in range(bodies.length.size):
        for r in range(6):
            for k in range(out.size):
                out[k] += bodies.jacobian[b, r, k] * wrench[b, offset + r]
    return out


@njit
def constraint_force(rows, change, h, force, active):
    """Force of each row at the velocity change v+ - v, and its active stiffness."""
    for i in range(rows.kind.size):
        x = dense.dot(rows.acceleration[i], change) / h - rows.reference[i]
        active[i] = rows.stiffness[i]
        force[i] = -rows.stiffness[i] * x
        if (rows.kind[i] == LIMIT or rows.kind[i] == CONTACT) and x >= 0.0:
            force[i], active[i] = 0.0, 0.0
        if rows.kind[i] == FRICTION and abs(force[i]) > rows.bound[i]:
            force[i], active[i] = (rows.bound[i] if force[i] > 0.0 else -rows.bound[i]), 0.0


@njit
def constrained(rows, change, h):
    """Generalised force of the rows, (nv,)."""
    force, active = np.empty(rows.kind.size), np.empty(rows.kind.size)
    constraint_force(rows, change, h, force, active)
    return dense.multiply_transposed(rows.jacobian, force)


@njit
def _matrix(step, v, g, use):
    """Derivative of the residual by v, with the bodies' derivatives g."""
    rows, bodies = step.rows, step.bodies
    a = step.mass.copy()
    nv = a.shape[0]
    if use:
        for b in range(bodies.length.size):
            j = bodies.jacobian[b]
            for r in range(6):
                for k in range(nv):
                    gj = 0.0
                    for c in range(6):
                        gj += g[b, r, c] * j[c, k]
                    if gj != 0.0:
                        for i in range(nv):
                            a[i, k] -= step.h * j[r, i] * gj
    force, active = np.empty(rows.kind.size), np.empty(rows.kind.size)
    constraint_force(rows, v - step.start, step.h, force, active)
    for i in range(rows.kind.size):
        if active[i] > 0.0:
            for r in range(nv):
                q = active[i] * rows.jacobian[i, r]
                if q != 0.0:
                    for k in range(nv):
                        a[r, k] += q * rows.acceleration[i, k]
    return a


@njit
def try_velocity(step, v):
    """Evaluate the equation at a velocity."""
    bodies = step.bodies
    wrench = np.empty((bodies.length.size, 12))
    evaluate(bodies, v, step.h, wrench)
    q = generalised(bodies, wrench, 0)
    change = v - step.start
    f = constrained(step.rows, change, step.h)
    residual = dense.multiply(step.mass, change) - step.h * (step.tau + f + q)
    wrong = dense.multiply(step.inverse, residual)
    error = 0.0
    for b in range(bodies.length.size):
        allowed = TOLERANCE * speed(twist_of(bodies, b, v), bodies.length[b]) + V_C
        error = max(error, speed(twist_of(bodies, b, wrong), bodies.length[b]) / allowed)
    scale = dense.norm(step.inverse, step.tau) + dense.norm(step.inverse, f) + dense.norm(step.inverse, q)
    size = np.sqrt(max(dense.dot(residual, wrong), 0.0))
    return Point(v, wrench, residual, size, step.h * scale + kernels.TINY, error)


@njit
def predict(step, v, q, g, use):
    """One Newton step from v with the sand's force q + sum J' g J (v' - v): no evaluation."""
    change = v - step.start
    f = constrained(step.rows, change, step.h)
    residual = dense.multiply(step.mass, change) - step.h * (step.tau + f + q)
    return v - dense.solve(_matrix(step, v, g, use), residual)


@njit
def _update(bodies, old, new, g):
    """Broyden's rank-one update of each body's derivative."""
    for b in range(bodies.length.size):
        moved = twist_of(bodies, b, new.v - old.v)
        l2 = bodies.length[b] * bodies.length[b]
        square = 0.0
        for r in range(6):
            square += (1.0 if r < 3 else l2) * moved[r] * moved[r]
        if square > 0.0:
            missed = dense.multiply(g[b], moved)
            for r in range(6):
                y = new.wrench[b, r] - old.wrench[b, r] - missed[r]
                for k in range(6):
                    g[b, r, k] += y * (1.0 if k < 3 else l2) * moved[k] / square


@njit
def _restart(step, attempt):
    """Where to start again: near rest along the driving impulse, free, near rest along the old velocity."""
    if attempt == 2:
        return step.start + step.h * dense.multiply(step.inverse, step.tau)
    v = step.start.copy()
    if attempt == 1:
        v = dense.multiply(step.inverse, dense.multiply(step.mass, step.start) + step.h * step.tau)
    fastest = kernels.TINY
    for b in range(step.bodies.length.size):
        fastest = max(fastest, speed(twist_of(step.bodies, b, v), step.bodies.length[b]))
    return v * min(1.0, 0.1 * V_C / fastest)


@njit
def solve(step, guess, last, g, known, count):
    """Solve the equation.

    Args:
        step: The equation.
        guess: Where to start.
        last: Another velocity to start from, where the guess is poor.
        g: The bodies' derivatives, kept from before where `known`; replaced by the newest.
        known: Whether g holds derivatives.
        count: Evaluations and Jacobians, counted up.

    Returns:
        The best point, whether g holds derivatives, and whether the equation is solved.
    """
    bodies = step.bodies
    now = try_velocity(step, guess)
    count[0] += 1
    best = now
    stale = False
    if now.error > 1.0 and now.size > 0.3 * now.scale:  # a poor guess: is the last velocity nearer?
        other = try_velocity(step, last)
        count[0] += 1
        if other.size < now.size:
            now = best = other
            stale = True
    fresh = by_secant = False
    secant = shortened = failures = restarts = 0
    loose, t = 1.0, 1.0
    next_restart = 12
    completed = np.empty_like(g)
    direction = np.zeros(step.start.size)
    iteration = 0
    while best.error > loose and iteration < MOST:
        iteration += 1
        if iteration > 6:
            loose = min(1.5 * loose, LOOSEST)
        if iteration > 10 and best.size < 5e-3 * best.scale:  # a face on its edge: no closer solution exists
            break
        if iteration >= next_restart and best.size > 0.05 * best.scale and shortened == 0 and restarts < 3:
            restarts += 1
            next_restart = iteration + 12
            now = try_velocity(step, _restart(step, restarts))
            count[0] += 1
            stale, fresh, secant = True, False, 0
        if shortened == 0:
            by_secant = secant > 0
            if by_secant:
                differentiate(bodies, now.v, 1.0, completed)
                count[1] += 1
                secant -= 1
                direction = -dense.solve(_matrix(step, now.v, completed, True), now.residual)
            else:
                if not fresh and (stale or not known):
                    differentiate(bodies, now.v, 0.0, g)
                    count[1] += 1
                    known, fresh, stale = True, True, False
                direction = -dense.solve(_matrix(step, now.v, g, True), now.residual)
            t = 1.0
        new = try_velocity(step, now.v + t * direction)
        count[0] += 1
        if new.error < best.error:
            best = new
        if new.error > loose:
            before, after = dense.dot(now.residual, direction), dense.dot(new.residual, direction)
            crossing = -before / (after - before) if after > 0.0 and before < 0.0 else 0.5
            if not by_secant and not (new.size < 0.9 * now.size and after <= 0.2 * abs(before)):
                if not fresh:
                    stale, shortened = True, 0
                elif now.size < 0.1 * now.scale and shortened < 2:  # a face changes its side along the way
                    t *= min(max(crossing, 0.1), 0.7)
                    shortened += 1
                else:  # the exact derivative overshot rest
                    failures += 1
                    secant, shortened = min(2 * failures, 8), 0
                continue
            if by_secant and after > 0.3 * abs(before) and new.size > 0.7 * now.size and shortened < 3:
                t *= min(max(crossing, 0.1), 0.7)
                shortened += 1
                continue
        shortened = 0
        if by_secant:
            stale = True
        else:
            stale = new.size > 0.3 * now.size
            _update(bodies, now, new, g)
        fresh = False
        now = new
    return best, known, best.error <= LOOSEST or best.size <= 1e-2 * best.scale
