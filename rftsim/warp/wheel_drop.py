"""The drop of the free surface behind a driven wheel, [Agarwal] section 4.6.2, as a kernel of Warp."""

import warp as wp

from rftsim.law.layout import NO_RIM
from rftsim.warp.frames import Sands, State, frame_of
from rftsim.warp.surfaces import Surfaces

_NO_RIM = wp.constant(NO_RIM)


@wp.kernel(enable_backward=False)
def find_drop(
    surfaces: Surfaces,
    sands: Sands,
    state: State,
    xpos: wp.array2d(dtype=wp.vec3),
    xmat: wp.array2d(dtype=wp.mat33),
):
    """Find the half-space whose free surface has dropped behind each wheel, and by how much, over (nworld, nbody).

    delta h = r (r omega^2 / g) over the rear half of the contact arc: the arc that the submerged leading triangles of
    the rim span at the wheel's centre, halved by angle.
    """
    world, body = wp.tid()
    state.drop[world, body] = 0.0
    radius = surfaces.radius[body]
    if radius == 0.0:
        return
    own, axis, hub = surfaces.body[body], surfaces.axis[body], surfaces.hub[body]
    f = frame_of(sands, state, xpos[world, own], xmat[world, own], world, body)
    spin, along = wp.dot(f.omega, axis), wp.dot(f.up, axis)
    level = wp.sqrt(wp.max(1.0 - along * along, 0.0))
    if spin == 0.0 or level < 1e-3:  # a wheel at rest, or lying on its side
        return
    sign = wp.where(spin > 0.0, 1.0, -1.0)
    ahead, down = wp.cross(axis, f.up) * (sign / level), (along * axis - f.up) / level
    start = surfaces.start[body]
    lowest = wp.atan2(wp.dot(down, wp.cross(axis, start)), wp.dot(down, start))
    first, last = float(_NO_RIM), -float(_NO_RIM)
    for i in range(surfaces.first[body], surfaces.first[body + 1]):
        x, on_rim = surfaces.centre[i], surfaces.angle[i]
        outward = wp.dot(surfaces.normal[i], f.velocity + wp.cross(f.omega, x))
        if on_rim < _NO_RIM and f.height - wp.dot(f.up, x) > 0.0 and outward > 0.0:
            angle = on_rim - lowest
            angle -= wp.where(angle > wp.pi, 2.0 * wp.pi, 0.0)
            angle += wp.where(angle < -wp.pi, 2.0 * wp.pi, 0.0)
            first = wp.min(first, angle)
            last = wp.max(last, angle)
    if last < first:
        return
    middle = -0.5 * sign * (first + last)
    onward = wp.cos(middle) * ahead - wp.sin(middle) * down
    offset = surfaces.edge_on[body] * radius - wp.dot(onward, hub)
    state.rear[world, body] = wp.vec4(onward[0], onward[1], onward[2], offset)
    state.drop[world, body] = radius * radius * spin * spin / sands.g[world % sands.g.shape[0]]
