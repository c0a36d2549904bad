"""Sand and bodies of many worlds as kernels of Warp read them: what each body's frame is, and how deep it lies."""

import warp as wp

from rftsim.warp.law import Medium


@wp.struct
class Sands:
    """The sand of each world, arrays of as many as there are different ones: that of a world is modulo their number."""

    xi_n: wp.array(dtype=float)
    zeta: wp.array(dtype=float)
    mu_surf: wp.array(dtype=float)
    lambda_: wp.array(dtype=float)
    rho_c: wp.array(dtype=float)
    g: wp.array(dtype=float)
    offset: wp.array(dtype=float)
    """Height of the free surface along its normal [m]."""
    dynamic: float
    up: wp.vec3
    """Normal of the free surface."""
    plane: wp.vec3
    """Normal of the plane of motion of a planar law."""


@wp.struct
class State:
    """The state of the bodies in each world, arrays of (nworld, nbody)."""

    twist: wp.array2d(dtype=wp.spatial_vector)
    """The twist at which the force is taken, world axes."""
    rear: wp.array2d(dtype=wp.vec4)
    """Half-space whose free surface has dropped, body frame: normal and offset."""
    drop: wp.array2d(dtype=float)
    """By how much [m]."""
    near: wp.array2d(dtype=int)
    """Whether a body may be in the sand."""
    wrench: wp.array3d(dtype=wp.spatial_vector)
    """Sums of each thread that shares the body, body frame, (nworld, nbody, nlane)."""
    parts: wp.array4d(dtype=wp.mat33)
    """The same of the derivative, see PARTS, (nworld, nbody, nlane, PARTS)."""


@wp.struct
class Frame:
    """A body's motion and the free surface as it sees it, body frame."""

    velocity: wp.vec3
    omega: wp.vec3
    up: wp.vec3
    forward: wp.vec3
    height: float
    rear: wp.vec3
    rear_offset: float
    drop: float


@wp.func
def medium_of(sands: Sands, world: int):
    """Read the sand of a world."""
    m = Medium()
    m.dynamic = sands.dynamic
    m.xi_n = sands.xi_n[world % sands.xi_n.shape[0]]
    m.zeta = sands.zeta[world % sands.zeta.shape[0]]
    m.mu_surf = sands.mu_surf[world % sands.mu_surf.shape[0]]
    m.lambda_ = sands.lambda_[world % sands.lambda_.shape[0]]
    m.rho_c = sands.rho_c[world % sands.rho_c.shape[0]]
    m.g = sands.g[world % sands.g.shape[0]]
    return m


@wp.func
def frame_of(sands: Sands, state: State, place: wp.vec3, turn: wp.mat33, world: int, body: int):
    """Find the frame of a body."""
    back = wp.transpose(turn)
    f = Frame()
    twist = state.twist[world, body]
    f.velocity = back * wp.spatial_top(twist)
    f.omega = back * wp.spatial_bottom(twist)
    f.up = back * sands.up
    f.forward = wp.cross(back * sands.plane, f.up)
    f.height = sands.offset[world % sands.offset.shape[0]] - wp.dot(sands.up, place)
    rear = state.rear[world, body]
    f.rear = wp.vec3(rear[0], rear[1], rear[2])
    f.rear_offset = rear[3]
    f.drop = state.drop[world, body]
    return f


@wp.func
def depth_of(f: Frame, x: wp.vec3):
    """The depth of a point [m], a wheel's drop counted."""
    deep = f.height - wp.dot(f.up, x)
    if f.drop > 0.0 and wp.dot(f.rear, x) + f.rear_offset < 0.0:
        deep -= f.drop
    return deep


@wp.func
def depth_of_box(f: Frame, middle: wp.vec3, half: wp.vec3):
    """The depth of the deepest corner of a box below the undisturbed sand [m]."""
    return f.height - wp.dot(f.up, middle) + wp.dot(wp.abs(f.up), half)


@wp.func
def is_clear(f: Frame, middle: wp.vec3, half: wp.vec3):
    """Whether a box lies above the undisturbed sand."""
    return depth_of_box(f, middle, half) <= 0.0
