"""The equation of a step in mujoco_warp: the sand's force linearised, in the mass matrix and the smooth forces.

About a twist V* of a body the sand's wrench at the end of the step is W* - K (V - V*), K symmetric and without negative
eigenvalues. With M + h J' K J in place of the mass matrix, which has the same entries, and J' (W* - K (V0 - V*)) among
the smooth forces, MuJoCo's own solver finds the end of the step with its constraints and the sand's force in one.
"""

import warp as wp

from rftsim.warp.definite import from_blocks, mat66, without_negative
from rftsim.warp.frames import State
from rftsim.warp.linear import Model, apply, rotated, twist_of, wrench_at
from rftsim.warp.surfaces import Paths, Surfaces


@wp.func
def _gathered(surfaces: Surfaces, state: State, xmat: wp.array2d(dtype=wp.mat33), nlane: int, world: int, body: int):
    """The wrench on a body from the threads' sums, world axes."""
    wrench = wp.spatial_vector()
    for lane in range(nlane):
        wrench += state.wrench[world, body, lane]
    return rotated(xmat[world, surfaces.body[body]], wrench)


@wp.kernel(enable_backward=False)
def gather_wrenches(surfaces: Surfaces, state: State, xmat: wp.array2d(dtype=wp.mat33), nlane: int, model: Model):
    """Fill the wrenches from the threads' sums, over (nworld, nbody)."""
    world, body = wp.tid()
    wrench = wp.spatial_vector()
    if state.near[world, body] == 1:
        wrench = _gathered(surfaces, state, xmat, nlane, world, body)
    model.wrench[world, body] = wrench


@wp.kernel(enable_backward=False)
def gather(surfaces: Surfaces, state: State, xmat: wp.array2d(dtype=wp.mat33), nlane: int, model: Model):
    """Fill the linearised wrenches from the threads' sums, over (nworld, nbody)."""
    world, body = wp.tid()
    if state.near[world, body] == 0:
        model.wrench[world, body] = wp.spatial_vector()
        model.stiffness[world, body] = mat66()
        return
    model.wrench[world, body] = _gathered(surfaces, state, xmat, nlane, world, body)
    turn = xmat[world, surfaces.body[body]]
    vv, vw, ww = wp.mat33(0.0), wp.mat33(0.0), wp.mat33(0.0)
    along_vv, along_vw, along_ww = wp.mat33(0.0), wp.mat33(0.0), wp.mat33(0.0)
    for lane in range(nlane):
        vv -= state.parts[world, body, lane, 0]
        vw -= state.parts[world, body, lane, 1]
        ww -= state.parts[world, body, lane, 2]
        along_vv -= state.parts[world, body, lane, 3]
        along_vw -= state.parts[world, body, lane, 4]
        along_ww -= state.parts[world, body, lane, 5]
    length, back = surfaces.gyration[body], wp.transpose(turn)
    share = 1.0 - model.secant[world, body]
    vv -= share * along_vv
    vw -= share * along_vw
    ww -= share * along_ww
    vw = vw / length
    ww = ww / (length * length)
    k = without_negative(from_blocks(turn * vv * back, turn * vw * back, turn * ww * back))
    for i in range(3):
        for j in range(3):
            k[i, 3 + j] = k[i, 3 + j] * length
            k[3 + i, j] = k[3 + i, j] * length
            k[3 + i, 3 + j] = k[3 + i, 3 + j] * length * length
    model.stiffness[world, body] = k


@wp.kernel(enable_backward=False)
def add_stiffness(
    paths: Paths,
    state: State,
    model: Model,
    timestep: wp.array(dtype=float),
    mass: wp.array2d(dtype=float),
    out: wp.array2d(dtype=float),
):
    """Fill out with a matrix of the mass matrix's entries and h J' K J, over (nworld, nentry)."""
    world, entry = wp.tid()
    total = float(0.0)
    for at in range(paths.first_of_entry[entry], paths.first_of_entry[entry + 1]):
        row, column = paths.row_motion[at], paths.column_motion[at]
        body = paths.owner[row]
        if state.near[world, body] == 1:
            by = apply(model.stiffness[world, body], model.motion[world, column])
            total += wp.dot(model.motion[world, row], by)
    out[world, entry] = mass[world, entry] + timestep[world % timestep.shape[0]] * total


@wp.kernel(enable_backward=False)
def add_force(paths: Paths, state: State, model: Model, is_implicit: bool, force: wp.array2d(dtype=float)):
    """Add the generalised force of the wrenches, of the linearised ones at the start of the step, over (nworld, nv)."""
    world, dof = wp.tid()
    total = float(0.0)
    for at in range(paths.first_of_dof[dof], paths.first_of_dof[dof + 1]):
        motion = paths.of_dof[at]
        body = paths.owner[motion]
        if state.near[world, body] == 1:
            wrench = model.wrench[world, body]
            if is_implicit:
                wrench = wrench_at(model, world, body, model.start[world, body])
            total += wp.dot(model.motion[world, motion], wrench)
    force[world, dof] += total


@wp.kernel(enable_backward=False)
def end_of_step(
    qvel: wp.array2d(dtype=float),
    qacc: wp.array2d(dtype=float),
    timestep: wp.array(dtype=float),
    out: wp.array2d(dtype=float),
):
    """Fill out with the velocity after an acceleration, over (nworld, nv)."""
    world, dof = wp.tid()
    out[world, dof] = qvel[world, dof] + timestep[world % timestep.shape[0]] * qacc[world, dof]


@wp.kernel(enable_backward=False)
def sum_smooth(
    passive: wp.array2d(dtype=float),
    actuator: wp.array2d(dtype=float),
    applied: wp.array2d(dtype=float),
    bias: wp.array2d(dtype=float),
    constraint: wp.array2d(dtype=float),
    is_new: wp.array(dtype=bool),
    out: wp.array2d(dtype=float),
):
    """Fill out with all forces of a step but the sand's, over (nworld, nv).

    The constraints' are those of the last step, which a world that was reset has not made.
    """
    world, dof = wp.tid()
    total = passive[world, dof] + actuator[world, dof] + applied[world, dof] - bias[world, dof]
    if not is_new[world]:
        total += constraint[world, dof]
    out[world, dof] = total


@wp.kernel(enable_backward=False)
def mark_new(reset: wp.array(dtype=bool), is_new: wp.array(dtype=bool)):
    """Mark the worlds that are reset, over (nworld,)."""
    world = wp.tid()
    if reset[world]:
        is_new[world] = True


@wp.kernel(enable_backward=False)
def add_damping(
    rowadr: wp.array(dtype=int),
    rownnz: wp.array(dtype=int),
    damping: wp.array2d(dtype=float),
    timestep: wp.array(dtype=float),
    out: wp.array2d(dtype=float),
):
    """Add the joints' damping over the time step to the diagonal of a matrix, over (nworld, nv)."""
    world, dof = wp.tid()
    at = rowadr[dof] + rownnz[dof] - 1
    out[world, at] += timestep[world % timestep.shape[0]] * damping[world % damping.shape[0], dof]


@wp.kernel(enable_backward=False)
def find_wrenches(
    paths: Paths,
    state: State,
    model: Model,
    velocity: wp.array2d(dtype=float),
    is_implicit: bool,
    out: wp.array2d(dtype=wp.spatial_vector),
):
    """Fill out with the wrenches, of the linearised ones at a velocity, over (nworld, nbody)."""
    world, body = wp.tid()
    wrench = wp.spatial_vector()
    if state.near[world, body] == 1:
        wrench = model.wrench[world, body]
        if is_implicit:
            wrench = wrench_at(model, world, body, twist_of(paths, model, velocity, world, body))
    out[world, body] = wrench


@wp.kernel(enable_backward=False)
def read_wrenches(
    wrenches: wp.array2d(dtype=wp.spatial_vector),
    sensor: wp.array2d(dtype=int),
    sensordata: wp.array2d(dtype=float),
):
    """Fill the sensors of wrenches, over (nworld, nsensor); of each its first number and its body."""
    world, k = wp.tid()
    wrench = wrenches[world, sensor[k, 1]]
    for i in range(6):
        sensordata[world, sensor[k, 0] + i] = wrench[i]
