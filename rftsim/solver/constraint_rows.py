"""MuJoCo's constraint forces by MuJoCo's own law, as functions of the velocity at the end of a step.

A row's force is -D (J a - aref): always (equality), where it pushes (limit, frictionless and pyramidal contact), up to
a bound (friction), or within a cone over all rows of a contact (elliptic contact).
"""

from typing import Final

import numpy as np

from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import equation, linear_algebra
from rftsim.solver.equation import KIND

FREE: Final = 0
STICKING: Final = 1
SLIDING: Final = 2
"""Zones of an elliptic contact."""


@exact
def accelerations(p, change, out):
    """Fill out with J a - aref at a velocity change v+ - v, (nrow,)."""
    linear_algebra.multiply(equation.row_acceleration(p), change, out)
    reference = equation.row_reference(p)
    h = equation.numbers(p).h
    for i in range(out.size):
        out[i] = out[i] / h - reference[i]


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
def _add_sliding(p, x, first, last, normal, tangential, a):
    """Add the stiffness of an elliptic contact that slides."""
    stiffness, bound = equation.row_stiffness(p), equation.row_bound(p)
    j, acceleration = equation.row_jacobian(p), equation.row_acceleration(p)
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
            linear_algebra.add_outer(a, j[r], acceleration[k], share * bound[r] * bound[k])


@exact
def add_stiffness(p, x, force, a):
    """Add J' H J M^-1 M_h to a matrix (nv, nv), H the derivative of the rows' forces at x, sign reversed."""
    kind, stiffness, bound = equation.row_kind(p), equation.row_stiffness(p), equation.row_bound(p)
    j, acceleration = equation.row_jacobian(p), equation.row_acceleration(p)
    i = np.int64(0)  # no constant, for which numba would compile what takes it anew
    while i < kind.size:
        if kind[i] != KIND.cone:
            active = _stiffness_of(kind[i], stiffness[i], bound[i], x[i], force[i])
            if active > 0.0:
                linear_algebra.add_outer(a, j[i], acceleration[i], active)
            i += 1
            continue
        last = last_of_cone(kind, i)
        zone, normal, tangential = cone_forces(x, stiffness, bound, i, last, force)
        if zone == STICKING:
            for k in range(i, last):
                linear_algebra.add_outer(a, j[k], acceleration[k], stiffness[k])
        elif zone == SLIDING:
            _add_sliding(p, x, i, last, normal, tangential, a)
        i = last
