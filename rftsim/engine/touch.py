"""The sand's share of a `touch` sensor: the pressure on those of its body's triangles that lie in the sensor's zone.

MuJoCo adds up the normal forces of contacts that lie in the site's volume, or from which the way out of the body leads
through it. Here a triangle's centroid is such a contact. The triangles' tractions are those at the twist of the moment,
and the wrench that was applied may be that at the end of the step, so they are scaled to agree with it.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.engine import bodies, external, instance
from rftsim.engine.layout import CONSTANTS
from rftsim.law import exports
from rftsim.law.body import COLUMN, at, bed_at, body_at, centre, header_at, normal
from rftsim.law.frame import level_frame, point_velocity
from rftsim.law.stress import TINY
from rftsim.law.vectors import dot, to_body, to_world
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, int32s, matrix, pointer, release, stack_doubles, take
from rftsim.solver.newton import CREEP, V_C

_SPHERE: Final = CONSTANTS["sphere"]
_BOX: Final = CONSTANTS["box"]
ALIGNED: Final = 0.9
"""Cosine between the triangles' force and the wrench's from which on the twist of the moment tells how sand presses."""
SLOW: Final = 1e-3
"""Speed [m/s] of the translation that is asked instead: no law's inertial term counts at it."""


class Pose(NamedTuple):
    """Place and motion of a body, as the law's exports take them."""

    x: Any
    turn: Any
    velocity: Any
    omega: Any


@exact
def _creep(model, m, t, address, v, w):
    """The speed below which the implicit force falls to zero in this step [m/s]; v and w (3,) are overwritten."""
    found = V_C
    for k in range(instance.head(address).nbody):
        length = header_at(instance.numeric(model, m, instance.numeric_of(address, k)).ctypes.data).gyration
        bodies.twist(t, instance.body(address, k), v, w)
        speed = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        speed += length * np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        found = max(found, CREEP * speed)
    return found


@exact
def _fill(sand, surface, pose, v_c, force, depth):
    """Fill the force on each triangle, body frame, (ntri, 3); their sum, (3,)."""
    x, r, v, w = pose
    exports.tractions(
        sand, surface, x.ctypes.data, r.ctypes.data, v.ctypes.data, w.ctypes.data, force.ctypes.data, depth.ctypes.data
    )
    frame, body = level_frame(bed_at(sand), x, r, v, w), body_at(surface)
    sx = sy = sz = 0.0
    for i in range(body.count):
        c = centre(body, i)
        u = point_velocity(frame, c[0], c[1], c[2])
        square = dot(u, u)
        size = at(body, COLUMN.area, i) * np.sqrt(square / (square + v_c * v_c + TINY))
        for k in range(3):
            force[i, k] *= size
        sx, sy, sz = sx + force[i, 0], sy + force[i, 1], sz + force[i, 2]
    return sx, sy, sz


@exact
def _fill_scaled(sand, surface, pose, wrench, v_c, force, depth):
    """Fill the force on each triangle; the factor by which their sum agrees with the wrench's force."""
    wanted = to_body(pose.turn, wrench[0], wrench[1], wrench[2])
    size = np.sqrt(dot(wanted, wanted))
    found = _fill(sand, surface, pose, v_c, force, depth)
    if dot(found, wanted) < ALIGNED * size * np.sqrt(dot(found, found)) or dot(found, found) == 0.0:
        for k in range(3):
            pose.velocity[k], pose.omega[k] = -SLOW * wrench[k] / size, 0.0
        found = _fill(sand, surface, pose, v_c, force, depth)
    square = dot(found, found)
    return max(dot(found, wanted), 0.0) / square if square > 0.0 else 0.0


@exact
def _in_zone(model, data, m, d, pose, site, surface, force):
    """Sum of the forces that press on the triangles in a site's zone [N]."""
    kind = int32s(pointer(m + model.site_type), pointer(m + model.nsite))[site]
    if kind < _SPHERE or kind > _BOX:
        return 0.0  # MuJoCo's function knows no other zone
    x, turn = pointer(d + data.site_xpos) + 8 * 3 * site, pointer(d + data.site_xmat) + 8 * 9 * site
    size = pointer(m + model.site_size) + 8 * 3 * site
    point, way = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    body, total = body_at(surface), 0.0
    for i in range(body.count):
        n = normal(body, i)
        pressing = -(n[0] * force[i, 0] + n[1] * force[i, 1] + n[2] * force[i, 2])
        if pressing > 0.0:
            c = to_world(pose.turn, *centre(body, i))
            point[0], point[1], point[2] = pose.x[0] + c[0], pose.x[1] + c[1], pose.x[2] + c[2]
            way[0], way[1], way[2] = to_world(pose.turn, n[0], n[1], n[2])
            if external.ray_geom(x, turn, size, point.ctypes.data, way.ctypes.data, kind, 0) >= 0.0:
                total += pressing
    return total


@exact
def _pressed(model, data, m, d, t, address, k, site, is_implicit):
    """The same for the k-th body of the block at an address."""
    body, wrench = instance.body(address, k), instance.wrench(address, k)
    if wrench[0] == 0.0 and wrench[1] == 0.0 and wrench[2] == 0.0:
        return 0.0
    sand = instance.numeric(model, m, instance.head(address).bed).ctypes.data
    surface = instance.numeric(model, m, instance.numeric_of(address, k)).ctypes.data
    n = body_at(surface).count
    memory = take(8 * 4 * n)
    if memory == 0:
        return 0.0
    v, w = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    v_c = _creep(model, m, t, address, v, w) if is_implicit else 0.0
    bodies.twist(t, body, v, w)
    pose = Pose(t.xpos[3 * body : 3 * body + 3], t.xmat[9 * body : 9 * body + 9], v, w)
    force = matrix(memory, n, 3)
    factor = _fill_scaled(sand, surface, pose, wrench, v_c, force, doubles(memory + 8 * 3 * n, n))
    total = factor * _in_zone(model, data, m, d, pose, site, surface, force)
    release(memory)
    return total


@exact
def pressed(model, data, m, d, t, address, site, is_implicit):
    """The sand's pressure in a site's zone times its area, on the site's own body [N]."""
    body = int32s(pointer(m + model.site_bodyid), pointer(m + model.nsite))[site]
    for k in range(instance.head(address).nbody):
        if instance.body(address, k) == body:
            return _pressed(model, data, m, d, t, address, k, site, is_implicit)
    return 0.0
