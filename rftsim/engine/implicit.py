"""The sand's force at the end of the step, from what MuJoCo knows when it computes passive forces.

At that moment the mass matrix and the constraints' Jacobians are current, and what drives the step is not: actuation,
bias and the constraints' reference are the last step's. They are computed here (MuJoCo does it again, the same).
"""

from typing import Final

import mujoco
import numpy as np
from numba import njit

from rftsim import implicit as solver
from rftsim import native_ahead, packed, stepping
from rftsim.engine import bodies, external, instance
from rftsim.memory import doubles, int32s, pointer

_EULER: Final = int(mujoco.mjtIntegrator.mjINT_EULER)
_IMPLICIT: Final = int(mujoco.mjtIntegrator.mjINT_IMPLICIT)
_UNDAMPED: Final = int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
_KIND: Final = {
    mujoco.mjtConstraint.mjCNSTR_EQUALITY: solver.EQUALITY,
    mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF: solver.FRICTION,
    mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON: solver.FRICTION,
    mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT: solver.LIMIT,
    mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON: solver.LIMIT,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS: solver.CONTACT,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL: solver.CONTACT,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC: solver.CONTACT,
}
_KINDS: Final = tuple(_KIND[key] for key in sorted(_KIND, key=int))
_ELLIPTIC: Final = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)


@njit
def _mass(model, data, m, d, nv):
    """The mass matrix, (nv, nv), from its lower triangle in rows."""
    number = int32s(pointer(m + model.M_rownnz), nv)
    start = int32s(pointer(m + model.M_rowadr), nv)
    total = start[nv - 1] + number[nv - 1]
    column = int32s(pointer(m + model.M_colind), total)
    value = doubles(pointer(d + data.M), total)
    out = np.zeros((nv, nv))
    for i in range(nv):
        for k in range(start[i], start[i] + number[i]):
            out[i, column[k]] = value[k]
            out[column[k], i] = value[k]
    return out


@njit
def _mass_of_integrator(model, data, m, d, mass, h):
    """The mass matrix with what the integrator takes implicitly."""
    nv = mass.shape[0]
    out = mass.copy()
    integrator = int32s(m + model.opt_integrator, 1)[0]
    if integrator == _EULER:
        if int32s(m + model.opt_disableflags, 1)[0] & _UNDAMPED == 0:
            damping = doubles(pointer(m + model.dof_damping), nv)
            for i in range(nv):
                out[i, i] += h * damping[i]
        return out
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
                out[i, j] -= h * value[k]
            elif j < i:  # implicitfast takes the lower triangle for both
                out[i, j] -= h * value[k]
                out[j, i] -= h * value[k]
    return out


@njit
def _driving_force(model, data, m, d, t, nv):
    """All smooth forces of this step but the sand's, (nv,)."""
    external.fwd_actuation(m, d)
    bias = pointer(d + data.qfrc_bias)
    external.rne(m, d, 0, bias)
    out = np.empty(nv)
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
    return out


@njit
def _constraints(model, data, m, d, nv):
    """MuJoCo's constraint rows. The friction of elliptic contacts is not foreseen."""
    n = int32s(d + data.nefc, 1)[0]
    jacobian, kind = np.zeros((n, nv)), np.zeros(n, np.int64)
    stiffness, reference, bound = np.zeros(n), np.zeros(n), np.zeros(n)
    damping, spring = np.zeros(n), np.zeros(n)
    if n > 0:
        external.reference_constraint(m, d)
        kinds, owner = int32s(pointer(d + data.efc_type), n), int32s(pointer(d + data.efc_id), n)
        d_, aref = doubles(pointer(d + data.efc_D), n), doubles(pointer(d + data.efc_aref), n)
        loss, kbip = doubles(pointer(d + data.efc_frictionloss), n), doubles(pointer(d + data.efc_KBIP), 4 * n)
        if external.is_sparse(m):
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
        for i in range(n):
            kind[i], bound[i] = _KINDS[kinds[i]], loss[i]
            stiffness[i], reference[i] = d_[i], aref[i]
            damping[i], spring[i] = kbip[4 * i + 1], kbip[4 * i] * kbip[4 * i + 2]
            if kinds[i] == _ELLIPTIC and i > 0 and kinds[i - 1] == _ELLIPTIC and owner[i] == owner[i - 1]:
                stiffness[i] = 0.0
    return solver.Rows(jacobian, jacobian, stiffness, reference, kind, bound, damping, spring)


@njit
def _bodies_of(model, m, t, table, sand, nv):
    """The bodies of the instance, for one step."""
    n = table[0]
    jacobian, rotation = np.empty((n, 6, nv)), np.empty((n, 9))
    frame, length, surface = np.empty((n, native_ahead.FRAME)), np.empty(n), np.empty((n, 2), np.int64)
    v, w = np.empty(3), np.empty(3)
    for k in range(n):
        body, field = table[instance.HEAD + 2 * k], table[instance.HEAD + 2 * k + 1]
        numbers = instance.numeric(model, m, field)
        surface[k, 0] = (
            pointer(m + model.numeric_data)
            + instance.SIZE * (int32s(pointer(m + model.numeric_adr), pointer(m + model.nnumeric))[field])
        )
        surface[k, 1] = packed.size_of(numbers)
        length[k] = numbers[15]
        bodies.jacobian(t, body, jacobian[k])
        for i in range(9):
            rotation[k, i] = t.xmat[9 * body + i]
        x = t.xpos[3 * body : 3 * body + 3].ctypes.data
        bodies.twist(t, body, v, w)
        r, f = rotation[k].ctypes.data, frame[k].ctypes.data
        native_ahead.frame(sand.ctypes.data, surface[k, 0], x, r, v.ctypes.data, w.ctypes.data, f)
    return solver.Bodies(jacobian, rotation, frame, length, surface, sand)


@njit
def press(model, data, m, d, number):
    """Solve for the sand's force at the end of the step and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    table = instance.table(address)
    sand = instance.numeric(model, m, table[1])
    nv = pointer(m + model.nv)
    t = bodies.tree(model, data, m, d)
    own = _bodies_of(model, m, t, table, sand, nv)
    v = doubles(pointer(d + data.qvel), nv).copy()
    h = doubles(m + model.opt_timestep, 1)[0]
    old = instance.lasting(model, data, m, d, number)
    new = instance.pending(address, old.size)
    counted = instance.counters(address)
    wrenches = instance.wrenches(address)
    for i in range(wrenches.size):
        wrenches[i] = 0.0
    counted[0] = counted[1] = counted[2] = 0.0
    if not stepping.is_needed(old, new, own, v, h):
        return
    mass = _mass(model, data, m, d, nv)
    mass_h = _mass_of_integrator(model, data, m, d, mass, h)
    tau = _driving_force(model, data, m, d, t, nv)
    rows = _constraints(model, data, m, d, nv)
    mean = np.zeros((table[0], 6))
    q = stepping.sand_force(old, new, own, rows, mass, mass_h, v, h, tau, counted, mean)
    force = doubles(pointer(d + data.qfrc_passive), nv)
    for i in range(nv):
        force[i] += q[i]
    for k in range(table[0]):
        for i in range(6):
            wrenches[instance.WRENCH * k + i] = mean[k, i]
