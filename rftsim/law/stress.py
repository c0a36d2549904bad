"""Stress of sand on a triangle, from its outward normal and its velocity; all vectors in the body frame.

No angle is formed: projections of the normal and the velocity suffice. A stress is a kernel of the triangle's normal
and velocity, the free surface's normal above it, the body's frame, the sand and the treatment of edges; `laws` makes
laws from it.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.law import leading, tables
from rftsim.law.vectors import larger, smaller
from rftsim.machine.kernel import Kernel, kernel

TINY: Final = 1e-300
"""Added where zero would divide; too small to change anything else."""
_T31: Final = tuple(tables.TABLE_3_1[key] for key in ("A00", "A10", "B11", "B01", "Bm11", "C11", "C01", "Cm11", "D10"))


class Stress(NamedTuple):
    """Stress on a triangle: `per_depth` times the depth that the law feels, and `inertia` times `along`."""

    per_depth: Any
    """Resistance, which knows the direction of motion and not the speed [N/m^3], shape (3,)."""
    inertia: Any
    """Inertial term, which grows with the square of the speed; not positive [Pa]."""
    along: Any
    """Vector that the inertial term acts along, the normal as the law sees it, shape (3,)."""


@kernel
def inertia(leading_share: Any, normal_speed: Any, medium: Any) -> Any:
    """The inertial term -lambda rho_c v_n^2 of the dynamic laws [Pa], [Agarwal] eq. (4.2); zero for the others."""
    lambda_rho = medium.lambda_ * medium.rho_c if medium.dynamic != 0.0 else 0.0
    return -leading_share * lambda_rho * normal_speed * larger(normal_speed, 0.0)


def in_space(fit: Kernel) -> Kernel:
    """Make the stress of 3D-RFT whose f1, f2 and f3 are polynomials in x1, x2, x3.

    Args:
        fit: Kernel of coefficients, x1, x2 and x3, see `polynomials`.
    """

    @kernel
    def stress(n: Any, v: Any, up: Any, frame: Any, medium: Any, edge: Any) -> Any:
        """Stress of 3D-RFT per depth, [Agarwal] eqs. (5.5), (5.6), (5.9); vertical faces as eq. (5.18) has them."""
        nx, ny, nz = n
        vx, vy, vz = v
        ux, uy, uz = up
        speed2 = vx * vx + vy * vy + vz * vz
        inverse = 1.0 / np.sqrt(speed2 + TINY)
        nu = nx * ux + ny * uy + nz * uz
        vu = (vx * ux + vy * uy + vz * uz) * inverse
        normal_speed = vx * nx + vy * ny + vz * nz
        vn = normal_speed * inverse
        side = leading.side(nu, edge)
        x1, x2, x3 = -vu, -side * nu, side * vn
        c1, c2, c3 = medium.table
        f1, f2, f3 = fit(c1, x1, x2, x3), fit(c2, x1, x2, x3), fit(c3, x1, x2, x3)
        a_n = side * f1 + f2 * vn - f3 * nu
        a2 = f1 * f1 + f2 * f2 + f3 * f3 + 2.0 * (f1 * f2 * x3 + f1 * f3 * x2 + f2 * f3 * x1)
        a_t = np.sqrt(larger(a2 - a_n * a_n, TINY))
        slip = smaller(medium.mu_surf * abs(a_n) / a_t, 1.0)
        share = leading.share(vn, speed2, edge)
        scale = share * medium.xi_n
        along_n = scale * (slip * (side * f1 - a_n) - abs(a_n))
        along_v = scale * slip * f2 * inverse
        along_u = -scale * slip * f3
        per_depth = (
            along_n * nx + along_v * vx + along_u * ux,
            along_n * ny + along_v * vy + along_u * uy,
            along_n * nz + along_v * vz + along_u * uz,
        )
        return Stress(per_depth, inertia(share, normal_speed, medium), n)

    return stress


@kernel
def in_plane(n: Any, v: Any, up: Any, frame: Any, medium: Any, edge: Any) -> Any:
    """Stress of 2D-RFT per depth, [Agarwal] eqs. (3.1) to (3.4).

    Per unit of the triangle's whole area: the projection of its area vector onto the plane of motion is taken here.
    Unlike [Agarwal], the horizontal response opposes the motion: with the printed sign it would add energy.
    """
    a00, a10, b11, b01, bm11, c11, c01, cm11, d10 = _T31
    nx, ny, nz = n
    vx, vy, vz = v
    ux, uy, uz = up
    ex, ey, ez = frame.forward
    px, pz = nx * ex + ny * ey + nz * ez, nx * ux + ny * uy + nz * uz
    wx, wz = vx * ex + vy * ey + vz * ez, vx * ux + vy * uy + vz * uz
    projected2, speed2 = px * px + pz * pz, wx * wx + wz * wz
    length, speed = np.sqrt(projected2 + TINY), np.sqrt(speed2 + TINY)
    both = 1.0 / (length * speed)  # one division for two
    flat, inverse = both * speed, both * length
    projected = projected2 * flat
    px *= flat
    pz *= flat
    mirror = 1.0 if wx >= 0.0 else -1.0
    mx, mz = mirror * px, pz  # sin beta and -cos beta but for one sign, which 2 beta does not see
    cos_gamma, sin_gamma = mirror * wx * inverse, -wz * inverse
    cos_2beta, sin_2beta = mz * mz - mx * mx, -2.0 * mx * mz
    cc, ss = cos_2beta * cos_gamma, sin_2beta * sin_gamma
    sc, cs = sin_2beta * cos_gamma, cos_2beta * sin_gamma
    alpha_z = a00 + a10 * cos_2beta + b01 * sin_gamma + b11 * (sc + cs) + bm11 * (cs - sc)
    alpha_x = c01 * cos_gamma + c11 * (cc - ss) + cm11 * (cc + ss) + d10 * sin_2beta
    normal_speed = px * wx + pz * wz
    share = projected * leading.share(normal_speed * inverse, speed2, edge)
    scale = share * medium.zeta
    along_e, along_u = -scale * mirror * alpha_x, scale * alpha_z
    per_depth = along_e * ex + along_u * ux, along_e * ey + along_u * uy, along_e * ez + along_u * uz
    seen = px * ex + pz * ux, px * ey + pz * uy, px * ez + pz * uz
    return Stress(per_depth, inertia(share, normal_speed, medium), seen)
