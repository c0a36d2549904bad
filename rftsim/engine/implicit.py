"""The sand's force at the end of the step, from what MuJoCo knows when it computes passive forces.

At that moment the mass matrix and the constraints' Jacobians are current, and what drives the step is not: actuation,
bias and the constraints' reference are the last step's. They are computed here (MuJoCo does it again, the same).
"""

from typing import Final

from rftsim.engine import bodies, external, instance
from rftsim.engine.layout import CONSTANTS
from rftsim.law import exports
from rftsim.law.body import header_at
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles, int32s, matrix, pointer, release, stack_doubles, take
from rftsim.solver import equation, linear_algebra, time_step
from rftsim.solver.equation import KIND, TABLE

_K: Final = 0
_B: Final = 1
_I: Final = 2
"""Where MuJoCo's efc_KBIP holds a row's stiffness, damping and impedance."""
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


@inline
def _fill_mass(model, data, m, d, p):
    """The mass matrix, from its lower triangle in rows."""
    out = equation.plain_mass(p)
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


@inline
def _fill_drag(model, data, m, d, p):
    """Fill the drag that the integrator takes implicitly, over the time step; whether there is any."""
    out = equation.drag(p)
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


@inline
def _fill_force(model, data, m, d, t, p):
    """All smooth forces of this step but the sand's."""
    bias = pointer(d + data.qfrc_bias)
    external.rne(m, d, 0, bias)
    out = equation.smooth_force(p)
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


@inline
def _fill_row_jacobian(model, data, m, d, p):
    """The Jacobian of MuJoCo's constraint rows, from its sparse or dense form."""
    jacobian, n, nv = equation.row_jacobian(p), equation.head(p).nrow, equation.head(p).nv
    if not external.is_sparse(m):
        linear_algebra.copy_matrix(matrix(pointer(d + data.efc_J), n, nv), jacobian)
        return
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


@inline
def _fill_row_laws(data, contact, d, p):
    """Fill each constraint row's kind, bound, damping and spring."""
    n = equation.head(p).nrow
    kind, bound = equation.row_kind(p), equation.row_bound(p)
    damping, spring = equation.row_damping(p), equation.row_spring(p)
    kinds, owner = int32s(pointer(d + data.efc_type), n), int32s(pointer(d + data.efc_id), n)
    loss, kbip = doubles(pointer(d + data.efc_frictionloss), n), matrix(pointer(d + data.efc_KBIP), n, 4)
    inside = 0  # rows of the elliptic contact at hand
    for i in range(n):
        kind[i], bound[i] = _KINDS[kinds[i]], loss[i]
        stiffness, damping[i], impedance = kbip[i, _K], kbip[i, _B], kbip[i, _I]
        spring[i] = stiffness * impedance
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


@inline
def _fill_rows(model, data, contact, m, d, p, dragged):
    """MuJoCo's constraint rows."""
    n, nv = equation.head(p).nrow, equation.head(p).nv
    if n == 0:
        return
    external.reference_constraint(m, d)
    linear_algebra.copy(doubles(pointer(d + data.efc_D), n), equation.first_stiffness(p))
    linear_algebra.copy(doubles(pointer(d + data.efc_aref), n), equation.first_reference(p))
    _fill_row_jacobian(model, data, m, d, p)
    _fill_row_laws(data, contact, d, p)
    jacobian, seen, drag = equation.row_jacobian(p), equation.row_drag(p), equation.drag(p)
    for i in range(n):
        for k in range(nv):
            seen[i, k] = 0.0
    if not dragged:
        return
    factors, order, solved = equation.mass_factors(p), equation.mass_order(p), equation.change(p)
    linear_algebra.factor_of(equation.plain_mass(p), factors, order)
    for i in range(n):
        linear_algebra.substitute(factors, order, jacobian[i], solved)
        linear_algebra.add_transposed(drag, solved, 1.0, seen[i])


@inline
def _fill_bodies(model, m, t, address, p):
    """The bodies of the instance whose block is at an address."""
    v, w = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    numerics = int32s(pointer(m + model.numeric_adr), pointer(m + model.nnumeric))
    first = pointer(m + model.numeric_data)
    lengths, surfaces = equation.length(p), equation.surface(p)
    sand = first + 8 * numerics[instance.head(address).bed]
    equation.head(p).sand = sand
    for k in range(instance.head(address).nbody):
        body = instance.body(address, k)
        surfaces[k] = first + 8 * numerics[instance.numeric_of(address, k)]
        lengths[k] = header_at(surfaces[k]).gyration
        bodies.fill_jacobian(t, body, equation.jacobian(p, k))
        r, f = equation.rotation(p, k), equation.frame(p, k)
        linear_algebra.copy(t.xmat[9 * body : 9 * body + 9], r)
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3].ctypes.data
        exports.frame(sand, surfaces[k], x, r.ctypes.data, v.ctypes.data, w.ctypes.data, f.ctypes.data)


@inline
def press(model, data, contact, m, d, number):
    """Solve for the sand's force at the end of the step and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    nv, nbody = pointer(m + model.nv), instance.head(address).nbody
    old, wrenches = instance.lasting(model, data, m, d, number), instance.all_wrenches(address)
    for i in range(wrenches.size):
        wrenches[i] = 0.0
    instance.count(address, 0.0)
    rows = int32s(d + data.nefc, 1)[0]
    p = stack_doubles(TABLE)
    memory = take(equation.lay_out(p, nbody, nv, rows))
    equation.place(p, memory)
    head = equation.head(p)
    head.old, head.new = old.ctypes.data, instance.pending(address, old.size).ctypes.data
    head.work = instance.counters(address)
    linear_algebra.copy(doubles(pointer(d + data.qvel), nv), equation.velocity(p))
    equation.numbers(p).timestep = doubles(m + model.opt_timestep, 1)[0]
    t = bodies.tree(model, data, m, d)
    _fill_bodies(model, m, t, address, p)
    if time_step.is_needed(p) != 0:
        external.fwd_actuation(m, d)  # before the drag, which leaves out actuators at their limits
        _fill_mass(model, data, m, d, p)
        dragged = _fill_drag(model, data, m, d, p)
        _fill_force(model, data, m, d, t, p)
        _fill_rows(model, data, contact, m, d, p, dragged)
        time_step.step(p)
        force = doubles(pointer(d + data.qfrc_passive), nv)
        q = equation.out(p)
        for i in range(nv):
            force[i] += q[i]
        linear_algebra.copy(equation.all_wrenches(p), wrenches)
    release(memory)
