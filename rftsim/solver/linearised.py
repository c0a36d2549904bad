"""The equation with the sand's force linearised: a convex problem in the constraints, which is solved exactly."""

from typing import Final

from rftsim.law.layout import WRENCH
from rftsim.law.stress import TINY
from rftsim.machine import lanes
from rftsim.machine.compiling import exact, fast
from rftsim.machine.memory import peek, poke
from rftsim.solver import constraint_rows, equation, linear_algebra, matrices

NONE: Final = 0
EXACT: Final = 1
TOLD: Final = 2
"""Which derivative of the sand's force the linearised equation takes; TOLD: of hard bodies that in `equation.slope`."""
ITERATIONS: Final = 20
"""Steps of Newton's method on the rows, and trials of one step's length, at most."""
EXACTNESS: Final = (1e-16, 1e-4, 1e-4)
"""Square of the share of the missing impulse that may be left, by which derivative is taken."""


@exact
def _derivative(p, which, b):
    if which == TOLD and equation.is_hard(p)[b] > 0.0:
        return equation.slope(p, b)
    return equation.derivative(p, b)


@exact
def _is_zero(g):
    """Whether a derivative is zero: that of a body above the sand."""
    for i in range(WRENCH):
        for k in range(WRENCH):
            if g[i, k] != 0.0:
                return False
    return True


@fast
def _add_derivative(p, b, g, a):
    """Add -h J' G J to a matrix, G the derivative of body b's wrench by its twist."""
    path, n, ndof = equation.path(p, b), equation.path_length(p)[b], equation.head(p).ndof
    width, power = lanes.padded(n), equation.power(p)
    twists, wrenches = equation.twists(p), equation.wrenches(p)
    _turn(p, b, n, width, twists)
    for r in range(WRENCH):
        lanes.combine_six(g[r], twists, width, wrenches[r * width : (r + 1) * width])
    for i in range(n):
        lanes.combine_six(equation.motion(p, b, i), wrenches, width, power)
        row = ndof * peek(path, i)
        for k in range(n):
            at = row + peek(path, k)
            poke(a, at, peek(a, at) + peek(power, k))


@fast
def _turn(p, b, n, width, out):
    """Fill out with -h J of body b: six rows of a width, zero behind its n degrees of freedom."""
    h = equation.numbers(p).h
    for k in range(n):
        m = equation.motion(p, b, k)
        for r in range(WRENCH):
            poke(out, r * width + k, -h * m[r])
    for k in range(n, width):
        for r in range(WRENCH):
            poke(out, r * width + k, 0.0)


@exact
def _linearise(p, which):
    """Fill `equation.linear` with M - h J' G J, G the sand's derivatives, unless it is that; with M for NONE."""
    a, numbers = equation.linear(p), equation.numbers(p)
    if which == EXACT and numbers.is_linearised > 0.0:
        return
    numbers.is_linearised, numbers.is_factored = 1.0 if which == EXACT else 0.0, 0.0
    matrices.copy(p, equation.mass(p), a)
    if which == NONE:
        return
    for b in range(equation.head(p).nbody):
        g = _derivative(p, which, b)
        if equation.kept(p, b).known > 0.0 and not _is_zero(g):
            _add_derivative(p, b, g, a)


@exact
def _factor(p, x, force, is_changed):
    """Factor the matrix of the linearised equation, with the rows' stiffness at x, and whether that is another.

    Where there are rows and drag, rows see another velocity change, M^-1 M_h (v+ - v). Of that the matrix is where rows
    act that are stiffer than the sand; the sand's share is then approximate, by a diagonal of what leads back. Else it
    is that of v+ - v itself, and the share of the friction rows is approximate.
    """
    a, linear, stiff = equation.linear_factors(p), equation.linear(p), equation.stiff_mass(p)
    share, numbers = equation.late_share(p), equation.numbers(p)
    numbers.is_factored = numbers.is_direct = 1.0
    if equation.head(p).nrow == 0:
        matrices.copy(p, linear, a)
        matrices.factor(p, a)
        return
    if is_changed or numbers.is_stiff == 0.0:
        matrices.copy(p, equation.plain_mass(p), stiff)
        constraint_rows.add_stiffness(p, x, force, stiff)
        numbers.is_stiff = 1.0
    for k in range(share.size):
        drag = max(equation.drag(p)[(share.size + 1) * k], 0.0)
        share[k] = 1.0 + numbers.h * drag * equation.lightness(p)[k]
    if constraint_rows.do_hold(p):
        numbers.is_direct = 0.0
        for k in range(share.size):
            share[k] = 1.0 / share[k]
        matrices.copy(p, stiff, a)
        matrices.add_difference(p, linear, equation.mass(p), share, a)
    else:
        matrices.copy(p, linear, a)
        matrices.add_difference(p, stiff, equation.plain_mass(p), share, a)
    matrices.factor(p, a)


@exact
def substitute(p, impulse, seen, out):
    """Fill out with the velocity change by an impulse, by the last factors, and seen with the one that rows see."""
    if equation.numbers(p).is_direct > 0.0:
        matrices.substitute(p, equation.linear_factors(p), impulse, out)
        constraint_rows.see(p, out, seen)
        return
    matrices.substitute(p, equation.linear_factors(p), impulse, seen)
    if equation.numbers(p).dragged == 0.0:
        linear_algebra.copy(seen, out)
        return
    slowed = equation.slowed(p)
    matrices.multiply(p, equation.plain_mass(p), seen, slowed)
    matrices.substitute(p, equation.mass_factors(p), slowed, out)


@exact
def solution(p, v, errors, residual, which, out):
    """Fill out with the velocity that solves the equation for the sand's force linearised at v, the rows exactly.

    `errors` are the rows' J a - aref at v, (nrow,), and `equation.row_error` is left with those at the solution.
    """
    _linearise(p, which)
    if equation.head(p).nrow > 0:
        _solve_with_rows(p, v, errors, residual, which, out)
        return
    direction, nothing = equation.direction(p), equation.missing(p)
    if equation.numbers(p).is_factored == 0.0:
        _factor(p, nothing, nothing, False)
    matrices.substitute(p, equation.linear_factors(p), residual, direction)
    for k in range(v.size):
        out[k] = v[k] - direction[k]


@exact
def _begin_with_rows(p, v, errors, residual, out):
    """Take the linearised equation to v: fill out, the rows' x and forces, and what is missing but for the rows."""
    h, fixed, missing = equation.numbers(p).h, equation.fixed(p), equation.missing(p)
    x, force = equation.row_error(p), equation.row_force(p)
    for k in range(v.size):
        out[k] = v[k]
        fixed[k] = residual[k]
        missing[k] = residual[k]
    linear_algebra.copy(errors, x)
    constraint_rows.forces(p, x, force)
    constraint_rows.add_forces(p, force, h, fixed)


@exact
def _solve_with_rows(p, v, errors, residual, which, out):
    """Newton's method on the rows, each step to where the missing impulse along it vanishes."""
    _begin_with_rows(p, v, errors, residual, out)
    h = equation.numbers(p).h
    x, force, moved = equation.row_error(p), equation.row_force(p), equation.row_moved(p)
    change, fixed, missing = equation.change(p), equation.fixed(p), equation.missing(p)
    direction, taken, numbers = equation.direction(p), equation.taken(p), equation.numbers(p)
    target = EXACTNESS[which] * (linear_algebra.dot(residual, residual) + TINY)
    for _ in range(ITERATIONS):
        is_changed = constraint_rows.note_zones(p, x)
        if is_changed or numbers.is_factored == 0.0:
            _factor(p, x, force, is_changed)
        _fill_direction(p)
        matrices.multiply(p, equation.linear(p), taken, change)
        stiff, slope = linear_algebra.dot(direction, change), linear_algebra.dot(direction, fixed)
        for i in range(moved.size):
            moved[i] = constraint_rows.product(p, i, direction)
        t = _crossing(p, slope, stiff)
        for k in range(out.size):
            out[k] += t * taken[k]
            fixed[k] += t * change[k]
            missing[k] = fixed[k]
        linear_algebra.copy(equation.row_tried(p), x)
        constraint_rows.add_forces(p, force, -h, missing)
        if linear_algebra.dot(missing, missing) <= target:
            break


@exact
def _fill_direction(p):
    """Fill `direction`, as the rows see it, with a step that makes up for the missing impulse; and `taken` by it."""
    direction, taken = equation.direction(p), equation.taken(p)
    substitute(p, equation.missing(p), direction, taken)
    for k in range(direction.size):
        direction[k], taken[k] = -direction[k], -taken[k]


@exact
def _along(p, slope, stiff, t):
    """Missing impulse along `equation.direction` after a share t of it; slope and stiff are what is not the rows'.

    The rows' errors and forces there are left in `row_tried` and `row_force`.
    """
    x, moved, tried, force = equation.row_error(p), equation.row_moved(p), equation.row_tried(p), equation.row_force(p)
    h, inverse = equation.numbers(p).h, 1.0 / equation.numbers(p).h
    for i in range(x.size):
        tried[i] = x[i] + t * inverse * moved[i]
    constraint_rows.forces(p, tried, force)
    return slope + t * stiff - h * linear_algebra.dot(force, moved)


@exact
def _crossing(p, slope, stiff):
    """The share t of `equation.direction`, at most one, after which the missing impulse along it vanishes.

    It is the last one that `_along` was asked for.
    """
    h, force, moved = equation.numbers(p).h, equation.row_force(p), equation.row_moved(p)
    low, at_low = 0.0, slope - h * linear_algebra.dot(force, moved)
    high, at_high = 1.0, _along(p, slope, stiff, 1.0)
    if at_high <= 1e-6 * abs(at_low) or at_low >= 0.0:
        return 1.0
    wanted, t = 1e-3 * abs(at_low), 1.0
    for _ in range(ITERATIONS):
        t = low - at_low * (high - low) / (at_high - at_low)
        margin = 0.05 * (high - low)
        t = min(max(t, low + margin), high - margin)
        found = _along(p, slope, stiff, t)
        if abs(found) < wanted:
            break
        if found < 0.0:
            low, at_low = t, found
        else:
            high, at_high = t, found
    return t
