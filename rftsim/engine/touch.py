"""The sand's share of a `touch` sensor: the pressure on those of its body's triangles that lie in the sensor's zone.

MuJoCo adds up the normal forces of contacts that lie in the site's volume, or from which the way out of the body leads
through it. Here a triangle's centroid is such a contact. The triangles' forces are those at the twist that the law felt
in the step, or that of the moment, and the wrench that was applied may be a mean over the step, so they are scaled to
agree with it.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.engine import bodies, external, instance
from rftsim.engine.layout import CONSTANTS
from rftsim.law import exports
from rftsim.law.body import header_at
from rftsim.law.layout import PRESSED
from rftsim.law.vectors import dot, to_world
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, int32s, matrix, pointer, release, stack_doubles, take
from rftsim.solver import state
from rftsim.solver.newton import OF_FASTEST, V_C

_SPHERE: Final = CONSTANTS["sphere"]
_BOX: Final = CONSTANTS["box"]
_COLUMNS: Final = len(PRESSED)
_SAND: Final = instance.SAND_NUMBERS
ALIGNED: Final = 0.9
"""Cosine between the triangles' force and the wrench's from which on that twist tells how sand presses."""
SLOW: Final = 1e-3
"""Speed [m/s] of the translation that is asked instead: no law's inertial term counts at it."""


class Pose(NamedTuple):
    """Place and motion of a body, as the law's exports take them."""

    x: Any
    turn: Any
    velocity: Any
    omega: Any


@exact
def _least_speed(model, m, t, address, v, w):
    """The speed below which the implicit force falls to zero in this step [m/s]; v and w (3,) are overwritten."""
    found = V_C
    for k in range(instance.head(address).nbody):
        length = header_at(instance.surface(model, m, address, k)).gyration
        bodies.twist(t, instance.body(address, k), v, w)
        found = max(found, OF_FASTEST * (np.sqrt(dot(v, v)) + length * np.sqrt(dot(w, w))))
    return found


@exact
def _fill_felt(m, model, address, k, v, w):
    """Fill v and w, (3,) each, with the twist that the law felt of the k-th body in the step, if it felt any."""
    size = instance.head(address).state_size
    kept = state.kept_at(state.kept(instance.pending(address, size).ctypes.data, pointer(m + model.nv), k))
    felt, any_twist = kept.twist, False
    for i in range(6):
        any_twist = any_twist or felt[i] != 0.0
    if any_twist:
        for i in range(3):
            v[i], w[i] = felt[i], felt[3 + i]


@exact
def _list(sand, surface, pose, v_c, rows, force):
    """Fill rows with the triangles that the sand may press on and their force (3,); how many they are."""
    x, r, v, w = pose
    return exports.pressures(
        sand, surface, x.ctypes.data, r.ctypes.data, v.ctypes.data, w.ctypes.data, v_c, rows.ctypes.data, force
    )


@exact
def _list_scaled(sand, surface, pose, wrench, v_c, rows):
    """The same; how many, and the factor by which their force agrees with the wrench's."""
    at = stack_doubles(3)
    wanted, found = wrench[:3], doubles(at, 3)
    size = np.sqrt(dot(wanted, wanted))
    count = _list(sand, surface, pose, v_c, rows, at)
    if dot(found, found) == 0.0 or dot(found, wanted) < ALIGNED * size * np.sqrt(dot(found, found)):
        for k in range(3):
            pose.velocity[k], pose.omega[k] = -SLOW * wanted[k] / size, 0.0
        count = _list(sand, surface, pose, v_c, rows, at)
    square = dot(found, found)
    return count, max(dot(found, wanted), 0.0) / square if square > 0.0 else 0.0


@exact
def _in_zone(model, data, m, d, pose, site, rows):
    """Sum of the forces that press on the triangles in a site's zone [N]."""
    kind = int32s(pointer(m + model.site_type), pointer(m + model.nsite))[site]
    if kind < _SPHERE or kind > _BOX:
        return 0.0  # MuJoCo's function knows no other zone
    x, turn = pointer(d + data.site_xpos) + 8 * 3 * site, pointer(d + data.site_xmat) + 8 * 9 * site
    size = pointer(m + model.site_size) + 8 * 3 * site
    at, way = stack_doubles(3), stack_doubles(3)
    point, outward, total = doubles(at, 3), doubles(way, 3), 0.0
    for i in range(rows.shape[0]):
        if rows[i, PRESSED.force] > 0.0:
            c = to_world(pose.turn, rows[i, PRESSED.x], rows[i, PRESSED.y], rows[i, PRESSED.z])
            n = to_world(pose.turn, rows[i, PRESSED.nx], rows[i, PRESSED.ny], rows[i, PRESSED.nz])
            for k in range(3):
                point[k], outward[k] = pose.x[k] + c[k], n[k]
            if external.ray_geom(x, turn, size, at, way, kind, 0) >= 0.0:
                total += rows[i, PRESSED.force]
    return total


@exact
def _pressed(model, data, m, d, t, address, k, site, is_implicit):
    """The same for the k-th body of the block at an address."""
    body, wrench = instance.body(address, k), instance.wrench(address, k)
    if wrench[0] == 0.0 and wrench[1] == 0.0 and wrench[2] == 0.0:
        return 0.0
    if instance.is_sound(m, address, instance.head(address).state_size) == 0:
        return np.nan
    sand = stack_doubles(_SAND)
    instance.fill_sand(model, m, address, sand)
    surface = instance.surface(model, m, address, k)
    n = int(header_at(surface).ntri)
    memory = take(8 * _COLUMNS * n)
    if memory == 0:
        return np.nan
    v, w = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    v_c = _least_speed(model, m, t, address, v, w) if is_implicit else 0.0
    bodies.twist(t, body, v, w)
    if is_implicit:
        _fill_felt(m, model, address, k, v, w)
    pose = Pose(t.xpos[3 * body : 3 * body + 3], t.xmat[9 * body : 9 * body + 9], v, w)
    rows = matrix(memory, n, _COLUMNS)
    count, factor = _list_scaled(sand, surface, pose, wrench, v_c, rows)
    total = factor * _in_zone(model, data, m, d, pose, site, rows[:count])
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
