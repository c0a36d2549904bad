"""Sand and surface from their packed form, for compiled code."""

import numpy as np
from numba import carray, njit, types

from rftsim.law import kernels, layout
from rftsim.law.kernels import Frame, Medium
from rftsim.law.layout import BLOCK, BOX, COLUMNS, HEADER, NO_RIM, SAND_FIELDS, TERMS
from rftsim.law.selection import block_is_clear
from rftsim.machine.memory import on_stack, peek, tuples
from rftsim.solver.linear_algebra import FASTMATH

size_of = njit(forceinline=True)(layout.size_of)


@njit(forceinline=True)
def columns(body):
    """The columns of a packed surface: centre (3), normal (3), area; views, each (ntri,)."""
    n = int(body[14])
    start = HEADER
    return (
        body[start : start + n],
        body[start + n : start + 2 * n],
        body[start + 2 * n : start + 3 * n],
        body[start + 3 * n : start + 4 * n],
        body[start + 4 * n : start + 5 * n],
        body[start + 5 * n : start + 6 * n],
        body[start + 6 * n : start + 7 * n],
    )


@njit(forceinline=True)
def to_world(xmat, x, y, z):
    """Rotate a vector from the body to the world frame; xmat is row-major, (9,)."""
    return (
        xmat[0] * x + xmat[1] * y + xmat[2] * z,
        xmat[3] * x + xmat[4] * y + xmat[5] * z,
        xmat[6] * x + xmat[7] * y + xmat[8] * z,
    )


@njit(forceinline=True)
def to_body(xmat, x, y, z):
    """Rotate a vector from the world to the body frame."""
    return (
        xmat[0] * x + xmat[3] * y + xmat[6] * z,
        xmat[1] * x + xmat[4] * y + xmat[7] * z,
        xmat[2] * x + xmat[5] * y + xmat[8] * z,
    )


@njit(fastmath=FASTMATH, forceinline=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(fastmath=FASTMATH, forceinline=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def is_clear(sand, body, xpos, xmat):
    """Whether the body's bounding box lies wholly above the sand."""
    up = to_body(xmat, sand[3], sand[4], sand[5])
    lowest = sand[3] * xpos[0] + sand[4] * xpos[1] + sand[5] * xpos[2] - sand[6]
    for k in range(3):
        lowest += min(up[k] * body[1 + k], up[k] * body[4 + k])
    return lowest >= 0.0


@njit(forceinline=True)
def lowest_corner(body, frame):
    """Depth of the lowest corner of the body's bounding box [m]."""
    r, depth = frame.rise, frame.height
    for k in range(3):
        depth -= min(r[k] * body[1 + k], r[k] * body[4 + k])
    return depth


_terms = tuples(TERMS, types.float64)


@njit(forceinline=True)
def medium_of(sand, body):
    """The medium of a packed sand as its law sees it."""
    xi = sand[11] if sand[1] != 0.0 else sand[10]
    lambda_rho = sand[14] * sand[13] if sand[2] != 0.0 else 0.0
    first = sand.ctypes.data + 8 * len(SAND_FIELDS)
    table = _terms(first), _terms(first + 8 * TERMS), _terms(first + 16 * TERMS)
    return Medium(xi, sand[12], lambda_rho, body[0], kernels.STEP, table)


@njit(forceinline=True)
def frame_of(sand, body, xpos, xmat, velocity, omega):
    """The frame of a body at xpos, xmat whose origin moves with velocity and which turns with omega, world frame."""
    v0 = to_body(xmat, velocity[0], velocity[1], velocity[2])
    w = to_body(xmat, omega[0], omega[1], omega[2])
    up = to_body(xmat, sand[3], sand[4], sand[5])
    plane = to_body(xmat, sand[7], sand[8], sand[9])
    height = sand[6] - (sand[3] * xpos[0] + sand[4] * xpos[1] + sand[5] * xpos[2])
    frame = Frame(v0, w, up, up, _cross(plane, up), height, (0.0, 0.0, 0.0, 0.0), 0.0)
    if sand[2] == 0.0 or body[13] == 0.0:
        return frame
    rear, drop = _structural(sand, body, frame, plane)
    return Frame(v0, w, up, up, frame.forward, height, rear, drop)


_angles, _least, _most = (on_stack(BLOCK, types.float64) for _ in range(3))


@njit(forceinline=True)
def _structural(sand, body, frame, plane):
    """The half-space behind a driven wheel where the free surface has dropped, and by how much.

    delta h = r (r omega^2 / g), [Agarwal] section 4.6.2, over the rear half of the contact arc: the arc that the
    submerged leading triangles of the rim span at the wheel's centre, halved by angle.
    """
    nothing = (0.0, 0.0, 0.0, 0.0), 0.0
    axis = body[7], body[8], body[9]
    centre = body[10], body[11], body[12]
    spin = _dot(frame.omega, axis)
    along = _dot(frame.up, axis)
    level = np.sqrt(max(1.0 - along * along, 0.0))
    if spin == 0.0 or level < 1e-3:  # a wheel at rest, or lying on its side
        return nothing
    cross, start = _cross(axis, frame.up), (body[16], body[17], body[18])
    sign = (1.0 if spin > 0.0 else -1.0) / level
    ahead = sign * cross[0], sign * cross[1], sign * cross[2]
    down = (
        (along * axis[0] - frame.up[0]) / level,
        (along * axis[1] - frame.up[1]) / level,
        (along * axis[2] - frame.up[2]) / level,
    )
    first, last = _arc(body, frame, plane, sand[1], np.arctan2(_dot(down, _cross(axis, start)), _dot(down, start)))
    if last < first:
        return nothing
    middle = -0.5 * (first + last) if spin > 0.0 else 0.5 * (first + last)
    s, c = np.sin(middle), np.cos(middle)
    onward = (
        c * ahead[0] - s * down[0],
        c * ahead[1] - s * down[1],
        c * ahead[2] - s * down[2],
    )
    radius = body[13]
    offset = body[0] * radius - _dot(onward, centre)  # rounding must not choose for a triangle on the middle
    return (onward[0], onward[1], onward[2], offset), radius * radius * spin * spin / sand[15]


@njit(forceinline=True)
def _arc(body, frame, plane, planar, down):
    """First and last of the rim's submerged leading triangles, by their angle from down on; last < first where none."""
    least, most = carray(_least(), (BLOCK,)), carray(_most(), (BLOCK,))
    angles = carray(_angles(), (BLOCK,))
    for i in range(BLOCK):
        angles[i] = least[i] = NO_RIM
        most[i] = -NO_RIM
    count = int(body[14])
    for block in range((count + BLOCK - 1) // BLOCK):
        if block_is_clear(body, block, frame, 0.0):
            continue
        start = BLOCK * block
        _rim_angles(body, start, min(BLOCK, count - start), frame, plane, planar, down, angles)
        for i in range(BLOCK):  # lane by lane: a minimum over all waits for each before it
            least[i] = kernels.smaller(angles[i], least[i])
            most[i] = kernels.larger(angles[i] if angles[i] < NO_RIM else -NO_RIM, most[i])
    first, last = least[0], most[0]
    for i in range(1, BLOCK):
        first, last = kernels.smaller(least[i], first), kernels.larger(most[i], last)
    return first, last


@njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
def _rim_angles(body, start, count, frame, plane, planar, down, out):
    """Fill out with the angle of each of count triangles that is rim, submerged and leading; or NO_RIM."""
    size, at = int(body[14]), HEADER + start
    angles = HEADER + COLUMNS * size + BOX * ((size + BLOCK - 1) // BLOCK) + start
    for i in range(count):
        x, y, z = peek(body, at + i), peek(body, at + i + size), peek(body, at + i + 2 * size)
        n = peek(body, at + i + 3 * size), peek(body, at + i + 4 * size), peek(body, at + i + 5 * size)
        wv = _cross(frame.omega, (x, y, z))
        v = frame.v0[0] + wv[0], frame.v0[1] + wv[1], frame.v0[2] + wv[2]
        depth = frame.height - _dot(frame.up, (x, y, z))
        leading = _dot(n, v) - planar * _dot(n, plane) * _dot(v, plane)
        on_rim = peek(body, angles + i)
        angle = on_rim - down
        angle -= 2.0 * np.pi if angle > np.pi else 0.0
        angle += 2.0 * np.pi if angle < -np.pi else 0.0
        out[i] = angle if (depth > 0.0) & (leading > 0.0) & (on_rim < NO_RIM) else NO_RIM
