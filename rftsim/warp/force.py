"""The sand's wrench on each body of each world, and its derivative by the body's twist, as kernels of Warp.

Twists and wrenches are about the body's origin: velocity or force first. Threads that share a body sum apart, and their
sums are added in order, so that runs are bit-identical.
"""

from typing import Any, Final, NamedTuple

import warp as wp

from rftsim.law import leading
from rftsim.law.exports import RAMP
from rftsim.law.laws import Response
from rftsim.law.layout import BLOCK, NO_RIM
from rftsim.warp.law import Edge, Medium, Plane, stress_of
from rftsim.warp.surfaces import Surfaces
from rftsim.warp.translate import LEAST, translate

ASIDE: Final = wp.constant(3e-3)
"""Turn of the direction of motion [rad] by which laws are differentiated, in single precision."""
SHARP: Final = 1e30
"""Steepness of the leading-edge rule as published, in single precision."""
PARTS: Final = 6
"""Matrices of a derivative: by velocity, by both, by angular velocity; of the whole, and of its part along motion."""
_TINY: Final = wp.constant(LEAST)
_RAMP: Final = wp.constant(RAMP)
_BLOCK: Final = wp.constant(BLOCK)
_NO_RIM: Final = wp.constant(NO_RIM)

_share = translate(leading.share, {})


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
    """What is known of the bodies in each world, arrays of (nworld, nbody)."""

    twist: wp.array2d(dtype=wp.spatial_vector)
    """The twist at which the force is taken, world axes."""
    rear: wp.array2d(dtype=wp.vec4)
    """Half-space whose free surface has dropped, body frame: normal and offset."""
    drop: wp.array2d(dtype=float)
    """By how much [m]."""
    slow: wp.array(dtype=float)
    """Speed v_c of each world below which a triangle's stress falls to zero [m/s], (nworld,)."""
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
    """The sand of a world."""
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
    """The frame of a body."""
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


@wp.func
def _sideways(a: wp.vec3):
    """A unit vector across another."""
    sign = wp.where(a[2] >= 0.0, 1.0, -1.0)
    turn = -1.0 / (sign + a[2])
    return wp.vec3(1.0 + sign * a[0] * a[0] * turn, sign * a[0] * a[1] * turn, -sign * a[0])


@wp.func
def _symmetric(a: wp.mat33):
    """The symmetric part of a matrix."""
    return 0.5 * (a + wp.transpose(a))


class Kernels(NamedTuple):
    """The kernels of a law, each over (nworld, nbody, nlane)."""

    explicit: Any
    """Wrench at the velocity of the moment, as published."""
    implicit: Any
    """Wrench that is continuous at rest, and its derivative."""


def kernels_of(response: Response, table: tuple[tuple[float, ...], ...]) -> Kernels:
    """Make the kernels of a response, with a table of coefficients, see `law.stress_of`."""
    stress = stress_of(response, table)

    @wp.func
    def explicit_triangle(f: Frame, x: wp.vec3, n: wp.vec3, area: float, medium: Medium, edge: Edge, around: Plane):
        deep = depth_of(f, x)
        force = wp.vec3(0.0)
        if deep > 0.0:
            v = f.velocity + wp.cross(f.omega, x)
            s = stress(n, v, f.up, around, medium, edge)
            force = area * (deep * s.per_depth + s.inertia * s.along)
        return force

    @wp.kernel(module="unique", enable_backward=False)
    def explicit(
        surfaces: Surfaces,
        sands: Sands,
        state: State,
        xpos: wp.array2d(dtype=wp.vec3),
        xmat: wp.array2d(dtype=wp.mat33),
        nlane: int,
    ):
        world, body, lane = wp.tid()
        own = surfaces.body[body]
        f = frame_of(sands, state, xpos[world, own], xmat[world, own], world, body)
        low, high = surfaces.lowest[body], surfaces.highest[body]
        total, moment = wp.vec3(0.0), wp.vec3(0.0)
        near = wp.where(is_clear(f, 0.5 * (low + high), 0.5 * (high - low)), 0, 1)
        if lane == 0:
            state.near[world, body] = near
        if near == 1:
            medium, edge, around = medium_of(sands, world), Edge(), Plane()
            edge.tolerance = surfaces.edge_on[body]
            edge.ramp = SHARP
            around.forward = f.forward
            for block in range(surfaces.first_block[body] + lane, surfaces.first_block[body + 1], nlane):
                if is_clear(f, surfaces.middle[block], surfaces.half[block]):
                    continue
                start = surfaces.first[body] + _BLOCK * (block - surfaces.first_block[body])
                for i in range(start, wp.min(start + _BLOCK, surfaces.first[body + 1])):
                    x = surfaces.centre[i]
                    g = explicit_triangle(f, x, surfaces.normal[i], surfaces.area[i], medium, edge, around)
                    total += g
                    moment += wp.cross(x, g)
            state.wrench[world, body, lane] = wp.spatial_vector(total, moment)

    @wp.kernel(module="unique", enable_backward=False)
    def implicit(
        surfaces: Surfaces,
        sands: Sands,
        state: State,
        xpos: wp.array2d(dtype=wp.vec3),
        xmat: wp.array2d(dtype=wp.mat33),
        nlane: int,
        timestep: wp.array(dtype=float),
    ):
        world, body, lane = wp.tid()
        own = surfaces.body[body]
        f = frame_of(sands, state, xpos[world, own], xmat[world, own], world, body)
        low, high = surfaces.lowest[body], surfaces.highest[body]
        step = timestep[world % timestep.shape[0]]
        far = wp.length(wp.max(wp.abs(low), wp.abs(high)))
        margin = step * (wp.length(f.velocity) + far * wp.length(f.omega))
        deepest = depth_of_box(f, 0.5 * (low + high), 0.5 * (high - low))
        near = wp.where(deepest + margin <= 0.0, 0, 1)
        if lane == 0:
            state.near[world, body] = near
        if near == 0:
            return
        sinking = step * wp.max(-wp.dot(f.velocity, f.up), 0.0)
        later = step * sinking / (sinking + wp.max(deepest, _TINY))
        medium, edge, bare, around = medium_of(sands, world), Edge(), Edge(), Plane()
        edge.tolerance = surfaces.edge_on[body]
        edge.ramp = _RAMP
        bare.tolerance = surfaces.edge_on[body]
        bare.ramp = 0.0
        around.forward = f.forward
        v_c = state.slow[world]
        total, moment = wp.vec3(0.0), wp.vec3(0.0)
        whole_vv, whole_vw, whole_ww = wp.mat33(0.0), wp.mat33(0.0), wp.mat33(0.0)
        along_vv, along_vw, along_ww = wp.mat33(0.0), wp.mat33(0.0), wp.mat33(0.0)
        for block in range(surfaces.first_block[body] + lane, surfaces.first_block[body + 1], nlane):
            if depth_of_box(f, surfaces.middle[block], surfaces.half[block]) + margin <= 0.0:
                continue
            start = surfaces.first[body] + _BLOCK * (block - surfaces.first_block[body])
            for i in range(start, wp.min(start + _BLOCK, surfaces.first[body + 1])):
                x, n, area = surfaces.centre[i], surfaces.normal[i], surfaces.area[i]
                v = f.velocity + wp.cross(f.omega, x)
                deep = depth_of(f, x) - later * wp.dot(v, f.up)
                speed2 = wp.dot(v, v)
                if deep <= 0.0 or speed2 <= 0.0:
                    continue
                speed = wp.sqrt(speed2)
                radius = 1.0 / wp.sqrt(speed2 + v_c * v_c)
                ahead = v / speed
                first = _sideways(ahead)
                second = wp.cross(ahead, first)
                s = stress(n, v, f.up, around, medium, bare)
                one = stress(n, ahead + ASIDE * first, f.up, around, medium, bare)
                two = stress(n, ahead + ASIDE * second, f.up, around, medium, bare)
                m = s.along
                cosine = wp.dot(ahead, m)
                share = _share(cosine, speed2, edge)
                weight = area * deep * radius
                g = share * weight * speed * s.per_depth + area * s.inertia * m
                total += g
                moment += wp.cross(x, g)
                across = share * weight / ASIDE
                straight = share * weight * wp.outer(s.per_depth, ahead)
                turned = across * (
                    wp.outer(one.per_depth - s.per_depth, first) + wp.outer(two.per_depth - s.per_depth, second)
                )
                braked = 2.0 * area * s.inertia / wp.max(cosine * speed, _TINY)
                sunk = -later * share * area * speed * radius * wp.outer(s.per_depth, f.up)
                width = 0.5 / (radius * _RAMP)
                press = wp.abs(wp.dot(s.per_depth, m)) * weight * speed
                jump = -0.5 * press / wp.max(wp.abs(cosine * speed + width), width)
                slope = wp.where(share > 0.0 and share < 1.0, -press * _RAMP / speed, 0.0)
                whole = _symmetric(straight + turned + sunk) + (braked + jump) * wp.outer(m, m)
                along = (speed * radius) * (speed * radius) * _symmetric(straight) + (jump - slope) * wp.outer(m, m)
                arm = -wp.skew(x)
                whole_vv += whole
                whole_vw += whole * arm
                whole_ww += wp.transpose(arm) * whole * arm
                along_vv += along
                along_vw += along * arm
                along_ww += wp.transpose(arm) * along * arm
        state.wrench[world, body, lane] = wp.spatial_vector(total, moment)
        state.parts[world, body, lane, 0] = whole_vv
        state.parts[world, body, lane, 1] = whole_vw
        state.parts[world, body, lane, 2] = whole_ww
        state.parts[world, body, lane, 3] = along_vv
        state.parts[world, body, lane, 4] = along_vw
        state.parts[world, body, lane, 5] = along_ww

    return Kernels(explicit, implicit)
