"""The sand's wrench on each body of each world, and its derivative by the body's twist, as kernels of Warp.

Twists and wrenches are about the body's origin: velocity or force first. Threads that share a body sum apart, and their
sums are added in order, so that runs are bit-identical.
"""

from typing import Any, Final, NamedTuple

import warp as wp

from rftsim.law import leading
from rftsim.law.exports import RAMP
from rftsim.law.laws import Response
from rftsim.law.layout import BLOCK
from rftsim.warp.frames import Frame, Sands, State, depth_of, depth_of_box, frame_of, is_clear, medium_of
from rftsim.warp.guess import V_C
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

_share = translate(leading.share, {})


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


@wp.struct
class Linear:
    """The force on a triangle, and how it changes with the triangle's velocity."""

    force: wp.vec3
    whole: wp.mat33
    """The derivative, the secant along the motion and over the face's edge; its symmetric part."""
    along: wp.mat33
    """What of that is more than the tangent."""


@wp.struct
class Sums:
    """The sums of one thread, see `State`."""

    force: wp.vec3
    moment: wp.vec3
    whole_vv: wp.mat33
    whole_vw: wp.mat33
    whole_ww: wp.mat33
    along_vv: wp.mat33
    along_vw: wp.mat33
    along_ww: wp.mat33


@wp.func
def _added(sums: Sums, x: wp.vec3, g: Linear):
    """Sums, and the force on a triangle with its derivative by the body's twist."""
    arm = -wp.skew(x)
    sums.force += g.force
    sums.moment += wp.cross(x, g.force)
    sums.whole_vv += g.whole
    sums.whole_vw += g.whole * arm
    sums.whole_ww += wp.transpose(arm) * g.whole * arm
    sums.along_vv += g.along
    sums.along_vw += g.along * arm
    sums.along_ww += wp.transpose(arm) * g.along * arm
    return sums


@wp.func
def _keep(state: State, sums: Sums, world: int, body: int, lane: int):
    """Hand over the sums of a thread."""
    state.wrench[world, body, lane] = wp.spatial_vector(sums.force, sums.moment)
    state.parts[world, body, lane, 0] = sums.whole_vv
    state.parts[world, body, lane, 1] = sums.whole_vw
    state.parts[world, body, lane, 2] = sums.whole_ww
    state.parts[world, body, lane, 3] = sums.along_vv
    state.parts[world, body, lane, 4] = sums.along_vw
    state.parts[world, body, lane, 5] = sums.along_ww


@wp.struct
class Sinking:
    """How a body sinks within a step."""

    deepest: float
    """Depth of the deepest corner of its box [m]."""
    margin: float
    """The farthest that any of its points can move [m]."""
    later: float
    """Time after which depths are taken [s]: of a body that sinks by much of its depth, up to half a step."""


@wp.func
def _sinking(surfaces: Surfaces, f: Frame, body: int, step: float):
    """Find how a body sinks within a step."""
    s, low, high = Sinking(), surfaces.lowest[body], surfaces.highest[body]
    corner = wp.vec3()
    for k in range(3):
        corner[k] = wp.where(f.up[k] > 0.0, low[k], high[k])
    s.deepest = f.height - wp.dot(f.up, corner)
    s.margin = step * (wp.length(f.velocity) + wp.length(wp.max(wp.abs(low), wp.abs(high))) * wp.length(f.omega))
    by = step * wp.max(-wp.dot(f.velocity + wp.cross(f.omega, corner), f.up), 0.0)
    much = by / (by + wp.max(s.deepest, _TINY))
    s.later = 0.5 * step * much * much
    return s


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

    @wp.func
    def implicit_triangle(
        f: Frame,
        x: wp.vec3,
        n: wp.vec3,
        area: float,
        later: float,
        medium: Medium,
        edge: Edge,
        around: Plane,
    ):
        g, bare = Linear(), Edge()
        v = f.velocity + wp.cross(f.omega, x)
        deep, speed = depth_of(f, x) - later * wp.dot(v, f.up), wp.length(v)
        if deep <= 0.0 or speed <= 0.0:
            return g
        bare.tolerance = edge.tolerance
        radius = 1.0 / wp.sqrt(speed * speed + V_C * V_C)
        ahead = v / speed
        first = _sideways(ahead)
        second = wp.cross(ahead, first)
        s = stress(n, v, f.up, around, medium, bare)
        one = stress(n, ahead + ASIDE * first, f.up, around, medium, bare)
        two = stress(n, ahead + ASIDE * second, f.up, around, medium, bare)
        m, mm = s.along, wp.outer(s.along, s.along)
        cosine = wp.dot(ahead, m)
        share = _share(cosine, speed * speed, edge)
        mobile = speed * radius
        weight = area * deep * radius
        g.force = share * weight * speed * s.per_depth + area * s.inertia * m
        straight = _symmetric(share * weight * wp.outer(s.per_depth, ahead))
        turned = wp.outer(one.per_depth - s.per_depth, first) + wp.outer(two.per_depth - s.per_depth, second)
        sunk = wp.outer(s.per_depth, f.up)
        braked = 2.0 * area * s.inertia / wp.max(cosine * speed, _TINY)
        width = 0.5 / (radius * _RAMP)
        press = wp.abs(wp.dot(s.per_depth, m)) * weight * speed
        jump = -0.5 * press / wp.max(wp.abs(cosine * speed + width), width)
        slope = wp.where(share > 0.0 and share < 1.0, -press * _RAMP / speed, 0.0)
        beside = _symmetric((share * weight / ASIDE) * turned - (later * share * area * mobile) * sunk)
        g.whole = straight + beside + (braked + jump) * mm
        g.along = mobile * mobile * straight + (jump - slope) * mm
        return g

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
        sinking = _sinking(surfaces, f, body, timestep[world % timestep.shape[0]])
        near = wp.where(sinking.deepest + sinking.margin <= 0.0, 0, 1)
        if lane == 0:
            state.near[world, body] = near
        if near == 0:
            return
        medium, edge, around = medium_of(sands, world), Edge(), Plane()
        edge.tolerance = surfaces.edge_on[body]
        edge.ramp = _RAMP
        around.forward = f.forward
        later, sums = sinking.later, Sums()
        for block in range(surfaces.first_block[body] + lane, surfaces.first_block[body + 1], nlane):
            if depth_of_box(f, surfaces.middle[block], surfaces.half[block]) + sinking.margin <= 0.0:
                continue
            start = surfaces.first[body] + _BLOCK * (block - surfaces.first_block[body])
            for i in range(start, wp.min(start + _BLOCK, surfaces.first[body + 1])):
                x, n, area = surfaces.centre[i], surfaces.normal[i], surfaces.area[i]
                sums = _added(sums, x, implicit_triangle(f, x, n, area, later, medium, edge, around))
        _keep(state, sums, world, body, lane)

    return Kernels(explicit, implicit)
