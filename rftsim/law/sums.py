"""The loops over a body's triangles: sums of force and moment, and the tractions themselves.

Each is made for a response of the sand, see `laws`, and a kind of free surface, see `grounds`; they are what everything
else calls.
"""

from typing import Any, NamedTuple

import numpy as np

from rftsim.law import body as bodies
from rftsim.law.frame import point_velocity
from rftsim.law.free_surface import drop, rising
from rftsim.law.grounds import Ground
from rftsim.law.laws import Response
from rftsim.law.layout import PRESSED
from rftsim.law.leading import reach2
from rftsim.law.selection import CAPACITY, FULL, area, centre, choosing, chosen_on_stack, filled_up, normal
from rftsim.law.stress import TINY
from rftsim.law.vectors import larger
from rftsim.machine.compiling import inline, inline_loop, merged


class Wrench(NamedTuple):
    """Force and moment about the body's origin, body frame."""

    fx: Any
    fy: Any
    fz: Any
    tx: Any
    ty: Any
    tz: Any


@merged
def _added(total, g, x, y, z):
    """A wrench and that of a force g at a point."""
    gx, gy, gz = g
    return Wrench(
        total.fx + gx,
        total.fy + gy,
        total.fz + gz,
        total.tx + (y * gz - z * gy),
        total.ty + (z * gx - x * gz),
        total.tz + (x * gy - y * gx),
    )


@inline
def _nothing():
    return Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@merged
def _force(stress, weight, held):
    """The force of a stress whose resistance counts by a depth times an area, its inertial term by `held` [N]."""
    (sx, sy, sz), (mx, my, mz) = stress.per_depth, stress.along
    return weight * sx + held * mx, weight * sy + held * my, weight * sz + held * mz


def sums(response: Response, ground: Ground) -> Any:
    """Make the sum of force and moment over a packed body, at the velocity of the moment."""
    choose, stress, felt_depth = choosing(response, ahead=False), response.stress, response.felt_depth

    @inline_loop
    def add(chosen, n, frame, medium, edge, total):
        for i in range(n):
            x, y, z = centre(chosen, i)
            v, a = point_velocity(frame, x, y, z), area(chosen, i)
            deep, up, _ = ground.found(chosen, 0, CAPACITY, i, x, y, z, frame)
            deep -= drop(x, y, z, frame)
            s = stress(normal(chosen, i), v, up, ground.local(frame, up), medium, edge)
            held = a * s.inertia if deep > 0.0 else 0.0
            total = _added(total, _force(s, a * larger(felt_depth(deep, medium), 0.0), held), x, y, z)
        return total

    @inline_loop
    def summed(body, frame, sand, medium, edge):
        """The sand's wrench on a body."""
        chosen, n, reach, total, last = chosen_on_stack(), 0, reach2(edge), _nothing(), 0
        field = ground.field(sand)
        while last < body.count:
            n, last = choose(body, last, frame, 0.0, reach, 0.0, chosen, n)
            if n > FULL or last >= body.count:
                n = filled_up(chosen, n)
                ground.settle(chosen, CAPACITY, n, frame, field)
                total, n = add(chosen, n, frame, medium, edge, total), 0
        return total

    return summed


def sums_ahead(response: Response, ground: Ground) -> Any:
    """Make the sums of a law made continuous at rest, now and at the depths after a time h, and the mean depth.

    The resistance is scaled by |v| / sqrt(|v|^2 + v_c^2): the force of a law that knows only the direction of motion
    falls to zero at rest.
    """
    choose, stress, felt_depth = choosing(response, ahead=True), response.stress, response.felt_depth

    @inline_loop
    def add(chosen, n, frame, medium, edge, v_c, h, now, after, volumes):
        volume, moment = volumes
        for i in range(n):
            (x, y, z), n_hat, a = centre(chosen, i), normal(chosen, i), area(chosen, i)
            v = point_velocity(frame, x, y, z)
            speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            slow = np.sqrt(speed2 / (speed2 + v_c * v_c + TINY))
            deep, up, rise = ground.found(chosen, 0, CAPACITY, i, x, y, z, frame)
            deep -= drop(x, y, z, frame)
            s = stress(n_hat, v, up, ground.local(frame, up), medium, edge)
            later = deep - h * rising(v, rise)
            lowest = larger(larger(deep, later), 0.0)
            volume, moment = volume + a * lowest, moment + a * lowest * lowest
            held = a * s.inertia if deep > 0.0 else 0.0
            now = _added(now, _force(s, slow * a * larger(felt_depth(deep, medium), 0.0), held), x, y, z)
            held = a * s.inertia if later > 0.0 else 0.0
            after = _added(after, _force(s, slow * a * larger(felt_depth(later, medium), 0.0), held), x, y, z)
        return now, after, (volume, moment)

    @inline_loop
    def summed(body, frame, sand, medium, edge, v_c, h, margin):
        """The wrench at the present depths, that at the later ones, and the mean of the triangles' larger depths [m].

        They count by themselves, as the force grows with the depth. No triangle moves further than the margin.
        """
        chosen, n, reach, last, field = chosen_on_stack(), 0, reach2(edge), 0, ground.field(sand)
        now, after, volumes = _nothing(), _nothing(), (0.0, 0.0)
        while last < body.count:
            n, last = choose(body, last, frame, margin, reach, h, chosen, n)
            if n > FULL or last >= body.count:
                n = filled_up(chosen, n)
                ground.settle(chosen, CAPACITY, n, frame, field)
                now, after, volumes = add(chosen, n, frame, medium, edge, v_c, h, now, after, volumes)
                n = 0
        return now, after, volumes[1] / (volumes[0] + TINY)

    return summed


def pressures(response: Response, ground: Ground) -> Any:
    """Make the loop that lists the triangles which the sand can act on, with the force that presses on each."""
    choose, stress, felt_depth = choosing(response, ahead=False), response.stress, response.felt_depth

    @inline_loop
    def add(chosen, n, frame, medium, edge, v_c, out, total):
        for i in range(n):
            (x, y, z), (nx, ny, nz), a = centre(chosen, i), normal(chosen, i), area(chosen, i)
            v = point_velocity(frame, x, y, z)
            speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            slow = np.sqrt(speed2 / (speed2 + v_c * v_c + TINY))
            deep, up, _ = ground.found(chosen, 0, CAPACITY, i, x, y, z, frame)
            deep -= drop(x, y, z, frame)
            s = stress((nx, ny, nz), v, up, ground.local(frame, up), medium, edge)
            held = a * s.inertia if deep > 0.0 else 0.0
            g = _force(s, slow * a * larger(felt_depth(deep, medium), 0.0), held)
            out[i, PRESSED.x], out[i, PRESSED.y], out[i, PRESSED.z] = x, y, z
            out[i, PRESSED.nx], out[i, PRESSED.ny], out[i, PRESSED.nz] = nx, ny, nz
            out[i, PRESSED.force] = larger(-(g[0] * nx + g[1] * ny + g[2] * nz), 0.0)
            total = _added(total, g, x, y, z)
        return total

    @inline_loop
    def listed(body, frame, sand, medium, edge, v_c, out):
        """Fill rows of out with columns PRESSED; how many there are, and the wrench on all of them."""
        chosen, n, reach, last, field = chosen_on_stack(), 0, reach2(edge), 0, ground.field(sand)
        count, total = 0, _nothing()
        while last < body.count:
            n, last = choose(body, last, frame, 0.0, reach, 0.0, chosen, n)
            if n > FULL or last >= body.count:
                ground.settle(chosen, CAPACITY, n, frame, field)
                total = add(chosen, n, frame, medium, edge, v_c, out[count:], total)
                count, n = count + n, 0
        return count, total

    return listed


def tractions(response: Response, ground: Ground) -> Any:
    """Make the loop that fills each triangle's stress [Pa], (ntri, 3), and effective depth [m], (ntri,)."""
    stress, felt_depth = response.stress, response.felt_depth

    @inline_loop
    def filled(body, frame, sand, medium, edge, stress_out, depth_out):
        field = ground.field(sand)
        for i in range(depth_out.size):
            x, y, z = bodies.centre(body, i)
            v = point_velocity(frame, x, y, z)
            deep, up, _ = ground.look(x, y, z, bodies.normal(body, i), frame, field)
            deep -= drop(x, y, z, frame)
            s = stress(bodies.normal(body, i), v, up, ground.local(frame, up), medium, edge)
            held = s.inertia if deep > 0.0 else 0.0
            depth_out[i] = deep
            force = _force(s, larger(felt_depth(deep, medium), 0.0), held)
            stress_out[i, 0], stress_out[i, 1], stress_out[i, 2] = force

    return filled
