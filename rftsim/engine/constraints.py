"""MuJoCo's constraint rows: which trees they join, and their numbers for an island's equation."""

from typing import Final

from rftsim.engine import external, islands
from rftsim.engine.layout import CONSTANTS
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int32s, matrix, pointer
from rftsim.solver import constraint_rows, equation, pattern
from rftsim.solver.equation import KIND

_K: Final = 0
_B: Final = 1
_I: Final = 2
"""Where MuJoCo's efc_KBIP holds a row's stiffness, damping and impedance."""
_KIND: Final = {
    "equality": KIND.equality,
    "dof_friction": KIND.friction,
    "tendon_friction": KIND.friction,
    "joint_limit": KIND.limit,
    "tendon_limit": KIND.limit,
    "frictionless_contact": KIND.contact,
    "pyramidal_contact": KIND.contact,
    "elliptic_contact": KIND.cone,
}
_KINDS: Final = tuple(_KIND[name] for name in sorted(_KIND, key=CONSTANTS.__getitem__))


@inline
def join_trees(model, data, m, d, i):
    """Join the trees that each row moves."""
    n, nv = islands.head(i).nrow, islands.head(i).nv
    tree, is_sparse = int32s(pointer(m + model.dof_treeid), nv), external.is_sparse(m) != 0
    island, j = islands.island_of_row(i), pointer(d + data.efc_J)
    number, start = int32s(pointer(d + data.efc_J_rownnz), n), int32s(pointer(d + data.efc_J_rowadr), n)
    for row in range(n):
        island[row] = islands.NONE
        if is_sparse:
            column = int32s(pointer(d + data.efc_J_colind) + 4 * start[row], number[row])
            for k in range(number[row]):
                _join(i, row, tree[column[k]])
        else:
            value = doubles(j + 8 * nv * row, nv)
            for dof in range(nv):
                if value[dof] != 0.0:
                    _join(i, row, tree[dof])


@inline
def _join(i, row, tree):
    """Join a tree to a row's others, of which the last is mostly the same."""
    if islands.island_of_row(i)[row] != tree:
        islands.add_to_row(i, row, tree)


@inline
def _fill_path(model, data, m, d, i, p, row, at):
    """Fill the degrees of freedom and the Jacobian of MuJoCo's row as the equation's row `at`."""
    n, nv, place = islands.head(i).nrow, islands.head(i).nv, islands.place_of(i)
    path, j, count = equation.row_path(p, at), equation.row_jacobian(p, at), 0
    if external.is_sparse(m) != 0:
        number, start = int32s(pointer(d + data.efc_J_rownnz), n), int32s(pointer(d + data.efc_J_rowadr), n)
        column = int32s(pointer(d + data.efc_J_colind) + 4 * start[row], number[row])
        value = doubles(pointer(d + data.efc_J) + 8 * start[row], number[row])
        for k in range(number[row]):
            path[k], j[k] = place[column[k]], value[k]
        count = int(number[row])
    else:
        value = doubles(pointer(d + data.efc_J) + 8 * nv * row, nv)
        for dof in range(nv):
            if value[dof] != 0.0:
                path[count], j[count] = place[dof], value[dof]
                count += 1
    equation.row_length(p)[at] = count


@exact
def _join_cone(p, first, last):
    """Give all rows of an elliptic contact the degrees of freedom that any of them has."""
    for row in range(first + 1, last):
        if equation.row_length(p)[row] > 0:
            _spread(p, row, first)
    for row in range(first + 1, last):
        _spread(p, first, row)


@exact
def _spread(p, origin, row):
    """Add the degrees of freedom of a row to another row, whose Jacobian by those is zero."""
    own, j, n = equation.row_path(p, row), equation.row_jacobian(p, row), equation.row_length(p)[row]
    more = equation.row_path(p, origin)
    for k in range(equation.row_length(p)[origin]):
        at = n
        while at > 0 and own[at - 1] > more[k]:
            at -= 1
        if at > 0 and own[at - 1] == more[k]:
            continue
        for m in range(n, at, -1):
            own[m], j[m] = own[m - 1], j[m - 1]
        own[at], j[at], n = more[k], 0.0, n + 1
    equation.row_length(p)[row] = n


@inline
def _fill_law(data, contact, d, p, row, at, inside):
    """Fill the kind, bound, damping, spring, stiffness and reference of MuJoCo's row as the equation's row `at`.

    `inside` counts the rows before this one in its elliptic contact.
    """
    n, kind, bound = row + 1, equation.row_kind(p), equation.row_bound(p)
    kbip = matrix(pointer(d + data.efc_KBIP), n, 4)
    kind[at] = _KINDS[int32s(pointer(d + data.efc_type), n)[row]]
    bound[at] = doubles(pointer(d + data.efc_frictionloss), n)[row]
    equation.row_damping(p)[at] = kbip[row, _B]
    equation.row_spring(p)[at] = kbip[row, _K] * kbip[row, _I]
    if kind[at] >= KIND.contact:  # a pyramid's rows mix gap and slip
        equation.row_spring(p)[at] = 0.0
    if kind[at] == KIND.cone:
        place = pointer(d + data.contact) + contact.size * int32s(pointer(d + data.efc_id), n)[row]
        if inside == 0:
            bound[at] = doubles(place + contact.mu, 1)[0]
        else:
            kind[at] = KIND.tangent
            bound[at] = doubles(place + contact.friction, 5)[inside - 1]
    equation.first_stiffness(p)[at] = doubles(pointer(d + data.efc_D), n)[row]
    equation.first_reference(p)[at] = doubles(pointer(d + data.efc_aref), n)[row]


@inline
def fill_rows(model, data, contact, m, d, i, island, p):
    """Fill the rows of an island's equation, and what they couple."""
    n, first = equation.head(p).nrow, islands.row_start(i)[island]
    if n == 0:
        return
    total = islands.head(i).nrow
    kinds, owner = int32s(pointer(d + data.efc_type), total), int32s(pointer(d + data.efc_id), total)
    inside, before = 0, islands.NONE
    for at in range(n):
        row = islands.rows(i)[first + at]
        follows = before != islands.NONE and kinds[before] == kinds[row] and owner[before] == owner[row]
        inside, before = inside + 1 if follows else 0, row
        _fill_path(model, data, m, d, i, p, row, at)
        _fill_law(data, contact, d, p, row, at, inside)
    at = 0
    while at < n:
        last = constraint_rows.last_of_cone(equation.row_kind(p), at)
        if last > at + 1:
            _join_cone(p, at, last)
        for row in range(at, last):
            path, length = equation.row_path(p, row), equation.row_length(p)[row]
            for k in range(length - 1, 0, -1):
                pattern.couple(p, path[k], path[k - 1])
        at = last
