"""The sand's wrench on a body, linearised about a twist, and the twist that a generalised velocity gives."""

from typing import Final

import warp as wp

from rftsim.warp.definite import mat66, vec6
from rftsim.warp.frames import State
from rftsim.warp.surfaces import Paths, Surfaces

NEVER: Final = wp.constant(-1.0)
"""A time before all steps [s]."""


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
    """How far the derivative is to be the secant along the motion; 0 is the tangent, 1 the secant."""
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
def rotated(turn: wp.mat33, x: wp.spatial_vector):
    """A twist or a wrench in the axes that a rotation leads to."""
    return wp.spatial_vector(turn * wp.spatial_top(x), turn * wp.spatial_bottom(x))


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
        model.start[world, body] = wp.spatial_vector()
        state.near[world, body] = 0
