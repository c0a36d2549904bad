"""The force laws, compiled: stress on one triangle, and the sums over a body.

Every law is one function from a triangle's outward normal, velocity and depth to the stress on it; `_sums` and
`_tractions` make from it the compiled loops that everything else calls. No angle is formed: projections of the normal
and the velocity suffice. All vectors are in the body frame, so that no triangle is rotated.

The sums carry `fastmath` without its NaN and infinity flags: reordering is what lets LLVM vectorise them, while a NaN
must stay one.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from rftsim import tables

FASTMATH = {"reassoc", "contract", "arcp", "nsz"}
"""Floating-point liberties of the compiled loops."""

TINY = 1e-300

_C3 = tables.columns(tables.TABLE_C3)
_C4 = tables.columns(tables.TABLE_C4)
_T31 = tuple(tables.TABLE_3_1[key] for key in ("A00", "A10", "B11", "B01", "Bm11", "C11", "C01", "Cm11", "D10"))


class Frame(NamedTuple):
    """What one body's triangles have in common during one evaluation; vectors in the body frame."""

    v0: Any
    """Velocity of the body's origin [m/s], (3,)."""
    omega: Any
    """Angular velocity [rad/s], (3,)."""
    up: Any
    """Normal of the free surface, (3,)."""
    forward: Any
    """Horizontal axis of the plane of motion of the 2D laws, (3,)."""
    height: Any
    """Depth of the body's origin below the free surface [m]."""
    rear: Any
    """Half-space whose free surface has dropped: normal (3,) and offset, empty where all zero."""
    drop: Any
    """Drop of the free surface there, delta h of [Agarwal] section 4.6.2 [m]."""


class Medium(NamedTuple):
    """The sand's parameters as a law needs them."""

    xi: Any
    """xi_n (3D laws) or zeta (2D laws) [N/m^3]."""
    mu_surf: Any
    """Friction between sand and surface [-]."""
    lambda_rho: Any
    """lambda rho_c of the inertial term [kg/m^3]; zero for the quasi-static laws."""
    edge_on: Any
    """Rounding of the normals [-]: n.v_hat down to minus this counts as leading, n.up up to this as facing down."""


@njit(forceinline=True)
def cubic(c, x1, x2, x3):
    """A column of [Agarwal] Table C.3, in the order of its rows, by Horner's scheme."""
    return (
        c[0]
        + x1 * (c[1] + x1 * (c[4] + x1 * c[10] + x2 * c[14] + x3 * c[17]) + x2 * (c[7] + x2 * c[13] + x3 * c[19]))
        + x2 * (c[2] + x2 * (c[5] + x2 * c[11] + x3 * c[16]) + x3 * (c[8] + x3 * c[15]))
        + x3 * (c[3] + x1 * c[9] + x3 * (c[6] + x3 * c[12] + x1 * c[18]))
    )


@njit(forceinline=True)
def quartic(c, x1, x2, x3):
    """A column of [Agarwal] Table C.4: Table C.3's monomials first, then those of fourth degree."""
    y1, y2, y3 = x1 * x1, x2 * x2, x3 * x3
    return (
        cubic(c, x1, x2, x3)
        + y1 * (c[20] * y1 + c[29] * y2 + c[30] * y3 + c[32] * x2 * x3)
        + y2 * (c[21] * y2 + c[31] * y3 + c[33] * x1 * x3)
        + y3 * (c[22] * y3 + c[34] * x1 * x2)
        + x1 * (y1 * (c[23] * x2 + c[24] * x3) + c[25] * y2 * x2 + c[27] * y3 * x3)
        + x2 * x3 * (c[26] * y2 + c[28] * y3)
    )


def _stress_3d(fit: Any, c: Any) -> Any:
    c1, c2, c3 = c

    @njit(forceinline=True)
    def stress(nx, ny, nz, vx, vy, vz, depth, frame, medium):
        """Stress of 3D-RFT, [Agarwal] eqs. (5.5), (5.6), (5.9), with the inertial term of eq. (4.2)."""
        ux, uy, uz = frame.up
        speed2 = vx * vx + vy * vy + vz * vz
        inverse = 1.0 / np.sqrt(speed2 + TINY)
        nu = nx * ux + ny * uy + nz * uz
        vu = (vx * ux + vy * uy + vz * uz) * inverse
        vn_ = vx * nx + vy * ny + vz * nz
        vn = vn_ * inverse
        side = 1.0 if nu <= medium.edge_on else -1.0  # m = side * n faces downward; rounding must not choose for a wall
        x1 = -vu
        x2 = -side * nu
        x3 = side * vn
        f1 = fit(c1, x1, x2, x3)
        f2 = fit(c2, x1, x2, x3)
        f3 = fit(c3, x1, x2, x3)
        a_n = side * f1 + f2 * vn - f3 * nu
        a2 = f1 * f1 + f2 * f2 + f3 * f3 + 2.0 * (f1 * f2 * x3 + f1 * f3 * x2 + f2 * f3 * x1)
        a_t = np.sqrt(max(a2 - a_n * a_n, TINY))
        slip = min(medium.mu_surf * abs(a_n) / a_t, 1.0)
        leading = 1.0 if (vn >= -medium.edge_on) and (speed2 > 0.0) else 0.0
        scale = leading * medium.xi * max(depth, 0.0)
        submerged = leading if depth > 0.0 else 0.0
        along_n = scale * (slip * (side * f1 - a_n) - abs(a_n)) - submerged * medium.lambda_rho * vn_ * vn_
        along_v = scale * slip * f2 * inverse
        along_u = -scale * slip * f3
        return (
            along_n * nx + along_v * vx + along_u * ux,
            along_n * ny + along_v * vy + along_u * uy,
            along_n * nz + along_v * vz + along_u * uz,
        )

    return stress


@njit(forceinline=True)
def _stress_2d(nx, ny, nz, vx, vy, vz, depth, frame, medium):
    """Stress of 2D-RFT, [Agarwal] eqs. (3.1) to (3.4), with the inertial term of eq. (4.2).

    Per unit of the triangle's whole area: the projection of its area vector onto the plane of motion is taken here.
    Unlike [Agarwal], the horizontal response opposes the motion: with the printed sign it would add energy.
    """
    a00, a10, b11, b01, bm11, c11, c01, cm11, d10 = _T31
    ux, uy, uz = frame.up
    ex, ey, ez = frame.forward
    px = nx * ex + ny * ey + nz * ez
    pz = nx * ux + ny * uy + nz * uz
    projected = np.sqrt(px * px + pz * pz)
    flat = 1.0 / (projected + TINY)
    px *= flat
    pz *= flat
    wx = vx * ex + vy * ey + vz * ez
    wz = vx * ux + vy * uy + vz * uz
    speed2 = wx * wx + wz * wz
    inverse = 1.0 / np.sqrt(speed2 + TINY)
    mirror = 1.0 if wx >= 0.0 else -1.0
    side = 1.0 if pz <= 0.0 else -1.0
    mx = mirror * side * px  # sin beta
    mz = side * pz  # -cos beta
    cos_gamma = mirror * wx * inverse
    sin_gamma = -wz * inverse
    cos_2beta = mz * mz - mx * mx
    sin_2beta = -2.0 * mx * mz
    cc = cos_2beta * cos_gamma
    ss = sin_2beta * sin_gamma
    sc = sin_2beta * cos_gamma
    cs = cos_2beta * sin_gamma
    alpha_z = a00 + a10 * cos_2beta + b01 * sin_gamma + b11 * (sc + cs) + bm11 * (cs - sc)
    alpha_x = c01 * cos_gamma + c11 * (cc - ss) + cm11 * (cc + ss) + d10 * sin_2beta
    vn_ = px * wx + pz * wz
    leading = projected if (vn_ * inverse >= -medium.edge_on) and (speed2 > 0.0) else 0.0
    scale = leading * medium.xi * max(depth, 0.0)
    submerged = leading if depth > 0.0 else 0.0
    inertia = submerged * medium.lambda_rho * vn_ * vn_
    along_e = -scale * mirror * alpha_x - inertia * px
    along_u = scale * alpha_z - inertia * pz
    return along_e * ex + along_u * ux, along_e * ey + along_u * uy, along_e * ez + along_u * uz


@njit(forceinline=True)
def _depth(x, y, z, frame):
    """Effective depth of a point below the free surface, [Agarwal] eq. (4.2)."""
    ux, uy, uz = frame.up
    rx, ry, rz, r0 = frame.rear
    drop = frame.drop if rx * x + ry * y + rz * z + r0 < 0.0 else 0.0
    return frame.height - (ux * x + uy * y + uz * z) - drop


def _sums(stress: Any) -> Any:
    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def sums(cx, cy, cz, nx, ny, nz, area, first, last, frame, medium):
        """Force [N] and moment [N m] about the body's origin on triangles first to last, as six numbers."""
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        fx = fy = fz = tx = ty = tz = 0.0
        for i in range(first, last):
            x, y, z = cx[i], cy[i], cz[i]
            sx, sy, sz = stress(
                nx[i],
                ny[i],
                nz[i],
                v0x + wy * z - wz * y,
                v0y + wz * x - wx * z,
                v0z + wx * y - wy * x,
                _depth(x, y, z, frame),
                frame,
                medium,
            )
            gx, gy, gz = area[i] * sx, area[i] * sy, area[i] * sz
            fx += gx
            fy += gy
            fz += gz
            tx += y * gz - z * gy
            ty += z * gx - x * gz
            tz += x * gy - y * gx
        return fx, fy, fz, tx, ty, tz

    return sums


def _tractions(stress: Any) -> Any:
    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def tractions(cx, cy, cz, nx, ny, nz, frame, medium, stress_out, depth_out):
        """Stress [Pa], (ntri, 3), and effective depth [m], (ntri,), of each triangle."""
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        for i in range(depth_out.size):
            x, y, z = cx[i], cy[i], cz[i]
            vx = v0x + wy * z - wz * y
            vy = v0y + wz * x - wx * z
            vz = v0z + wx * y - wy * x
            depth_out[i] = _depth(x, y, z, frame)
            sx, sy, sz = stress(nx[i], ny[i], nz[i], vx, vy, vz, depth_out[i], frame, medium)
            stress_out[i, 0] = sx
            stress_out[i, 1] = sy
            stress_out[i, 2] = sz

    return tractions


_stress_3d_cubic = _stress_3d(cubic, _C3)
_stress_3d_quartic = _stress_3d(quartic, _C4)

sums_2d, tractions_2d = _sums(_stress_2d), _tractions(_stress_2d)
sums_3d, tractions_3d = _sums(_stress_3d_cubic), _tractions(_stress_3d_cubic)
sums_3d_quartic, tractions_3d_quartic = _sums(_stress_3d_quartic), _tractions(_stress_3d_quartic)
