"""The drop of the free surface behind a driven wheel, [Agarwal] section 4.6.2."""

from typing import Any

import numpy as np
from numba import carray, types

from rftsim.law import body as bodies
from rftsim.law.frame import behind, point_velocity
from rftsim.law.free_surface import plane_depth
from rftsim.law.grounds import Ground
from rftsim.law.laws import Response
from rftsim.law.layout import BLOCK, NO_RIM
from rftsim.law.leading import may_lead
from rftsim.law.vectors import cross, dot, larger, smaller
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.memory import on_stack

_angles, _least, _most = (on_stack(BLOCK, types.float64) for _ in range(3))


@inline
def _vector(field):
    """A record's vector as a tuple, (3,)."""
    return field[0], field[1], field[2]


def dropped(response: Response, ground: Ground) -> Any:
    """Make what gives a body's frame with the free surface as its wheel has left it, if it is one.

    delta h = r (r omega^2 / g) over the rear half of the contact arc: the arc that the submerged leading triangles of
    the rim span at the wheel's centre, halved by angle.
    """
    normal_speed, is_relief = response.normal_speed, ground.is_relief

    @inline_loop
    def rim_angles(body, start, count, frame, field, down, out):
        """Fill out with the angle of each of count triangles that is rim, submerged and leading; or NO_RIM."""
        for i in range(count):
            x, y, z = bodies.centre(body, start + i)
            v = point_velocity(frame, x, y, z)
            leads = may_lead(normal_speed(bodies.normal(body, start + i), v, frame), 0.0, 0.0) > 0.0
            on_rim = bodies.rim_angle(body, start + i)
            angle = on_rim - down
            angle -= 2.0 * np.pi if angle > np.pi else 0.0
            angle += 2.0 * np.pi if angle < -np.pi else 0.0
            out[i] = angle if (plane_depth(x, y, z, frame) > 0.0) & leads & (on_rim < NO_RIM) else NO_RIM
        if is_relief:
            for i in range(count):
                if out[i] < NO_RIM:
                    x, y, z = bodies.centre(body, start + i)
                    deep = ground.look(x, y, z, bodies.normal(body, start + i), frame, field)[0]
                    out[i] = out[i] if deep > 0.0 else NO_RIM

    @inline
    def arc(body, frame, field, down):
        """First and last of the rim's submerged leading triangles, by their angle from down on; last < first: none."""
        least, most = carray(_least(), (BLOCK,)), carray(_most(), (BLOCK,))
        angles = carray(_angles(), (BLOCK,))
        for i in range(BLOCK):
            angles[i] = least[i] = NO_RIM
            most[i] = -NO_RIM
        for block in range((body.count + BLOCK - 1) // BLOCK):
            if bodies.block_is_clear(body, block, frame, 0.0):
                continue
            start = BLOCK * block
            rim_angles(body, start, min(BLOCK, body.count - start), frame, field, down, angles)
            for i in range(BLOCK):  # lane by lane: a minimum over all waits for each before it
                least[i] = smaller(angles[i], least[i])
                most[i] = larger(angles[i] if angles[i] < NO_RIM else -NO_RIM, most[i])
        first, last = least[0], most[0]
        for i in range(1, BLOCK):
            first, last = smaller(least[i], first), larger(most[i], last)
        return first, last

    @inline
    def half_space(body, frame, field, g):
        """The half-space whose free surface has dropped, (4,), and by how much [m]; zeros where it has not."""
        header, nothing = bodies.header_at(body.address), ((0.0, 0.0, 0.0, 0.0), 0.0)
        axis, centre, start = _vector(header.wheel_axis), _vector(header.wheel_centre), _vector(header.rim_start)
        spin, along = dot(frame.omega, axis), dot(frame.up, axis)
        level = np.sqrt(max(1.0 - along * along, 0.0))
        if spin == 0.0 or level < 1e-3:  # a wheel at rest, or lying on its side
            return nothing
        onto = cross(axis, frame.up)
        sign = (1.0 if spin > 0.0 else -1.0) / level
        ahead = sign * onto[0], sign * onto[1], sign * onto[2]
        down = (
            (along * axis[0] - frame.up[0]) / level,
            (along * axis[1] - frame.up[1]) / level,
            (along * axis[2] - frame.up[2]) / level,
        )
        first, last = arc(body, frame, field, np.arctan2(dot(down, cross(axis, start)), dot(down, start)))
        if last < first:
            return nothing
        middle = -0.5 * (first + last) if spin > 0.0 else 0.5 * (first + last)
        s, c = np.sin(middle), np.cos(middle)
        onward = c * ahead[0] - s * down[0], c * ahead[1] - s * down[1], c * ahead[2] - s * down[2]
        radius = header.wheel_radius
        offset = header.edge_on * radius - dot(onward, centre)  # rounding must not choose for a triangle on the middle
        return (onward[0], onward[1], onward[2], offset), radius * radius * spin * spin / g

    @inline
    def drop(body, frame, sand, medium):
        if medium.dynamic == 0.0 or bodies.header_at(body.address).wheel_radius == 0.0:
            return frame
        rear, by = half_space(body, frame, ground.field(sand), medium.g)
        return behind(frame, rear, by)

    return drop
