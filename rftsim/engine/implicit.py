"""The sand's force at the end of the step, from what MuJoCo knows when it computes passive forces.

At that moment the mass matrix and the constraints' Jacobians are current, and what drives the step is not: actuation,
bias and the constraints' reference are the last step's. They are computed here (MuJoCo does it again, the same).
"""

from typing import Final

from numba import njit

from rftsim.engine import block, bodies, external, instance
from rftsim.engine.layout import CONSTANTS
from rftsim.law import exports_ahead
from rftsim.machine.memory import doubles, int32s, int64s, pointer, release, room, take
from rftsim.solver import equation, linear_algebra, native_step
from rftsim.solver.equation import AT, ENTRIES, KIND, VECTOR

_UNDAMPED: Final = CONSTANTS["no_euler_damping"] | CONSTANTS["no_damping"]
_EULER: Final = CONSTANTS["euler"]
_IMPLICIT: Final = CONSTANTS["implicit"]
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


@njit(forceinline=True)
def _fill_mass(model, data, m, d, p):
    """The mass matrix, from its lower triangle in rows."""
    out = equation.square(p, AT.plain_mass)
    nv = out.shape[0]
    number = int32s(pointer(m + model.M_rownnz), nv)
    start = int32s(pointer(m + model.M_rowadr), nv)
    total = start[nv - 1] + number[nv - 1]
    column = int32s(pointer(m + model.M_colind), total)
    value = doubles(pointer(d + data.M), total)
    for i in range(nv):
        for k in range(nv):
            out[i, k] = 0.0
    for i in range(nv):
        for k in range(start[i], start[i] + number[i]):
            out[i, column[k]] = value[k]
            out[column[k], i] = value[k]


@njit(forceinline=True)
def _fill_drag(model, data, m, d, p):
    """What the integrator takes implicitly, over the time step; whether there is any."""
    out = equation.square(p, AT.drag)
    nv = out.shape[0]
    for i in range(nv):
        for k in range(nv):
            out[i, k] = 0.0
    integrator = int32s(m + model.opt_integrator, 1)[0]
    if integrator == _EULER:
        found = False
        if int32s(m + model.opt_disableflags, 1)[0] & _UNDAMPED == 0:
            damping = doubles(pointer(m + model.dof_damping), nv)
            for i in range(nv):
                out[i, i] = damping[i]
                found = found or damping[i] != 0.0
        return found
    external.smooth_vel(m, d, 1 if integrator == _IMPLICIT else 0)
    number = int32s(pointer(m + model.D_rownnz), nv)
    start = int32s(pointer(m + model.D_rowadr), nv)
    total = start[nv - 1] + number[nv - 1]
    column = int32s(pointer(m + model.D_colind), total)
    value = doubles(pointer(d + data.qDeriv), total)
    for i in range(nv):
        for k in range(start[i], start[i] + number[i]):
            j = column[k]
            if integrator == _IMPLICIT or j == i:
                out[i, j] = -value[k]
            elif j < i:  # implicitfast takes the lower triangle for both
                out[i, j] = out[j, i] = -value[k]
    return True


@njit(forceinline=True)
def _fill_force(model, data, m, d, t, p):
    """All smooth forces of this step but the sand's."""
    bias = pointer(d + data.qfrc_bias)
    external.rne(m, d, 0, bias)
    out = equation.of_dofs(p, AT.smooth_force)
    nv = out.size
    passive, actuator = doubles(pointer(d + data.qfrc_passive), nv), doubles(pointer(d + data.qfrc_actuator), nv)
    applied, weight = doubles(pointer(d + data.qfrc_applied), nv), doubles(bias, nv)
    for i in range(nv):
        out[i] = passive[i] + actuator[i] + applied[i] - weight[i]
    nbody = t.parent.size
    wrench, at = doubles(pointer(d + data.xfrc_applied), 6 * nbody), doubles(pointer(d + data.xipos), 3 * nbody)
    for body in range(1, nbody):
        f = wrench[6 * body : 6 * body + 6]
        any_force = False
        for k in range(6):
            any_force = any_force or f[k] != 0.0
        if any_force:
            x = at[3 * body : 3 * body + 3]
            bodies.add_wrench(t, body, x, (f[0], f[1], f[2]), (f[3], f[4], f[5]), out)


@njit(forceinline=True)
def _fill_rows(model, data, contact, m, d, p, dragged):
    """MuJoCo's constraint rows."""
    n, nv = equation.number(p, AT.nrow), equation.number(p, AT.nv)
    if n == 0:
        return
    external.reference_constraint(m, d)
    kind, bound = int64s(equation.number(p, AT.row_kind), n), equation.of_rows(p, AT.row_bound)
    damping, spring = equation.of_rows(p, AT.row_damping), equation.of_rows(p, AT.row_spring)
    kinds, owner = int32s(pointer(d + data.efc_type), n), int32s(pointer(d + data.efc_id), n)
    linear_algebra.copy(doubles(pointer(d + data.efc_D), n), equation.of_rows(p, AT.first_stiffness))
    linear_algebra.copy(doubles(pointer(d + data.efc_aref), n), equation.of_rows(p, AT.first_reference))
    loss, kbip = doubles(pointer(d + data.efc_frictionloss), n), doubles(pointer(d + data.efc_KBIP), 4 * n)
    jacobian = equation.rows_by_dofs(p, AT.row_jacobian)
    if external.is_sparse(m):
        for i in range(n):
            for k in range(nv):
                jacobian[i, k] = 0.0
        number = int32s(pointer(d + data.efc_J_rownnz), n)
        start = int32s(pointer(d + data.efc_J_rowadr), n)
        total = start[n - 1] + number[n - 1]
        column, value = int32s(pointer(d + data.efc_J_colind), total), doubles(pointer(d + data.efc_J), total)
        for i in range(n):
            for k in range(start[i], start[i] + number[i]):
                jacobian[i, column[k]] = value[k]
    else:
        value = doubles(pointer(d + data.efc_J), n * nv)
        for i in range(n):
            for k in range(nv):
                jacobian[i, k] = value[i * nv + k]
    inside = 0  # rows of the elliptic contact at hand
    for i in range(n):
        kind[i], bound[i] = _KINDS[kinds[i]], loss[i]
        damping[i], spring[i] = kbip[4 * i + 1], kbip[4 * i] * kbip[4 * i + 2]
        if kind[i] >= KIND.contact:  # a pyramid's rows mix gap and slip
            spring[i] = 0.0
        if kind[i] == KIND.cone:
            inside = inside + 1 if i > 0 and kinds[i - 1] == kinds[i] and owner[i - 1] == owner[i] else 0
            at = pointer(d + data.contact) + contact.size * owner[i]
            if inside == 0:
                bound[i] = doubles(at + contact.mu, 1)[0]
            else:
                kind[i] = KIND.tangent
                bound[i] = doubles(at + contact.friction, 5)[inside - 1]
    seen = equation.rows_by_dofs(p, AT.row_drag)
    if not dragged:
        for i in range(n):
            for k in range(nv):
                seen[i, k] = 0.0
        return
    lu, order = equation.square(p, AT.mass_factors), equation.order(p, AT.mass_order)
    linear_algebra.factor_of(equation.square(p, AT.plain_mass), lu, order)
    solved, drag = equation.vector(p, VECTOR.change), equation.square(p, AT.drag)
    for i in range(n):
        linear_algebra.substitute(lu, order, jacobian[i], solved)
        for k in range(nv):
            seen[i, k] = 0.0
        linear_algebra.add_transposed(drag, solved, 1.0, seen[i])


@njit(forceinline=True)
def _fill_bodies(model, m, t, table, p):
    """The bodies of the instance."""
    n, v, w = table[0], doubles(room(3), 3), doubles(room(3), 3)
    numerics = int32s(pointer(m + model.numeric_adr), pointer(m + model.nnumeric))
    first = pointer(m + model.numeric_data)
    lengths, surfaces = (
        doubles(equation.number(p, AT.length), n),
        int64s(equation.number(p, AT.surface), n),
    )
    sand = first + block.SIZE * numerics[table[1]]
    int64s(p, ENTRIES)[AT.sand] = sand
    for k in range(n):
        body, field = table[block.HEAD + 2 * k], table[block.HEAD + 2 * k + 1]
        surfaces[k] = first + block.SIZE * numerics[field]
        lengths[k] = doubles(surfaces[k], 16)[15]
        bodies.jacobian(t, body, equation.body_jacobian(p, k))
        r, f = equation.body_rotation(p, k), equation.body_frame(p, k)
        linear_algebra.copy(t.xmat[9 * body : 9 * body + 9], r)
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3].ctypes.data
        exports_ahead.frame(sand, surfaces[k], x, r.ctypes.data, v.ctypes.data, w.ctypes.data, f.ctypes.data)


@njit(forceinline=True)
def press(model, data, contact, m, d, number):
    """Solve for the sand's force at the end of the step and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    table = instance.table(address)
    nv, nbody = pointer(m + model.nv), table[0]
    old = instance.lasting(model, data, m, d, number)
    new = instance.pending(address, old.size)
    counted, wrenches = instance.counters(address), instance.wrenches(address)
    for i in range(wrenches.size):
        wrenches[i] = 0.0
    counted[0] = counted[1] = counted[2] = 0.0
    rows = int32s(d + data.nefc, 1)[0]
    p = room(ENTRIES)
    entries = int64s(p, ENTRIES)
    memory = take(equation.lay_out(p, 0 * nbody, nbody, nv, rows, old.size))
    equation.lay_out(p, memory, nbody, nv, rows, old.size)
    entries[AT.old], entries[AT.new] = old.ctypes.data, new.ctypes.data
    entries[AT.counts] = counted.ctypes.data
    linear_algebra.copy(doubles(pointer(d + data.qvel), nv), equation.of_dofs(p, AT.velocity))
    doubles(entries[AT.timestep], 1)[0] = doubles(m + model.opt_timestep, 1)[0]
    t = bodies.tree(model, data, m, d)
    _fill_bodies(model, m, t, table, p)
    if native_step.is_needed(p) != 0:
        external.fwd_actuation(m, d)  # before the drag, which leaves out actuators at their limits
        _fill_mass(model, data, m, d, p)
        dragged = _fill_drag(model, data, m, d, p)
        _fill_force(model, data, m, d, t, p)
        _fill_rows(model, data, contact, m, d, p, dragged)
        native_step.step(p)
        force = doubles(pointer(d + data.qfrc_passive), nv)
        q = equation.of_dofs(p, AT.out)
        for i in range(nv):
            force[i] += q[i]
        linear_algebra.copy(doubles(entries[AT.wrench], wrenches.size), wrenches)
    release(memory)
