"""The equation of a step in mujoco_warp: the sand's force linearised, in the mass matrix and the smooth forces.

About a twist V* of a body the sand's wrench at the end of the step is W* - K (V - V*), K symmetric and without negative
eigenvalues. With M + h J' K J in place of the mass matrix, which has the same entries, and J' (W* - K (V0 - V*)) among
the smooth forces, MuJoCo's own solver finds the end of the step with its constraints and the sand's force in one.

At rest the force is held by a strain: what is evaluated is the law at V + S, S the way that the body went over the time
step, at most LIMIT v_c. So v_c may be large against rounding, and what rests does not creep.
"""

from typing import Final

import warp as wp

from rftsim.warp.definite import from_blocks, mat66, vec6, without_negative
from rftsim.warp.frames import State
from rftsim.warp.surfaces import Paths, Surfaces

V_C: Final = wp.constant(1e-4)
"""Speed v_c [m/s] below which a triangle's stress falls to zero."""
LIMIT: Final = wp.constant(10.0)
"""The largest strain over v_c; the sand then bears 0.995 of its strength at rest."""
NEVER: Final = wp.constant(-1.0)
"""A time before all steps [s]."""
SHORT: Final = wp.constant(0.9)
"""The share of a motion's power against the sand after which a guess at the end of the step goes no further."""
_TINY: Final = wp.constant(1e-30)


@wp.struct
class Model:
    """The linearised wrench of the bodies in each world, arrays of (nworld, nbody), world axes."""

    twist: wp.array2d(dtype=wp.spatial_vector)
    """V*, about which it is taken, without the strain."""
    wrench: wp.array2d(dtype=wp.spatial_vector)
    """W*."""
    stiffness: wp.array2d(dtype=mat66)
    """K."""
    start: wp.array2d(dtype=wp.spatial_vector)
    """V0, the twist at the start of the step."""
    strain: wp.array2d(dtype=wp.spatial_vector)
    """S, body axes."""
    secant: wp.array2d(dtype=float)
    """How far the derivative is to be the secant along the motion, 0 to 1."""
    motion: wp.array2d(dtype=wp.spatial_vector)
    """The twist by each motion of Paths, (nworld, nmotion)."""
    clock: wp.array2d(dtype=float)
    """The time of the step that was begun last [s]; NEVER before the first."""
    start_before: wp.array2d(dtype=wp.spatial_vector)
    strain_before: wp.array2d(dtype=wp.spatial_vector)
    near_before: wp.array2d(dtype=int)
    """V0, S and whether a body may be in the sand, as the step before it left them."""


@wp.func
def apply(a: mat66, x: wp.spatial_vector):
    """The product of a matrix and a twist."""
    y = a * vec6(x[0], x[1], x[2], x[3], x[4], x[5])
    return wp.spatial_vector(y[0], y[1], y[2], y[3], y[4], y[5])


@wp.func
def wrench_at(model: Model, world: int, body: int, twist: wp.spatial_vector):
    """The linearised wrench at a twist."""
    return model.wrench[world, body] - apply(model.stiffness[world, body], twist - model.twist[world, body])


@wp.kernel(enable_backward=False)
def find_motions(
    surfaces: Surfaces,
    paths: Paths,
    body_rootid: wp.array(dtype=int),
    xpos: wp.array2d(dtype=wp.vec3),
    subtree_com: wp.array2d(dtype=wp.vec3),
    cdof: wp.array2d(dtype=wp.spatial_vector),
    model: Model,
):
    """Fill the twist of each body by each degree of freedom that moves it, over (nworld, nmotion)."""
    world, motion = wp.tid()
    own = surfaces.body[paths.owner[motion]]
    c = cdof[world, paths.dof[motion]]
    omega = wp.spatial_top(c)
    arm = xpos[world, own] - subtree_com[world, body_rootid[own]]
    model.motion[world, motion] = wp.spatial_vector(wp.spatial_bottom(c) + wp.cross(omega, arm), omega)


@wp.func
def twist_of(paths: Paths, model: Model, velocity: wp.array2d(dtype=float), world: int, body: int):
    """The twist of a body at a generalised velocity."""
    twist = wp.spatial_vector()
    for k in range(paths.first[body], paths.first[body + 1]):
        twist += velocity[world, paths.dof[k]] * model.motion[world, k]
    return twist


@wp.func
def size_of(twist: wp.spatial_vector, length: float):
    """Root of the squares of a velocity and of an angular velocity times a length [m/s]."""
    v, w = wp.spatial_top(twist), wp.spatial_bottom(twist)
    return wp.sqrt(wp.dot(v, v) + length * length * wp.dot(w, w))


@wp.func
def secant_for(change: float, speed: float):
    """How far the derivative is to be the secant, after a change of a body's speed, and where it is nearly at rest.

    The force of a law that knows only the direction of motion jumps at rest. A tangent far from there is exact, and
    leads past it where the body stops; the secant leads to rest, and is wrong by the relative change of speed.
    """
    return wp.clamp(wp.max(change / wp.max(speed, _TINY), 2.0 - 0.5 * speed / (LIMIT * V_C)), 0.0, 1.0)


@wp.func
def keep_past(model: Model, state: State, world: int, body: int, time: float):
    """Keep what the last step left, so that a step that is begun again, as `mujoco_warp.forward` does, is the same."""
    if model.clock[world, body] != time:
        model.clock[world, body] = time
        model.start_before[world, body] = model.start[world, body]
        model.strain_before[world, body] = model.strain[world, body]
        model.near_before[world, body] = state.near[world, body]


@wp.func
def before_rest(wrench: wp.spatial_vector, twist: wp.spatial_vector, change: wp.spatial_vector):
    """The share of a change after which a motion against a wrench is all but stopped; 1 where it does not stop.

    A motion that the sand would drive is none: it is the next guess's to stay short of that.
    """
    power, gain = wp.dot(wrench, twist), wp.dot(wrench, change)
    share = float(1.0)
    if power < 0.0 and power + gain > (1.0 - SHORT) * power:
        share = wp.min(-SHORT * power / gain, 1.0)
    return share


@wp.kernel(enable_backward=False)
def begin(
    surfaces: Surfaces,
    paths: Paths,
    time: wp.array(dtype=float),
    qvel: wp.array2d(dtype=float),
    xmat: wp.array2d(dtype=wp.mat33),
    is_implicit: bool,
    model: Model,
    state: State,
):
    """Begin a step at its own velocity, over (nworld, nbody); of the implicit force, with what the last step left."""
    world, body = wp.tid()
    twist, length = twist_of(paths, model, qvel, world, body), surfaces.gyration[body]
    keep_past(model, state, world, body, time[world])
    change = size_of(twist - model.start_before[world, body], length)
    model.start[world, body] = twist
    state.twist[world, body] = twist
    if is_implicit:
        turn = xmat[world, surfaces.body[body]]
        back, strain = wp.transpose(turn), model.strain_before[world, body]
        v = wp.spatial_top(strain) + back * wp.spatial_top(twist)
        w = wp.spatial_bottom(strain) + back * wp.spatial_bottom(twist)
        speed = size_of(wp.spatial_vector(v, w), length)
        share = wp.min(1.0, LIMIT * V_C / wp.max(speed, _TINY))
        if model.near_before[world, body] == 0:
            share = 0.0
        model.strain[world, body] = wp.spatial_vector(share * v, share * w)
        left = 1.0 - share
        model.twist[world, body] = wp.spatial_vector(turn * (left * v), turn * (left * w))
        state.twist[world, body] = wp.spatial_vector(turn * v, turn * w)
        state.slow[world] = V_C
        model.secant[world, body] = secant_for(change, speed)


@wp.kernel(enable_backward=False)
def go_on(
    surfaces: Surfaces,
    paths: Paths,
    velocity: wp.array2d(dtype=float),
    xmat: wp.array2d(dtype=wp.mat33),
    model: Model,
    state: State,
):
    """Take the model's twist to that at a velocity, over (nworld, nbody)."""
    world, body = wp.tid()
    twist = twist_of(paths, model, velocity, world, body)
    turn, held, length = xmat[world, surfaces.body[body]], model.strain[world, body], surfaces.gyration[body]
    strain = wp.spatial_vector(turn * wp.spatial_top(held), turn * wp.spatial_bottom(held))
    last = state.twist[world, body]
    whole = twist + strain - last
    change = before_rest(model.wrench[world, body], last, whole) * whole
    model.twist[world, body] = last + change - strain
    state.twist[world, body] = last + change
    model.secant[world, body] = secant_for(size_of(change, length), size_of(last + change, length))


@wp.kernel(enable_backward=False)
def gather_wrenches(surfaces: Surfaces, state: State, xmat: wp.array2d(dtype=wp.mat33), nlane: int, model: Model):
    """Fill the wrenches from the threads' sums, over (nworld, nbody)."""
    world, body = wp.tid()
    wrench = wp.spatial_vector()
    if state.near[world, body] == 1:
        for lane in range(nlane):
            wrench += state.wrench[world, body, lane]
    turn = xmat[world, surfaces.body[body]]
    model.wrench[world, body] = wp.spatial_vector(turn * wp.spatial_top(wrench), turn * wp.spatial_bottom(wrench))


@wp.kernel(enable_backward=False)
def gather(surfaces: Surfaces, state: State, xmat: wp.array2d(dtype=wp.mat33), nlane: int, model: Model):
    """Fill the linearised wrenches from the threads' sums, over (nworld, nbody)."""
    world, body = wp.tid()
    if state.near[world, body] == 0:
        model.wrench[world, body] = wp.spatial_vector()
        model.stiffness[world, body] = mat66()
        return
    wrench = wp.spatial_vector()
    for lane in range(nlane):
        wrench += state.wrench[world, body, lane]
    turn = xmat[world, surfaces.body[body]]
    wrench = wp.spatial_vector(turn * wp.spatial_top(wrench), turn * wp.spatial_bottom(wrench))
    model.wrench[world, body] = wrench
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
    out: wp.array2d(dtype=float),
):
    """Fill out with all forces of a step but the sand's; the constraints' are those of the last, over (nworld, nv)."""
    world, dof = wp.tid()
    out[world, dof] = (
        passive[world, dof] + actuator[world, dof] + applied[world, dof] - bias[world, dof] + constraint[world, dof]
    )


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


@wp.kernel(enable_backward=False)
def forget(reset: wp.array(dtype=bool), state: State, model: Model):
    """Forget the past of the worlds that are reset, over (nworld, nbody)."""
    world, body = wp.tid()
    if reset[world]:
        model.clock[world, body] = NEVER
        model.strain[world, body] = wp.spatial_vector()
        model.wrench[world, body] = wp.spatial_vector()
        model.stiffness[world, body] = mat66()
        model.twist[world, body] = wp.spatial_vector()
        state.near[world, body] = 0
