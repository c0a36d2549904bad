"""The sand's force at the end of a time step: a velocity that the force it causes would lead to.

Resistive force knows the direction of motion and not the speed, so at rest it is a jump. Taken from the start of a step
it chatters and is biased; here v+ solves

    M (v+ - v) = h (tau + J' f(v+) + Q(v+)),

tau the other smooth forces, f the constraints' by MuJoCo's own law, Q the sand's with |v| / sqrt(|v|^2 + v_c^2) before
each triangle's stress. The solver is Newton's method with kept derivatives of the sand (a rank-one update per body and
iteration); each of its steps solves the constraints exactly for the sand's force linearised, which costs no evaluation.
Where a step passes rest or the edge of a face, the next trial is at rest, or by a derivative that cannot overshoot.

All twists and wrenches here are about the body's origin, in world axes: velocity or force first. `p` is the address of
the equation's table.
"""

from typing import Final

import numpy as np
from numba import njit

from rftsim.law.exports_ahead import ahead, jacobian, moving_frame
from rftsim.law.kernels import TINY
from rftsim.machine.memory import doubles, room
from rftsim.solver import constraint_rows, equation, linear_algebra
from rftsim.solver.equation import AT, PART, POINT, ROW, VECTOR
from rftsim.solver.linear_algebra import FASTMATH

V_C: Final = 3e-7
"""Least speed v_c [m/s] below which a triangle's stress falls to zero; where all is at rest, bodies creep slower."""
CREEP: Final = 1e-4
"""v_c over the speed of the fastest body. A body at rest amid moving ones, loaded to near what the sand bears, is the
hardest of all to solve for, and is so less often."""
TOLERANCE: Final = 3e-3
"""Allowed error of a sand body's velocity, relative; v_c is added."""
MOST: Final = 40
"""Iterations of one solution."""
LOOSEST: Final = 20.0
"""Factor to which the tolerance is loosened, from the sixth iteration on."""
CENTRED: Final = 3e-3
"""Effect of the force's change within a step on a body's velocity, relative, from which on it is counted."""
NOTHING: Final = AT.nbody
"""Instead of an entry of derivatives: none."""
NEAR: Final = 0.25
"""Square of the share of a body's speed that is left where a step is said to pass its rest."""
BESIDE: Final = 0.3
"""Speed, over v_c, at which a body is tried beside its rest."""


@njit
def twist_of(p, b, v, out):
    """Fill out with the twist of body b at a generalised velocity, (6,)."""
    linear_algebra.multiply(equation.body_jacobian(p, b), v, out)


@njit(fastmath=FASTMATH)
def speed_of(p, b, v, lengths=1.0):
    """|velocity| + |angular velocity| times so many lengths of body b, at a generalised velocity [m/s]."""
    j, length = equation.body_jacobian(p, b), equation.body_length(p, b)
    square, total = 0.0, 0.0
    for r in range(6):
        y = 0.0
        for k in range(v.size):
            y += j[r, k] * v[k]
        square += y * y
        if r == 2:
            total, square = np.sqrt(square), 0.0
    return total + lengths * length * np.sqrt(square)


@njit
def frame_at(p, b, twist):
    """The frame of body b that moves with a twist."""
    return moving_frame(equation.body_frame(p, b), equation.body_rotation(p, b), twist)


@njit
def generalised(p, at, later, out):
    """Fill out with the generalised force of the wrenches at a point, (nv,)."""
    for k in range(out.size):
        out[k] = 0.0
    for b in range(equation.number(p, AT.nbody)):
        linear_algebra.add_transposed(equation.body_jacobian(p, b), equation.point_wrench(p, at, b, later), 1.0, out)


@njit
def at_rest(p):
    """The speed v_c below which a triangle's stress falls to zero [m/s]."""
    return doubles(equation.number(p, AT.step), 3)[2]


@njit
def evaluate(p, v, at):
    """Evaluate the wrenches at a velocity into a point."""
    h, v_c = doubles(equation.number(p, AT.step), 2)[0], at_rest(p)
    twist = doubles(room(6), 6)
    sand = equation.number(p, AT.sand)
    for b in range(equation.number(p, AT.nbody)):
        twist_of(p, b, v, twist)
        f, r = equation.body_frame(p, b).ctypes.data, equation.body_rotation(p, b).ctypes.data
        out = equation.point_wrench(p, at, b, 0).ctypes.data
        ahead(sand, equation.body_surface(p, b), f, r, twist.ctypes.data, v_c, h, out)
    doubles(equation.number(p, AT.counts), 3)[0] += 1.0


@njit
def differentiate(p, v, entry):
    """Evaluate the derivative of each body's wrench by its twist, the exact or the completed one, into its entry."""
    twist = doubles(room(6), 6)
    sand = equation.number(p, AT.sand)
    completed = 1.0 if entry == AT.completed else 0.0
    for b in range(equation.number(p, AT.nbody)):
        twist_of(p, b, v, twist)
        f, r = equation.body_frame(p, b).ctypes.data, equation.body_rotation(p, b).ctypes.data
        out = equation.derivative(p, entry, b).ctypes.data
        jacobian(sand, equation.body_surface(p, b), f, r, twist.ctypes.data, at_rest(p), completed, out)
    doubles(equation.number(p, AT.counts), 3)[1] += 1.0


@njit
def residual_of(p, v, q, out):
    """Fill out with the impulse that is missing at a velocity under a generalised force of the sand, (nv,).

    Returns:
        Size of the impulse of the constraints.
    """
    h = doubles(equation.number(p, AT.step), 2)[0]
    start, tau, change = equation.of_dofs(p, AT.start), equation.of_dofs(p, AT.force), equation.vector(p, VECTOR.change)
    for k in range(v.size):
        change[k] = v[k] - start[k]
    linear_algebra.multiply(equation.square(p, AT.mass), change, out)
    for k in range(v.size):
        out[k] -= h * (tau[k] + q[k])
    if equation.number(p, AT.nrow) == 0:
        return 0.0
    x, force = constraint_rows.row_scratch(p, ROW.x), constraint_rows.row_scratch(p, ROW.force)
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    for k in range(v.size):
        change[k] = 0.0
    linear_algebra.add_transposed(equation.rows_by_dofs(p, AT.row_jacobian), force, -h, change)
    for k in range(v.size):
        out[k] += change[k]
    return size(p, change)


@njit
def size(p, impulse):
    """Length of an impulse in the mass metric; not of scratch vector 1."""
    solved = equation.vector(p, VECTOR.solved)
    linear_algebra.substitute(equation.square(p, AT.mass_factors), equation.order(p, AT.mass_order), impulse, solved)
    return np.sqrt(max(linear_algebra.dot(impulse, solved), 0.0))


@njit
def attempt(p, k):
    """Evaluate the equation at the velocity of point k."""
    at = equation.point(p, k)
    v, residual = equation.point_vector(p, at, PART.velocity), equation.point_vector(p, at, PART.residual)
    evaluate(p, v, at)
    q, step = equation.vector(p, VECTOR.sand), doubles(equation.number(p, AT.step), 2)
    generalised(p, at, 0, q)
    scale = residual_of(p, v, q, residual) + step[0] * size(p, q) + step[1]
    wrong, error = equation.vector(p, VECTOR.solved), 0.0
    missing = size(p, residual)  # leaves the velocity error in scratch vector 1
    for b in range(equation.number(p, AT.nbody)):
        error = max(error, speed_of(p, b, wrong) / (TOLERANCE * speed_of(p, b, v) + at_rest(p)))
    scores = equation.point_scores(p, at)
    scores[0], scores[1], scores[2] = missing, scale + TINY, error


@njit
def copy_point(p, origin, target):
    """Copy a point."""
    n = equation.point_size(equation.number(p, AT.nbody), equation.number(p, AT.nv))
    linear_algebra.copy(doubles(equation.point(p, origin), n), doubles(equation.point(p, target), n))


@njit
def _linearise(p, entry):
    """Fill scratch matrix 0 with M - h J' G J, G the derivatives in an entry; with M for NOTHING."""
    h = doubles(equation.number(p, AT.step), 2)[0]
    a, mass = equation.scratch(p, 0), equation.square(p, AT.mass)
    nv = a.shape[0]
    for i in range(nv):
        for k in range(nv):
            a[i, k] = mass[i, k]
    if entry == NOTHING:
        return
    column = equation.vector(p, VECTOR.change)
    for b in range(equation.number(p, AT.nbody)):
        j, g = equation.body_jacobian(p, b), equation.derivative(p, entry, b)
        for r in range(6):
            any_force = False
            for c in range(6):
                any_force = any_force or g[r, c] != 0.0
            if not any_force:
                continue
            for k in range(nv):
                column[k] = 0.0
            for c in range(6):
                y = -h * g[r, c]
                for k in range(nv):
                    column[k] += y * j[c, k]
            for i in range(nv):
                y = j[r, i]
                if y != 0.0:
                    for k in range(nv):
                        a[i, k] += y * column[k]


@njit
def _factor_with_rows(p, x, force):
    """Fill scratch matrix 1 with the factors of scratch matrix 0 and the rows' stiffness at x."""
    base, a = equation.scratch(p, 0), equation.scratch(p, 1)
    for i in range(a.shape[0]):
        for k in range(a.shape[0]):
            a[i, k] = base[i, k]
    if equation.number(p, AT.nrow) > 0:
        constraint_rows.add_stiffness(p, x, force, a)
    linear_algebra.factor(a, equation.order(p, AT.order))


@njit
def linear_solution(p, v, residual, entry, out):
    """Fill out with the velocity that solves the equation for the sand's force linearised at v, the rows exactly.

    Newton's method on the rows, each step to where the missing impulse along it vanishes: a convex problem.
    """
    _linearise(p, entry)
    lu, order = equation.scratch(p, 1), equation.order(p, AT.order)
    direction, missing = equation.vector(p, VECTOR.direction), equation.vector(p, VECTOR.missing)
    if equation.number(p, AT.nrow) == 0:
        _factor_with_rows(p, missing, missing)
        linear_algebra.substitute(lu, order, residual, direction)
        for k in range(v.size):
            out[k] = v[k] - direction[k]
        return
    h = doubles(equation.number(p, AT.step), 2)[0]
    base, start = equation.scratch(p, 0), equation.of_dofs(p, AT.start)
    j = equation.rows_by_dofs(p, AT.row_jacobian)
    x, force, moved, tried = (
        constraint_rows.row_scratch(p, ROW.x),
        constraint_rows.row_scratch(p, ROW.force),
        constraint_rows.row_scratch(p, ROW.moved),
        constraint_rows.row_scratch(p, ROW.tried),
    )
    change, fixed = equation.vector(p, VECTOR.change), equation.vector(p, VECTOR.fixed)
    for k in range(v.size):
        change[k] = v[k] - start[k]
        out[k] = v[k]
        fixed[k] = residual[k]
        missing[k] = residual[k]
    constraint_rows.accelerations(p, change, x)
    constraint_rows.forces(p, x, force)
    linear_algebra.add_transposed(j, force, h, fixed)  # the residual at v but for the rows
    target = 1e-16 * (linear_algebra.dot(residual, residual) + TINY)
    for _ in range(20):
        _factor_with_rows(p, x, force)
        linear_algebra.substitute(lu, order, missing, direction)
        for k in range(v.size):
            direction[k] = -direction[k]
        linear_algebra.multiply(base, direction, change)
        stiff, slope = linear_algebra.dot(direction, change), linear_algebra.dot(direction, fixed)
        linear_algebra.multiply(equation.rows_by_dofs(p, AT.row_acceleration), direction, moved)
        for i in range(moved.size):
            moved[i] /= h
        t = _crossing(p, j, direction, x, moved, tried, force, slope, stiff, h)
        for k in range(v.size):
            out[k] += t * direction[k]
            fixed[k] += t * change[k]
            missing[k] = fixed[k]
        for i in range(x.size):
            x[i] += t * moved[i]
        constraint_rows.forces(p, x, force)
        linear_algebra.add_transposed(j, force, -h, missing)
        if linear_algebra.dot(missing, missing) <= target:
            break


@njit
def _along(p, j, direction, x, moved, tried, force, slope, stiff, h, t):
    """Missing impulse along a direction after a share t of it."""
    for i in range(x.size):
        tried[i] = x[i] + t * moved[i]
    constraint_rows.forces(p, tried, force)
    total = slope + t * stiff
    for i in range(x.size):
        if force[i] != 0.0:
            total -= h * force[i] * linear_algebra.dot(j[i], direction)
    return total


@njit
def _crossing(p, j, direction, x, moved, tried, force, slope, stiff, h):
    """The share t of a direction, at most one, after which the missing impulse along it vanishes."""
    low, at_low = 0.0, _along(p, j, direction, x, moved, tried, force, slope, stiff, h, 0.0)
    high, at_high = 1.0, _along(p, j, direction, x, moved, tried, force, slope, stiff, h, 1.0)
    if at_high <= 1e-6 * abs(at_low) or at_low >= 0.0:
        return 1.0
    wanted, t = 1e-3 * abs(at_low), 1.0
    for _ in range(20):
        t = low - at_low * (high - low) / (at_high - at_low)
        margin = 0.05 * (high - low)
        t = min(max(t, low + margin), high - margin)
        found = _along(p, j, direction, x, moved, tried, force, slope, stiff, h, t)
        if abs(found) < wanted:
            break
        if found < 0.0:
            low, at_low = t, found
        else:
            high, at_high = t, found
    return t


@njit
def _update(p, old, new):
    """Broyden's rank-one update of each body's derivative from two points."""
    moved, twist = doubles(room(6), 6), doubles(room(6), 6)
    v = equation.point_vector(p, equation.point(p, old), PART.velocity)
    u = equation.point_vector(p, equation.point(p, new), PART.velocity)
    for b in range(equation.number(p, AT.nbody)):
        twist_of(p, b, u, moved)
        twist_of(p, b, v, twist)
        length, square = equation.body_length(p, b), 0.0
        for r in range(6):
            moved[r] -= twist[r]
            square += (1.0 if r < 3 else length * length) * moved[r] * moved[r]
        if square <= 0.0:
            continue
        g = equation.derivative(p, AT.derivative, b)
        before = equation.point_wrench(p, equation.point(p, old), b, 0)
        after = equation.point_wrench(p, equation.point(p, new), b, 0)
        for r in range(6):
            y = after[r] - before[r]
            for k in range(6):
                y -= g[r, k] * moved[k]
            y /= square
            for k in range(6):
                g[r, k] += y * (1.0 if k < 3 else length * length) * moved[k]


@njit
def _rest_along(p, direction, share):
    """Share of a direction from point POINT.now on at which a body is beside its rest; 0 where none comes near.

    Before its rest where the sand must push the body on, behind it where the sand must hold it back.
    """
    at = equation.point(p, POINT.now)
    v = equation.point_vector(p, at, PART.velocity)
    a, c = doubles(room(6), 6), doubles(room(6), 6)
    there, q = equation.vector(p, VECTOR.sand), equation.vector(p, VECTOR.missing)
    found = 0.0
    for b in range(equation.number(p, AT.nbody)):
        twist_of(p, b, v, a)
        twist_of(p, b, direction, c)
        aa = ac = cc = 0.0
        for k in range(6):
            weight = 1.0 if k < 3 else equation.body_length(p, b) ** 2
            c[k] *= share
            aa += weight * a[k] * a[k]
            ac += weight * a[k] * c[k]
            cc += weight * c[k] * c[k]
        if cc == 0.0 or ac >= 0.0 or -ac >= cc or aa < (10.0 * at_rest(p)) ** 2 or aa - ac * ac / cc > NEAR * aa:
            continue
        t = -ac / cc
        if found > 0.0 and t >= found:
            continue
        for k in range(v.size):
            there[k] = v[k] + t * share * direction[k]
        generalised(p, at, 0, q)
        linear_algebra.add_transposed(equation.body_jacobian(p, b), equation.point_wrench(p, at, b, 0), -1.0, q)
        missing = equation.vector(p, VECTOR.fixed)
        residual_of(p, there, q, missing)
        side = 1.0 if linear_algebra.dot(missing, direction) < 0.0 else -1.0
        found = max(t + side * BESIDE * at_rest(p) / np.sqrt(cc), 1e-12)
    return found * share


@njit
def _try_along(p, direction, t, k):
    """Evaluate the equation a share t of a direction from point POINT.now on, into point k."""
    v = equation.point_vector(p, equation.point(p, POINT.now), PART.velocity)
    new = equation.point_vector(p, equation.point(p, k), PART.velocity)
    for i in range(new.size):
        new[i] = v[i] + t * direction[i]
    attempt(p, k)


@njit
def _is_small(p, change, v, share):
    """Whether a share of a velocity change makes no difference to any body."""
    for b in range(equation.number(p, AT.nbody)):
        if share * speed_of(p, b, change) > CENTRED * speed_of(p, b, v) + 10.0 * at_rest(p):
            return False
    return True


@njit
def centre(p):
    """Fill END: one step of Newton's method from the best point, without an evaluation.

    It is corrected to first order for the force at the step's mean velocity instead of its end. What is stiff against
    the mass is left out of that, by M A^-1: a body that stops in the step stays stopped.
    """
    at, known = equation.point(p, POINT.best), doubles(equation.number(p, AT.flags), 2)[0] > 0.0
    v, start = equation.point_vector(p, at, PART.velocity), equation.of_dofs(p, AT.start)
    end, residual = equation.of_dofs(p, AT.end), equation.point_vector(p, at, PART.residual)
    mean, difference = equation.vector(p, VECTOR.mean), equation.vector(p, VECTOR.difference)
    solved = equation.vector(p, VECTOR.filtered)
    linear_algebra.copy(v, end)
    for k in range(v.size):
        mean[k] = v[k] - start[k]
    is_small = not known or _is_small(p, mean, v, 0.5)
    scores = equation.point_scores(p, at)
    if is_small and scores[0] < 1e-4 * scores[1]:
        return
    linear_solution(p, v, residual, AT.derivative if known else NOTHING, end)
    if is_small:
        return
    h = doubles(equation.number(p, AT.step), 2)[0]
    twist, wrench = doubles(room(6), 6), doubles(room(6), 6)
    for k in range(v.size):
        difference[k] = 0.0
    for b in range(equation.number(p, AT.nbody)):
        twist_of(p, b, mean, twist)
        linear_algebra.multiply(equation.derivative(p, AT.derivative, b), twist, wrench)
        linear_algebra.add_transposed(equation.body_jacobian(p, b), wrench, -0.5 * h, difference)
    _filter(p, difference, solved)
    if _is_small(p, solved, v, 1.0):
        return
    linear_algebra.multiply(equation.square(p, AT.mass), mean, difference)
    largest = 0.25 * linear_algebra.dot(mean, difference)
    for k in range(v.size):
        mean[k] = 0.5 * (start[k] + v[k])
    spare = equation.point(p, POINT.spare)
    evaluate(p, mean, spare)
    generalised(p, spare, 0, difference)
    generalised(p, at, 0, mean)
    for k in range(v.size):
        difference[k] = h * (difference[k] - mean[k])
    _filter(p, difference, solved)
    linear_algebra.multiply(equation.square(p, AT.mass), solved, difference)
    if linear_algebra.dot(solved, difference) <= largest:  # else the derivative is not to be trusted
        for k in range(v.size):
            end[k] += solved[k]


@njit
def _filter(p, impulse, out):
    """Fill out with A^-1 M A^-1 impulse, A the matrix that `linear_solution` left factored."""
    lu, order, between = equation.scratch(p, 1), equation.order(p, AT.order), equation.vector(p, VECTOR.solved)
    linear_algebra.substitute(lu, order, impulse, out)
    linear_algebra.multiply(equation.square(p, AT.mass), out, between)
    linear_algebra.substitute(lu, order, between, out)


@njit
def solve(p):
    """Solve the equation: fill AT.end and AT.flags, leave the velocity and its wrenches in point POINT.best."""
    flags = doubles(equation.number(p, AT.flags), 2)
    known = flags[0] > 0.0
    step, last = doubles(equation.number(p, AT.step), 3), equation.of_dofs(p, AT.last)
    step[1], step[2] = step[0] * size(p, equation.of_dofs(p, AT.force)), V_C
    for b in range(equation.number(p, AT.nbody)):
        step[2] = max(step[2], CREEP * speed_of(p, b, equation.of_dofs(p, AT.start)))
    now = equation.point_scores(p, equation.point(p, POINT.now))
    new = equation.point_scores(p, equation.point(p, POINT.new))
    best = equation.point_scores(p, equation.point(p, POINT.best))
    v = equation.point_vector(p, equation.point(p, POINT.now), PART.velocity)
    residual = equation.point_vector(p, equation.point(p, POINT.now), PART.residual)
    new_residual = equation.point_vector(p, equation.point(p, POINT.new), PART.residual)
    direction = equation.vector(p, VECTOR.mean)
    residual_of(p, last, equation.of_dofs(p, AT.foreseen), residual)
    linear_solution(p, last, residual, AT.derivative if known else NOTHING, v)
    attempt(p, POINT.now)
    stale = fresh = by_secant = False
    if now[2] > 1.0 and now[0] > 0.3 * now[1]:  # a poor guess: is the last velocity nearer?
        linear_algebra.copy(last, equation.point_vector(p, equation.point(p, POINT.new), PART.velocity))
        attempt(p, POINT.new)
        if new[0] < now[0]:
            copy_point(p, POINT.new, POINT.now)
            stale = True
    copy_point(p, POINT.now, POINT.best)
    secant = shortened = failures = iteration = 0
    loose, t = 1.0, 1.0
    while best[2] > loose and iteration < MOST:
        iteration += 1
        if iteration > 6:
            loose = min(1.5 * loose, LOOSEST)
        if iteration > 10 and best[0] < 5e-3 * best[1]:  # a face on its edge: no closer solution exists
            break
        if shortened == 0:
            by_secant = secant > 0
            if by_secant:
                differentiate(p, v, AT.completed)
                secant -= 1
            elif not fresh and (stale or not known):
                differentiate(p, v, AT.derivative)
                known, fresh, stale = True, True, False
            linear_solution(p, v, residual, AT.completed if by_secant else AT.derivative, direction)
            for k in range(v.size):
                direction[k] -= v[k]
            t = 1.0
        _try_along(p, direction, t, POINT.new)
        if new[2] < best[2]:
            copy_point(p, POINT.new, POINT.best)
        if new[2] > loose:
            before, after = linear_algebra.dot(residual, direction), linear_algebra.dot(new_residual, direction)
            crossing = -before / (after - before) if after > 0.0 and before < 0.0 else 0.5
            if not by_secant and not (new[0] < 0.9 * now[0] and after <= 0.2 * abs(before)):
                if not fresh:
                    stale, shortened = True, 0
                    continue
                rest = _rest_along(p, direction, t) if shortened == 0 else 0.0
                if rest > 0.0:
                    _try_along(p, direction, rest, POINT.new)
                    copy_point(p, POINT.new, POINT.now)
                    if now[2] < best[2]:
                        copy_point(p, POINT.now, POINT.best)
                    stale, fresh, shortened = True, False, 0
                elif now[0] < 0.5 * now[1] and shortened < 2:  # a face changes its side along the way
                    t *= min(max(crossing, 0.1), 0.7)
                    shortened += 1
                else:
                    failures += 1
                    secant, shortened = min(2 * failures, 8), 0
                continue
            if by_secant and after > 0.3 * abs(before) and new[0] > 0.7 * now[0] and shortened < 3:
                t *= min(max(crossing, 0.1), 0.7)
                shortened += 1
                continue
        shortened = 0
        if by_secant:
            stale = True
        else:
            stale = new[0] > 0.3 * now[0]
            _update(p, POINT.now, POINT.new)
        fresh = False
        copy_point(p, POINT.new, POINT.now)
    flags[0] = 1.0 if known else 0.0
    flags[1] = 1.0 if best[2] <= LOOSEST or best[0] <= 1e-2 * best[1] else 0.0
    centre(p)
