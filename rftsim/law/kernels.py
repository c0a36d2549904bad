"""The force laws, compiled: stress on one triangle, and the sums over a body.

Every law is one function from a triangle's outward normal and velocity to the stress on it per depth; `_sums` and
`_tractions` make from it the compiled loops that everything else calls. No angle is formed: projections of the normal
and the velocity suffice. All vectors are in the body frame, so that no triangle is rotated.

The sums carry `fastmath` without its NaN and infinity flags: reordering is what lets LLVM vectorise them, while a NaN
must stay one.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import carray, njit, types

from rftsim.law import tables
from rftsim.law.layout import BLOCK, COLUMNS, HEADER
from rftsim.law.selection import LOOK, ROOM, choosing, columns_on_stack, filled_up, next_run
from rftsim.machine.memory import on_stack, peek
from rftsim.solver.linear_algebra import FASTMATH

TINY = 1e-300
STEP = 1e300

_T31 = tuple(tables.TABLE_3_1[key] for key in ("A00", "A10", "B11", "B01", "Bm11", "C11", "C01", "Cm11", "D10"))


class Frame(NamedTuple):
    """What one body's triangles have in common during one evaluation; vectors in the body frame."""

    v0: Any
    """Velocity of the body's origin [m/s], (3,)."""
    omega: Any
    """Angular velocity [rad/s], (3,)."""
    up: Any
    """Normal of the free surface, (3,)."""
    rise: Any
    """Gradient of the height above the free surface, (3,): `up`, unless a sub-cycled step has turned it."""
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
    ramp: Any
    """Steepness with which the leading-edge rule falls off below that [-]; STEP for the rule as published."""
    table: Any
    """Coefficients of f1, f2 and f3 of the 3D laws, as the rows of Table C.4; tuples, so that loops keep them."""


@njit(forceinline=True)
def cubic(c, x1, x2, x3):
    """A cubic in x1, x2, x3, coefficients in the order of the rows of [Agarwal] Table C.3, by Horner's scheme."""
    return (
        c[0]
        + x1 * (c[1] + x1 * (c[4] + x1 * c[10] + x2 * c[14] + x3 * c[17]) + x2 * (c[7] + x2 * c[13] + x3 * c[19]))
        + x2 * (c[2] + x2 * (c[5] + x2 * c[11] + x3 * c[16]) + x3 * (c[8] + x3 * c[15]))
        + x3 * (c[3] + x1 * c[9] + x3 * (c[6] + x3 * c[12] + x1 * c[18]))
    )


@njit(forceinline=True)
def quartic(c, x1, x2, x3):
    """A quartic, in the order of [Agarwal] Table C.4: Table C.3's monomials first, then those of fourth degree."""
    y1, y2, y3 = x1 * x1, x2 * x2, x3 * x3
    return (
        cubic(c, x1, x2, x3)
        + y1 * (c[20] * y1 + c[29] * y2 + c[30] * y3 + c[32] * x2 * x3)
        + y2 * (c[21] * y2 + c[31] * y3 + c[33] * x1 * x3)
        + y3 * (c[22] * y3 + c[34] * x1 * x2)
        + x1 * (y1 * (c[23] * x2 + c[24] * x3) + c[25] * y2 * x2 + c[27] * y3 * x3)
        + x2 * x3 * (c[26] * y2 + c[28] * y3)
    )


@njit(forceinline=True)
def larger(x, y):
    """The larger of two numbers; x where x is no number. One instruction, which the built-in max is not."""
    return y if x < y else x


@njit(forceinline=True)
def smaller(x, y):
    """The smaller of two numbers; x where x is no number."""
    return y if x > y else x


@njit(forceinline=True)
def _leading(vn, speed2, medium):
    """The leading-edge rule on n.v_hat: one or zero, over a ramp where the medium asks for one; zero at rest."""
    share = smaller(larger(1.0 + (vn + medium.edge_on) * medium.ramp, 0.0), 1.0)
    return share if speed2 > 0.0 else 0.0


def _stress_3d(fit: Any) -> Any:
    @njit(forceinline=True)
    def stress(nx, ny, nz, vx, vy, vz, frame, medium):
        """Stress of 3D-RFT per depth, [Agarwal] eqs. (5.5), (5.6), (5.9), and the inertial stress of eq. (4.2).

        Unlike [Agarwal] eq. (5.18), a vertical face counts as facing down (m = n) whichever way it moves.
        """
        ux, uy, uz = frame.up
        speed2 = vx * vx + vy * vy + vz * vz
        inverse = 1.0 / np.sqrt(speed2 + TINY)
        nu = nx * ux + ny * uy + nz * uz
        vu = (vx * ux + vy * uy + vz * uz) * inverse
        vn_ = vx * nx + vy * ny + vz * nz
        vn = vn_ * inverse
        side = 1.0 if nu <= medium.edge_on else -1.0  # m = side * n faces downward, n itself for a wall
        x1 = -vu
        x2 = -side * nu
        x3 = side * vn
        c1, c2, c3 = medium.table
        f1 = fit(c1, x1, x2, x3)
        f2 = fit(c2, x1, x2, x3)
        f3 = fit(c3, x1, x2, x3)
        a_n = side * f1 + f2 * vn - f3 * nu
        a2 = f1 * f1 + f2 * f2 + f3 * f3 + 2.0 * (f1 * f2 * x3 + f1 * f3 * x2 + f2 * f3 * x1)
        a_t = np.sqrt(larger(a2 - a_n * a_n, TINY))
        slip = smaller(medium.mu_surf * abs(a_n) / a_t, 1.0)
        leading = _leading(vn, speed2, medium)
        scale = leading * medium.xi
        along_n = scale * (slip * (side * f1 - a_n) - abs(a_n))
        along_v = scale * slip * f2 * inverse
        along_u = -scale * slip * f3
        inertia = -leading * medium.lambda_rho * vn_ * larger(vn_, 0.0)
        return (
            along_n * nx + along_v * vx + along_u * ux,
            along_n * ny + along_v * vy + along_u * uy,
            along_n * nz + along_v * vz + along_u * uz,
            inertia,
            nx,
            ny,
            nz,
        )

    return stress


@njit(forceinline=True)
def _stress_2d(nx, ny, nz, vx, vy, vz, frame, medium):
    """Stress of 2D-RFT per depth, [Agarwal] eqs. (3.1) to (3.4), and the inertial stress of eq. (4.2).

    Per unit of the triangle's whole area: the projection of its area vector onto the plane of motion is taken here.
    Unlike [Agarwal], the horizontal response opposes the motion: with the printed sign it would add energy.
    """
    a00, a10, b11, b01, bm11, c11, c01, cm11, d10 = _T31
    ux, uy, uz = frame.up
    ex, ey, ez = frame.forward
    px = nx * ex + ny * ey + nz * ez
    pz = nx * ux + ny * uy + nz * uz
    wx = vx * ex + vy * ey + vz * ez
    wz = vx * ux + vy * uy + vz * uz
    projected2, speed2 = px * px + pz * pz, wx * wx + wz * wz
    length, speed = np.sqrt(projected2 + TINY), np.sqrt(speed2 + TINY)
    both = 1.0 / (length * speed)  # one division for two
    flat, inverse = both * speed, both * length
    projected = projected2 * flat
    px *= flat
    pz *= flat
    mirror = 1.0 if wx >= 0.0 else -1.0
    mx = mirror * px  # sin beta and -cos beta but for one sign, which 2 beta does not see
    mz = pz
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
    leading = projected * _leading(vn_ * inverse, speed2, medium)
    scale = leading * medium.xi
    along_e = -scale * mirror * alpha_x
    along_u = scale * alpha_z
    inertia = -leading * medium.lambda_rho * vn_ * larger(vn_, 0.0)
    return (
        along_e * ex + along_u * ux,
        along_e * ey + along_u * uy,
        along_e * ez + along_u * uz,
        inertia,
        px * ex + pz * ux,
        px * ey + pz * uy,
        px * ez + pz * uz,
    )


@njit(forceinline=True)
def _depth(x, y, z, frame):
    """Effective depth of a point below the free surface, [Agarwal] eq. (4.2)."""
    ux, uy, uz = frame.rise
    rx, ry, rz, r0 = frame.rear
    drop = frame.drop if rx * x + ry * y + rz * z + r0 < 0.0 else 0.0
    return frame.height - (ux * x + uy * y + uz * z) - drop


@njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
def deepest(body, frame):
    """Largest depth of a body's triangles [m]; any negative number where none is in the sand."""
    found, size, last = -1e30, int(body[14]), 0
    while last < size:
        first, last = next_run(body, last, frame, 0.0)
        for i in range(HEADER + first, HEADER + last):
            found = larger(found, _depth(peek(body, i), peek(body, i + size), peek(body, i + 2 * size), frame))
    return found


@njit(forceinline=True)
def _leads_3d(nx, ny, nz, vx, vy, vz, frame, reach2):
    """Negative where a triangle lies behind the leading edge of the 3D laws: n.v_hat < -reach."""
    vn = nx * vx + ny * vy + nz * vz
    return vn * abs(vn) + reach2 * (vx * vx + vy * vy + vz * vz)


@njit(forceinline=True)
def _leads_2d(nx, ny, nz, vx, vy, vz, frame, reach2):
    """The same of the 2D laws, of the parts of n and v in the plane of motion; there reach is no less than asked."""
    ux, uy, uz = frame.up
    ex, ey, ez = frame.forward
    px, py, pz = uy * ez - uz * ey, uz * ex - ux * ez, ux * ey - uy * ex
    across = (nx * px + ny * py + nz * pz) * (vx * px + vy * py + vz * pz)
    vn = nx * vx + ny * vy + nz * vz - across
    return vn * abs(vn) + reach2 * (vx * vx + vy * vy + vz * vz)


def _choosing(leads: Any, later: bool) -> Any:
    """The function that chooses what leads in the sand; later: or in that after a time h."""

    @njit(forceinline=True)
    def score(x, y, z, nx, ny, nz, frame, reach2, h):
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        vx, vy, vz = v0x + wy * z - wz * y, v0y + wz * x - wx * z, v0z + wx * y - wy * x
        depth = _depth(x, y, z, frame)
        if later:
            ux, uy, uz = frame.rise
            depth = larger(depth, depth - h * (vx * ux + vy * uy + vz * uz))
        return smaller(depth, leads(nx, ny, nz, vx, vy, vz, frame, reach2))

    return choosing(score)


@njit(forceinline=True)
def _reach2(medium):
    """Square of how far behind the leading edge triangles count, n.v_hat; with room for rounding."""
    reach = medium.edge_on + 1.0 / medium.ramp
    return 1.01 * reach * reach


_ANY: Final = 1.01
"""The same where all count."""


def _sums(stress: Any, leads: Any) -> Any:
    choose = _choosing(leads, later=False)

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def add(chosen, n, frame, medium, total):
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        fx, fy, fz, tx, ty, tz = total
        for i in range(n):
            x, y, z = chosen[i], chosen[i + ROOM], chosen[i + 2 * ROOM]
            sx, sy, sz, inertia, mx, my, mz = stress(
                chosen[i + 3 * ROOM],
                chosen[i + 4 * ROOM],
                chosen[i + 5 * ROOM],
                v0x + wy * z - wz * y,
                v0y + wz * x - wx * z,
                v0z + wx * y - wy * x,
                frame,
                medium,
            )
            depth, area = _depth(x, y, z, frame), chosen[i + 6 * ROOM]
            weight, sunk = area * larger(depth, 0.0), area * inertia if depth > 0.0 else 0.0
            gx, gy, gz = weight * sx + sunk * mx, weight * sy + sunk * my, weight * sz + sunk * mz
            fx += gx
            fy += gy
            fz += gz
            tx += y * gz - z * gy
            ty += z * gx - x * gz
            tz += x * gy - y * gx
        return fx, fy, fz, tx, ty, tz

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def sums(body, frame, medium):
        """Force [N] and moment [N m] about a packed body's origin, as six numbers."""
        chosen, n, reach2, total = columns_on_stack(), 0, _reach2(medium), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        size, last = int(body[14]), 0
        while last < size:
            n, last = choose(body, last, frame, 0.0, reach2, 0.0, chosen, n)
            if n > ROOM - LOOK or last >= size:
                total, n = add(chosen, filled_up(chosen, n), frame, medium, total), 0
        return total

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
            depth = _depth(x, y, z, frame)
            sx, sy, sz, inertia, mx, my, mz = stress(nx[i], ny[i], nz[i], vx, vy, vz, frame, medium)
            sunk = inertia if depth > 0.0 else 0.0
            depth_out[i] = depth
            depth = larger(depth, 0.0)
            stress_out[i, 0] = depth * sx + sunk * mx
            stress_out[i, 1] = depth * sy + sunk * my
            stress_out[i, 2] = depth * sz + sunk * mz

    return tractions


def _sums_ahead(stress: Any, leads: Any) -> Any:
    choose = _choosing(leads, later=True)

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def add(chosen, n, frame, medium, v_c, h, total):
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        ux, uy, uz = frame.rise
        fx, fy, fz, tx, ty, tz, fx1, fy1, fz1, tx1, ty1, tz1 = total
        for i in range(n):
            x, y, z = chosen[i], chosen[i + ROOM], chosen[i + 2 * ROOM]
            nx, ny, nz, area = chosen[i + 3 * ROOM], chosen[i + 4 * ROOM], chosen[i + 5 * ROOM], chosen[i + 6 * ROOM]
            vx = v0x + wy * z - wz * y
            vy = v0y + wz * x - wx * z
            vz = v0z + wx * y - wy * x
            speed2 = vx * vx + vy * vy + vz * vz
            slow = np.sqrt(speed2 / (speed2 + v_c * v_c + TINY))
            sx, sy, sz, inertia, mx, my, mz = stress(nx, ny, nz, vx, vy, vz, frame, medium)
            depth = _depth(x, y, z, frame)
            later = depth - h * (vx * ux + vy * uy + vz * uz)
            weight, sunk = slow * area * larger(depth, 0.0), area * inertia if depth > 0.0 else 0.0
            gx, gy, gz = weight * sx + sunk * mx, weight * sy + sunk * my, weight * sz + sunk * mz
            fx += gx
            fy += gy
            fz += gz
            tx += y * gz - z * gy
            ty += z * gx - x * gz
            tz += x * gy - y * gx
            weight, sunk = slow * area * larger(later, 0.0), area * inertia if later > 0.0 else 0.0
            gx, gy, gz = weight * sx + sunk * mx, weight * sy + sunk * my, weight * sz + sunk * mz
            fx1 += gx
            fy1 += gy
            fz1 += gz
            tx1 += y * gz - z * gy
            ty1 += z * gx - x * gz
            tz1 += x * gy - y * gx
        return fx, fy, fz, tx, ty, tz, fx1, fy1, fz1, tx1, ty1, tz1

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def sums_ahead(body, frame, medium, v_c, h, margin):
        """The sums of a law made continuous at rest, now and at the depths after a time h of this motion.

        The stress per depth is scaled by |v| / sqrt(|v|^2 + v_c^2): the force of a law that knows only the direction
        of motion falls to zero at rest. No triangle moves further than the margin in the time.

        Returns:
            Force and moment at the present depths, and force and moment at the later ones.
        """
        chosen, n, reach2 = columns_on_stack(), 0, _reach2(medium)
        total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        size, last = int(body[14]), 0
        while last < size:
            n, last = choose(body, last, frame, margin, reach2, h, chosen, n)
            if n > ROOM - LOOK or last >= size:
                total, n = add(chosen, filled_up(chosen, n), frame, medium, v_c, h, total), 0
        return total

    return sums_ahead


STEP_ASIDE = 1e-7
"""Turn of the direction of motion [rad] by which the laws are differentiated."""


_JACOBIAN: Final = 9
"""Numbers of a triangle's derivative, which lie before the triangles' columns: LLVM tells parts of one array apart."""
_scratch = on_stack((_JACOBIAN + COLUMNS) * BLOCK, types.float64)


def _jacobians(stress: Any, leads: Any) -> Any:
    choose = _choosing(leads, later=False)

    @njit(fastmath=FASTMATH, error_model="numpy")
    def stiffness(n, frame, medium, v_c, completed, k):
        """Derivative of each of n triangles' force by its velocity: nine runs of BLOCK in k, before their columns."""
        v0x, v0y, v0z = frame.v0
        wx, wy, wz = frame.omega
        # the completed derivative takes the leading-edge rule apart
        ramp = (1.0 - completed) * medium.ramp
        bare = Medium(medium.xi, medium.mu_surf, medium.lambda_rho, medium.edge_on, ramp, medium.table)
        for i in range(n):
            x, y, z = k[i + 9 * BLOCK], k[i + 10 * BLOCK], k[i + 11 * BLOCK]
            n0, n1, n2, area = k[i + 12 * BLOCK], k[i + 13 * BLOCK], k[i + 14 * BLOCK], k[i + 15 * BLOCK]
            vx = v0x + wy * z - wz * y
            vy = v0y + wz * x - wx * z
            vz = v0z + wx * y - wy * x
            speed2 = vx * vx + vy * vy + vz * vz
            speed = np.sqrt(speed2 + TINY)
            inverse = 1.0 / speed
            a, b, c = vx * inverse, vy * inverse, vz * inverse
            sign = 1.0 if c >= 0.0 else -1.0  # two directions across the motion, without a branch
            turn = -1.0 / (sign + c)
            p0, p1, p2 = 1.0 + sign * a * a * turn, sign * a * b * turn, -sign * a
            q0, q1, q2 = a * b * turn, sign + b * b * turn, -b
            d = STEP_ASIDE
            s0, s1, s2, inertia, m0, m1, m2 = stress(n0, n1, n2, vx, vy, vz, frame, bare)
            e0, e1, e2, _, _, _, _ = stress(n0, n1, n2, a + d * p0, b + d * p1, c + d * p2, frame, bare)
            f0, f1, f2, _, _, _, _ = stress(n0, n1, n2, a + d * q0, b + d * q1, c + d * q2, frame, bare)
            depth = _depth(x, y, z, frame)
            radius = 1.0 / np.sqrt(speed2 + v_c * v_c + TINY)
            weight = area * larger(depth, 0.0) * radius if speed2 > 0.0 else 0.0
            vn = vx * m0 + vy * m1 + vz * m2
            share = completed * _leading(vn * inverse, speed2, medium) + (1.0 - completed)
            # a face's pressure P (1 + sign n.v) / 2 jumps at its edge: 1 / |n.v| is the secant of that sign
            width = 0.5 / (radius * medium.ramp)
            edge = -0.5 * completed * abs(s0 * m0 + s1 * m1 + s2 * m2) / larger(abs(vn + width), width) * weight * speed
            i0, i1, i2 = inertia * m0, inertia * m1, inertia * m2
            along = share * weight * (completed + (1.0 - completed) * v_c * v_c * radius * radius)
            across = share * weight / d
            brake = (2.0 * area if depth > 0.0 else 0.0) / smaller(vx * i0 + vy * i1 + vz * i2, -TINY)
            e0, e1, e2 = across * (e0 - s0), across * (e1 - s1), across * (e2 - s2)
            f0, f1, f2 = across * (f0 - s0), across * (f1 - s1), across * (f2 - s2)
            k[i] = e0 * p0 + f0 * q0 + along * s0 * a + brake * i0 * i0 + edge * m0 * m0
            k[i + 1 * BLOCK] = e0 * p1 + f0 * q1 + along * s0 * b + brake * i0 * i1 + edge * m0 * m1
            k[i + 2 * BLOCK] = e0 * p2 + f0 * q2 + along * s0 * c + brake * i0 * i2 + edge * m0 * m2
            k[i + 3 * BLOCK] = e1 * p0 + f1 * q0 + along * s1 * a + brake * i1 * i0 + edge * m1 * m0
            k[i + 4 * BLOCK] = e1 * p1 + f1 * q1 + along * s1 * b + brake * i1 * i1 + edge * m1 * m1
            k[i + 5 * BLOCK] = e1 * p2 + f1 * q2 + along * s1 * c + brake * i1 * i2 + edge * m1 * m2
            k[i + 6 * BLOCK] = e2 * p0 + f2 * q0 + along * s2 * a + brake * i2 * i0 + edge * m2 * m0
            k[i + 7 * BLOCK] = e2 * p1 + f2 * q1 + along * s2 * b + brake * i2 * i1 + edge * m2 * m1
            k[i + 8 * BLOCK] = e2 * p2 + f2 * q2 + along * s2 * c + brake * i2 * i2 + edge * m2 * m2

    @njit(fastmath=FASTMATH, error_model="numpy")
    def jacobian(body, frame, medium, v_c, completed, out):
        """Add the derivative of `sums_ahead`'s present force and moment by the body's twist to out, (6, 6).

        A law depends on the direction of motion alone but for the scale at rest and the inertial term, so two
        differences across the motion and those two closed forms give all of it.

        `completed` (0 or 1) asks for a matrix that cannot overshoot where the law jumps: tangent across the motion and
        secant along it (1 / r instead of v_c^2 / r^3, r^2 = |v|^2 + v_c^2), and secant where a face's edge leads.
        """
        chosen, n, size, last = columns_on_stack(), 0, int(body[14]), 0
        k = carray(_scratch(), ((_JACOBIAN + COLUMNS) * BLOCK,))
        reach2 = _ANY if completed > 0.0 else _reach2(medium)
        while last < size:
            n, last = choose(body, last, frame, 0.0, reach2, 0.0, chosen, n)
            if n > ROOM - LOOK or last >= size:
                n = filled_up(chosen, n)
                for first in range(0, n, BLOCK):
                    some = min(BLOCK, n - first)
                    for column in range(COLUMNS):
                        for i in range(some):
                            k[i + (_JACOBIAN + column) * BLOCK] = chosen[first + i + column * ROOM]
                    stiffness(some, frame, medium, v_c, completed, k)
                    for row in range(3):
                        _add_rows(some, k, row, out)
                n = 0

    return jacobian


@njit(fastmath=FASTMATH, error_model="numpy")
def _add_rows(n, k, row, out):
    """Add the share of one component of n triangles' forces to out, (6, 6); k is a jacobian's scratch."""
    f0 = f1 = f2 = f3 = f4 = f5 = 0.0
    x0 = x1 = x2 = x3 = x4 = x5 = 0.0
    y0 = y1 = y2 = y3 = y4 = y5 = 0.0
    z0 = z1 = z2 = z3 = z4 = z5 = 0.0
    start = 3 * row * BLOCK
    for i in range(n):
        x, y, z = k[i + 9 * BLOCK], k[i + 10 * BLOCK], k[i + 11 * BLOCK]
        u, v, w = k[start + i], k[start + i + BLOCK], k[start + i + 2 * BLOCK]
        p, q, r = w * y - v * z, u * z - w * x, v * x - u * y  # by the angular velocity: velocity is omega x r
        f0, f1, f2, f3, f4, f5 = f0 + u, f1 + v, f2 + w, f3 + p, f4 + q, f5 + r
        x0, x1, x2, x3, x4, x5 = x0 + x * u, x1 + x * v, x2 + x * w, x3 + x * p, x4 + x * q, x5 + x * r
        y0, y1, y2, y3, y4, y5 = y0 + y * u, y1 + y * v, y2 + y * w, y3 + y * p, y4 + y * q, y5 + y * r
        z0, z1, z2, z3, z4, z5 = z0 + z * u, z1 + z * v, z2 + z * w, z3 + z * p, z4 + z * q, z5 + z * r
    force = (f0, f1, f2, f3, f4, f5)
    arms = ((x0, x1, x2, x3, x4, x5), (y0, y1, y2, y3, y4, y5), (z0, z1, z2, z3, z4, z5))
    after, before = (row + 1) % 3, (row + 2) % 3
    for c in range(6):
        out[row, c] += force[c]
        out[3 + after, c] += arms[before][c]
        out[3 + before, c] -= arms[after][c]


_stress_3d_cubic, _stress_3d_quartic = _stress_3d(cubic), _stress_3d(quartic)

sums_2d, tractions_2d = _sums(_stress_2d, _leads_2d), _tractions(_stress_2d)
sums_3d, tractions_3d = _sums(_stress_3d_cubic, _leads_3d), _tractions(_stress_3d_cubic)
sums_3d_quartic, tractions_3d_quartic = _sums(_stress_3d_quartic, _leads_3d), _tractions(_stress_3d_quartic)

ahead_2d, jacobian_2d = _sums_ahead(_stress_2d, _leads_2d), _jacobians(_stress_2d, _leads_2d)
ahead_3d, jacobian_3d = _sums_ahead(_stress_3d_cubic, _leads_3d), _jacobians(_stress_3d_cubic, _leads_3d)
ahead_3d_quartic, jacobian_3d_quartic = (
    _sums_ahead(_stress_3d_quartic, _leads_3d),
    _jacobians(_stress_3d_quartic, _leads_3d),
)
