"""Sand and surface from their packed form, for compiled code."""

import numpy as np
from numba import carray, njit, types

from rftsim import kernels, packed
from rftsim.choice import FASTMATH
from rftsim.kernels import Frame, Medium
from rftsim.memory import on_stack, tuples
from rftsim.packed import BLOCK, BOX, COLUMNS, HEADER, SAND_FIELDS, TERMS

size_of = njit(forceinline=True)(packed.size_of)


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
def block_is_clear(body, block, frame, margin):
    """Whether a block of triangles lies more than a margin above the undisturbed sand."""
    start, r = HEADER + COLUMNS * int(body[14]) + BOX * block, frame.rise
    middle = r[0] * body[start] + r[1] * body[start + 1] + r[2] * body[start + 2]
    below = abs(r[0]) * body[start + 3] + abs(r[1]) * body[start + 4] + abs(r[2]) * body[start + 5]
    return middle - below >= frame.height + margin


@njit(forceinline=True)
def next_run(body, start, count, frame, margin):
    """The next triangles from start on whose blocks are not clear, first to last; both are count where none are."""
    first = start
    while first < count and block_is_clear(body, first // BLOCK, frame, margin):
        first += BLOCK
    last = first
    while last < count and not block_is_clear(body, last // BLOCK, frame, margin):
        last += BLOCK
    return min(first, count), min(last, count)


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


@njit(forceinline=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
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


_angles = on_stack(BLOCK, types.float64)
_NO_RIM = 9.0


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
    cross = _cross(axis, frame.up)
    sign = (1.0 if spin > 0.0 else -1.0) / level
    ahead = sign * cross[0], sign * cross[1], sign * cross[2]
    down = (
        (along * axis[0] - frame.up[0]) / level,
        (along * axis[1] - frame.up[1]) / level,
        (along * axis[2] - frame.up[2]) / level,
    )
    first, last, angles = 3.0, -3.0, carray(_angles(), (BLOCK,))
    count = int(body[14])
    for start in range(0, count, BLOCK):
        if block_is_clear(body, start // BLOCK, frame, 0.0):
            continue
        end = min(start + BLOCK, count)
        _rim_angles(columns(body), start, end, frame, axis, centre, ahead, down, plane, sand[1], angles)
        for i in range(end - start):
            first = kernels.smaller(angles[i], first)
            last = kernels.larger(angles[i] if angles[i] < _NO_RIM else last, last)
    if last < first:
        return nothing
    middle = 0.5 * (_angle(first) + _angle(last))
    s, c = np.sin(middle), np.cos(middle)
    onward = (
        c * ahead[0] - s * down[0],
        c * ahead[1] - s * down[1],
        c * ahead[2] - s * down[2],
    )
    radius = body[13]
    offset = body[0] * radius - _dot(onward, centre)  # rounding must not choose for a triangle on the middle
    return (onward[0], onward[1], onward[2], offset), radius * radius * spin * spin / sand[15]


@njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
def _rim_angles(body_columns, start, end, frame, axis, centre, ahead, down, plane, planar, out):
    """Fill out with the `_diamond` of each triangle that is rim, submerged and leading; or _NO_RIM."""
    cx, cy, cz, nx, ny, nz, _ = body_columns
    for i in range(start, end):
        x, y, z = cx[i], cy[i], cz[i]
        n, p = (nx[i], ny[i], nz[i]), (x - centre[0], y - centre[1], z - centre[2])
        wv = _cross(frame.omega, (x, y, z))
        v = frame.v0[0] + wv[0], frame.v0[1] + wv[1], frame.v0[2] + wv[2]
        depth = frame.height - _dot(frame.up, (x, y, z))
        leading = _dot(n, v) - planar * _dot(n, plane) * _dot(v, plane)
        counts = (depth > 0.0) & (leading > 0.0) & (abs(_dot(n, axis)) <= 0.7)
        angle = _diamond(_dot(p, ahead), _dot(p, down))
        out[i - start] = angle if counts else _NO_RIM


@njit(error_model="numpy", forceinline=True)
def _diamond(s, c):
    """A number that grows with the angle atan2(s, c), in (-2, 2]; no trigonometry."""
    t = s / (abs(s) + abs(c) + kernels.TINY)
    side = 2.0 if s >= 0.0 else -2.0
    return t if c >= 0.0 else side - t


@njit(forceinline=True)
def _angle(t):
    """The angle whose _diamond is t."""
    c = 1.0 - abs(t)
    s = t if abs(t) <= 1.0 else (2.0 - t if t > 0.0 else -2.0 - t)
    return np.arctan2(s, c)
