"""MuJoCo's constraint forces by MuJoCo's own law, as functions of the velocity at the end of a step.

A row's force is -D (J a - aref): always (equality), where it pushes (limit, frictionless and pyramidal contact), up to
a bound (friction), or within a cone over all rows of a contact (elliptic contact).
"""

from typing import Final

import numpy as np

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import equation, linear_algebra, matrices
from rftsim.solver.equation import KIND

FREE: Final = 0
STICKING: Final = 1
SLIDING: Final = 2
"""Zones of an elliptic contact."""


@exact
def product(p, i, v):
    """The velocity of row i at a generalised one."""
    path, j, total = equation.row_path(p, i), equation.row_jacobian(p, i), 0.0
    for k in range(equation.row_length(p)[i]):
        total += j[k] * v[path[k]]
    return total


@exact
def see(p, change, out):
    """Fill out with M^-1 M_h of a velocity change: the change that MuJoCo's solver of the constraints sees."""
    if equation.head(p).nrow == 0 or equation.numbers(p).dragged == 0.0:
        linear_algebra.copy(change, out)
        return
    h, dragged = equation.numbers(p).h, equation.slowed(p)
    matrices.multiply(p, equation.drag(p), change, dragged)
    matrices.substitute(p, equation.plain_factors(p), dragged, out)
    for k in range(out.size):
        out[k] = change[k] + h * out[k]


@exact
def accelerations(p, change, out):
    """Fill out with J a - aref at a velocity change v+ - v, (nrow,)."""
    seen, inverse, reference = equation.seen(p), 1.0 / equation.numbers(p).h, equation.row_reference(p)
    see(p, change, seen)
    for i in range(out.size):
        out[i] = inverse * product(p, i, seen) - reference[i]


@exact
def errors_at(p, v, out):
    """Fill out with J a - aref at a velocity at the end of the step, (nrow,)."""
    start, change = equation.start(p), equation.change(p)
    if out.size == 0:
        return
    for k in range(v.size):
        change[k] = v[k] - start[k]
    accelerations(p, change, out)


@exact
def errors_at_start(p, out):
    """Fill out with J a - aref where the velocity does not change, (nrow,)."""
    reference = equation.row_reference(p)
    for i in range(out.size):
        out[i] = -reference[i]


@exact
def add_forces(p, force, share, out):
    """Add a share of the rows' generalised force to out."""
    for i in range(force.size):
        y = share * force[i]
        if y != 0.0:
            path, j = equation.row_path(p, i), equation.row_jacobian(p, i)
            for k in range(equation.row_length(p)[i]):
                out[path[k]] += y * j[k]


@exact
def last_of_cone(kind, first):
    """The row behind the last one of an elliptic contact."""
    last = first + 1
    while last < kind.size and kind[last] == KIND.tangent:
        last += 1
    return last


@exact
def cone_forces(x, stiffness, scale, first, last, out):
    """Fill out with the forces of an elliptic contact.

    Returns:
        Its zone, FREE, STICKING or SLIDING; and, for sliding, normal and tangential size of the scaled x.
    """
    mu = scale[first]
    normal, square = x[first] * mu, 0.0
    for i in range(first + 1, last):
        square += (x[i] * scale[i]) ** 2
    tangential = np.sqrt(square)
    if normal >= mu * tangential or (tangential <= 0.0 and normal >= 0.0):
        for i in range(first, last):
            out[i] = 0.0
        return FREE, normal, tangential
    if mu * normal + tangential <= 0.0 or (tangential <= 0.0 and normal < 0.0):
        for i in range(first, last):
            out[i] = -stiffness[i] * x[i]
        return STICKING, normal, tangential
    d = stiffness[first] / (mu * mu * (1.0 + mu * mu)) * (normal - mu * tangential)
    out[first] = -d * mu
    for i in range(first + 1, last):
        out[i] = d * mu / tangential * x[i] * scale[i] * scale[i]
    return SLIDING, normal, tangential


@exact
def forces(p, x, out):
    """Fill out with each row's force at J a - aref = x, (nrow,)."""
    kind, stiffness, bound = equation.row_kind(p), equation.row_stiffness(p), equation.row_bound(p)
    i = np.int64(0)  # no constant, for which numba would compile what takes it anew
    while i < kind.size:
        if kind[i] == KIND.cone:
            last = last_of_cone(kind, i)
            cone_forces(x, stiffness, bound, i, last, out)
            i = last
            continue
        out[i] = -stiffness[i] * x[i]
        if (kind[i] == KIND.limit or kind[i] == KIND.contact) and x[i] >= 0.0:
            out[i] = 0.0
        if kind[i] == KIND.friction and abs(out[i]) > bound[i]:
            out[i] = bound[i] if out[i] > 0.0 else -bound[i]
        i += 1


@exact
def _stiffness_of(kind, stiffness, bound, x, force):
    """The stiffness of a row that is no cone's, where it acts."""
    if (kind == KIND.limit or kind == KIND.contact) and x >= 0.0:
        return 0.0
    if kind == KIND.friction and abs(force) >= bound:
        return 0.0
    return stiffness


@exact
def note_zones(p, x):
    """Note which rows act at x; whether any does otherwise than noted, or its stiffness changes as it slides."""
    kind, stiffness, bound = equation.row_kind(p), equation.row_stiffness(p), equation.row_bound(p)
    zone = equation.row_zone(p)
    changed, i = False, np.int64(0)
    while i < kind.size:
        last, now = i + 1, np.int64(STICKING)
        if kind[i] == KIND.cone:
            last = last_of_cone(kind, i)
            now = np.int64(cone_forces(x, stiffness, bound, i, last, equation.row_tried(p))[0])
        elif _stiffness_of(kind[i], stiffness[i], bound[i], x[i], stiffness[i] * x[i]) == 0.0:
            now = np.int64(FREE)
        changed = changed or zone[i] != now or now == SLIDING
        zone[i] = now
        i = last
    return changed


@exact
def do_hold(p):
    """Whether a row acts, as noted, that is no friction: what it holds it holds more stiffly than sand does."""
    kind, zone, found = equation.row_kind(p), equation.row_zone(p), False
    for i in range(kind.size):
        found = found or (kind[i] != KIND.friction and kind[i] != KIND.tangent and zone[i] != FREE)
    return found


@exact
def _add_product(p, r, k, share, a):
    """Add a share of the product of rows r and k to a matrix."""
    rows, columns, left, right = equation.row_path(p, r), equation.row_path(p, k), equation.row_jacobian(p, r), 0.0
    j, n = equation.row_jacobian(p, k), equation.head(p).ndof
    for m in range(equation.row_length(p)[k]):
        right = share * j[m]
        for i in range(equation.row_length(p)[r]):
            a[n * rows[i] + columns[m]] += left[i] * right


@exact
def _add_sliding(p, x, first, last, normal, tangential, a):
    """Add the stiffness of an elliptic contact that slides."""
    stiffness, bound = equation.row_stiffness(p), equation.row_bound(p)
    mu = bound[first]
    d = stiffness[first] / (mu * mu * (1.0 + mu * mu))
    turn = mu * (normal - mu * tangential) / (tangential + TINY)  # of the friction's direction; negative
    for r in range(first, last):
        ur = x[r] * bound[r] / (tangential + TINY)
        for k in range(first, last):
            uk = x[k] * bound[k] / (tangential + TINY)
            if r == first and k == first:
                share = d
            elif r == first:
                share = -d * mu * uk
            elif k == first:
                share = -d * mu * ur
            else:
                share = d * ((mu * mu + turn) * ur * uk - (turn if r == k else 0.0))
            _add_product(p, r, k, share * bound[r] * bound[k], a)


@exact
def add_stiffness(p, x, force, a):
    """Add J' H J to a matrix (ndof^2,), H the derivative of the rows' forces at x, sign reversed."""
    kind, stiffness, bound = equation.row_kind(p), equation.row_stiffness(p), equation.row_bound(p)
    i = np.int64(0)  # no constant, for which numba would compile what takes it anew
    while i < kind.size:
        if kind[i] != KIND.cone:
            active = _stiffness_of(kind[i], stiffness[i], bound[i], x[i], force[i])
            if active > 0.0:
                _add_product(p, i, i, active, a)
            i += 1
            continue
        last = last_of_cone(kind, i)
        zone, normal, tangential = cone_forces(x, stiffness, bound, i, last, force)
        if zone == STICKING:
            for k in range(i, last):
                _add_product(p, k, k, stiffness[k], a)
        elif zone == SLIDING:
            _add_sliding(p, x, i, last, normal, tangential, a)
        i = last
