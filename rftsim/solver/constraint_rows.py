"""MuJoCo's constraint forces by MuJoCo's own law, as functions of the velocity at the end of a step.

A row's force is -D (J a - aref): always (equality), where it pushes (limit, frictionless and pyramidal contact), up to
a bound (friction), or within a cone over all rows of a contact (elliptic contact).
"""

import numpy as np
from numba import njit

from rftsim.law.kernels import TINY
from rftsim.machine.memory import doubles, int64s
from rftsim.solver import equation, linear_algebra
from rftsim.solver.equation import AT, KIND


@njit
def row_scratch(p, k):
    """A scratch vector (nrow,)."""
    n = equation.number(p, AT.nrow)
    return doubles(equation.number(p, AT.row_scratch) + 8 * k * n, n)


@njit
def accelerations(p, change, out):
    """Fill out with J a - aref at a velocity change v+ - v, (nrow,)."""
    linear_algebra.multiply(equation.rows_by_dofs(p, AT.row_acceleration), change, out)
    reference = equation.of_rows(p, AT.row_reference)
    h = doubles(equation.number(p, AT.step), 2)[0]
    for i in range(out.size):
        out[i] = out[i] / h - reference[i]


@njit
def last_of_cone(kind, first):
    """The row behind the last one of an elliptic contact."""
    last = first + 1
    while last < kind.size and kind[last] == KIND.tangent:
        last += 1
    return last


@njit
def cone_forces(x, stiffness, scale, first, last, out):
    """Fill out with the forces of an elliptic contact.

    Returns:
        Its zone: 0 free, 1 sticking, 2 sliding; and, for sliding, normal and tangential size of the scaled x.
    """
    mu = scale[first]
    normal, square = x[first] * mu, 0.0
    for i in range(first + 1, last):
        square += (x[i] * scale[i]) ** 2
    tangential = np.sqrt(square)
    if normal >= mu * tangential or (tangential <= 0.0 and normal >= 0.0):
        for i in range(first, last):
            out[i] = 0.0
        return 0, normal, tangential
    if mu * normal + tangential <= 0.0 or (tangential <= 0.0 and normal < 0.0):
        for i in range(first, last):
            out[i] = -stiffness[i] * x[i]
        return 1, normal, tangential
    d = stiffness[first] / (mu * mu * (1.0 + mu * mu)) * (normal - mu * tangential)
    out[first] = -d * mu
    for i in range(first + 1, last):
        out[i] = d * mu / tangential * x[i] * scale[i] * scale[i]
    return 2, normal, tangential


@njit
def forces(p, x, out):
    """Fill out with each row's force at J a - aref = x, (nrow,)."""
    kind = int64s(equation.number(p, AT.row_kind), equation.number(p, AT.nrow))
    stiffness, bound = equation.of_rows(p, AT.row_stiffness), equation.of_rows(p, AT.row_bound)
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


@njit
def _add_product(a, left, right, share):
    for r in range(left.size):
        y = share * left[r]
        if y != 0.0:
            for k in range(right.size):
                a[r, k] += y * right[k]


@njit
def add_stiffness(p, x, force, a):
    """Add J' H J M^-1 M_h to a matrix (nv, nv), H the derivative of the rows' forces at x, sign reversed."""
    kind = int64s(equation.number(p, AT.row_kind), equation.number(p, AT.nrow))
    stiffness, bound = equation.of_rows(p, AT.row_stiffness), equation.of_rows(p, AT.row_bound)
    j, acceleration = (
        equation.rows_by_dofs(p, AT.row_jacobian),
        equation.rows_by_dofs(p, AT.row_acceleration),
    )
    i = np.int64(0)  # no constant, for which numba would compile what takes it anew
    while i < kind.size:
        if kind[i] != KIND.cone:
            active = stiffness[i]
            if (kind[i] == KIND.limit or kind[i] == KIND.contact) and x[i] >= 0.0:
                active = 0.0
            if kind[i] == KIND.friction and abs(force[i]) >= bound[i]:
                active = 0.0
            if active > 0.0:
                _add_product(a, j[i], acceleration[i], active)
            i += 1
            continue
        last = last_of_cone(kind, i)
        zone, normal, tangential = cone_forces(x, stiffness, bound, i, last, force)
        if zone == 1:
            for k in range(i, last):
                _add_product(a, j[k], acceleration[k], stiffness[k])
        elif zone == 2:
            mu = bound[i]
            d = stiffness[i] / (mu * mu * (1.0 + mu * mu))
            turn = mu * (normal - mu * tangential) / (tangential + TINY)  # of the friction's direction; negative
            for r in range(i, last):
                ur = x[r] * bound[r] / (tangential + TINY)
                for k in range(i, last):
                    uk = x[k] * bound[k] / (tangential + TINY)
                    if r == i and k == i:
                        share = d
                    elif r == i:
                        share = -d * mu * uk
                    elif k == i:
                        share = -d * mu * ur
                    else:
                        share = d * ((mu * mu + turn) * ur * uk - (turn if r == k else 0.0))
                    _add_product(a, j[r], acceleration[k], share * bound[r] * bound[k])
        i = last
