"""The force laws a second time: slow, in NumPy, with the angles of the paper, as the paper writes them.

Written from [Agarwal] and not from the package, which forms no angle. Everything is in the world frame with the body's
origin at `position`; `up` and `offset` give the free surface, up . x = offset. One function per law returns force,
moment about `position`, and the traction on each triangle.
"""

from typing import NamedTuple

import numpy as np
import printed

TABLE_3_1 = {
    ("A", 0, 0): 0.206,
    ("A", 1, 0): 0.169,
    ("B", 1, 1): 0.212,
    ("B", 0, 1): 0.358,
    ("B", -1, 1): 0.055,
    ("C", 1, 1): -0.124,
    ("C", 0, 1): 0.253,
    ("C", -1, 1): 0.007,
    ("D", 1, 0): 0.088,
}
TABLE_C4 = printed.TABLE_C4.replace(printed.MISPRINTED, printed.CORRECT)
RIM = 0.7
"""Triangles whose normal is farther than this from the wheel's axis, |n . axis|, belong to its side, not to its rim."""


class Body(NamedTuple):
    """Triangles in the world frame, and how they move."""

    centres: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    position: np.ndarray = np.zeros(3)
    velocity: np.ndarray = np.zeros(3)
    omega: np.ndarray = np.zeros(3)

    def velocities(self):
        return self.velocity + np.cross(self.omega, self.centres - self.position)

    def depths(self, up=(0.0, 0.0, 1.0), offset=0.0):
        return offset - self.centres @ np.asarray(up)

    def result(self, traction):
        forces = traction * self.areas[:, None]
        return Result(forces.sum(0), np.cross(self.centres - self.position, forces).sum(0), traction)


class Result(NamedTuple):
    force: np.ndarray
    moment: np.ndarray
    traction: np.ndarray


def dot(a, b):
    return np.sum(a * b, axis=-1)


def unit(a, otherwise):
    """a / |a|, and `otherwise` where a is zero."""
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    return np.where(length > 0.0, a / np.where(length > 0.0, length, 1.0), otherwise)


def local_frame(n, v, z):
    """r, theta, z of eq. (5.10): r along horizontal motion, else along the normal, else along global x."""
    global_x = unit(np.array([1.0, 0.0, 0.0]) - z[0] * z, [0.0, 0.0, 0.0])
    r = unit(v - dot(v, z)[:, None] * z, unit(n - dot(n, z)[:, None] * z, global_x))
    return r, np.cross(z, r)


def arccos(x):
    return np.arccos(np.clip(x, -1.0, 1.0))


def angles(n, v, r, theta, z):
    """Tilt beta, eq. (5.18), direction of motion gamma, eq. (5.19), twist psi, eq. (5.20) as atan(n_theta / n_r)."""
    n_r, n_theta, n_z = dot(n, r) + 0.0, dot(n, theta), dot(n, z)
    beta = np.select(
        [(n_r >= 0) & (n_z >= 0), (n_r >= 0) & (n_z < 0), (n_r < 0) & (n_z >= 0), (n_r < 0) & (n_z < 0)],
        [-arccos(n_z), np.pi - arccos(n_z), arccos(n_z), -np.pi + arccos(n_z)],
    )
    gamma = np.where(dot(v, z) <= 0, arccos(dot(v, r)), -arccos(dot(v, r)))
    with np.errstate(divide="ignore", invalid="ignore"):
        psi = np.where((n_r == 0) & (n_theta == 0), 0.0, np.arctan(n_theta / n_r))
    return beta, gamma, psi


def generic_3d(table, n, v, z):
    """alpha_gen, eqs. (5.15) to (5.17), as vectors (ntri, 3)."""
    r, theta = local_frame(n, v, z)
    beta, gamma, psi = angles(n, v, r, theta, z)
    x1, x2 = np.sin(gamma), np.cos(beta)
    x3 = np.cos(psi) * np.cos(gamma) * np.sin(beta) + np.sin(gamma) * np.cos(beta)
    f1, f2, f3 = printed.polynomials(table, x1, x2, x3)
    along_r = f1 * np.sin(beta) * np.cos(psi) + f2 * np.cos(gamma)
    along_theta = f1 * np.sin(beta) * np.sin(psi)
    along_z = -f1 * np.cos(beta) - f2 * np.sin(gamma) - f3
    return along_r[:, None] * r + along_theta[:, None] * theta + along_z[:, None] * z


def specific_3d(generic, n, xi_n, mu_surf):
    """alpha, eqs. (5.4) to (5.6); n is the outward normal."""
    a_n = dot(generic, n)
    a_t = generic - a_n[:, None] * n
    size_t = np.linalg.norm(a_t, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = np.where(size_t > 0.0, np.minimum(mu_surf * np.abs(a_n) / size_t, 1.0), 1.0)
    return xi_n * (-np.abs(a_n)[:, None] * n + cut[:, None] * a_t)


def generic_2d(beta, gamma):
    """alpha_x and alpha_z, eqs. (3.3) and (3.4)."""
    alpha = {"A": 0.0, "B": 0.0, "C": 0.0, "D": 0.0}
    for (letter, m, n), value in TABLE_3_1.items():
        wave = np.cos if letter in "AC" else np.sin
        alpha[letter] = alpha[letter] + value * wave(2 * np.pi * (m * beta / np.pi + n * gamma / (2 * np.pi)))
    return alpha["C"] + alpha["D"], alpha["A"] + alpha["B"]


def specific_2d(n, v, x, z, zeta):
    """alpha of eqs. (3.2) to (3.4) in the plane of x and z, with the horizontal response opposing the motion."""
    sign = np.where(dot(v, x) >= 0.0, 1.0, -1.0)
    gamma = np.arctan2(-dot(v, z), sign * dot(v, x))
    m = np.where((dot(n, z) <= 0.0)[:, None], n, -n)
    beta = np.arctan2(sign * dot(m, x), -dot(m, z))
    alpha_x, alpha_z = generic_2d(beta, gamma)
    return zeta * (-(sign * alpha_x)[:, None] * x + alpha_z[:, None] * z)


def lowered(body, depth, up, omega, wheel, g, pushes):
    """Effective depths, section 4.6.2: delta h = r (r omega^2 / g) over the rear half of the contact arc.

    The arc is that of the submerged leading triangles of the rim, by angle at the wheel's centre from straight down
    towards the way that the wheel rolls.
    """
    axis, centre, radius = wheel
    spin = omega @ axis
    ahead = unit(np.sign(spin) * np.cross(axis, up), [0.0, 0.0, 0.0])
    down = -unit(up - (up @ axis) * axis, [0.0, 0.0, 0.0])
    arm = body.centres - centre
    angle = np.arctan2(arm @ ahead, arm @ down)
    contact = angle[pushes & (depth > 0.0) & (np.abs(body.normals @ axis) <= RIM)]
    if spin == 0.0 or not len(contact):
        return depth
    behind = np.sin(angle - (contact.min() + contact.max()) / 2) < 0.0
    return depth - np.where(behind, radius * (radius * spin**2 / g), 0.0)


def _law_3d(table, body, xi_n, mu_surf, lambda_rho=0.0, wheel=None, g=9.81, up=(0.0, 0.0, 1.0), offset=0.0):
    up = np.asarray(up)
    velocity = body.velocities()
    leading = (dot(body.normals, velocity) >= 0.0) & velocity.any(axis=1)
    depth = body.depths(up, offset)
    if wheel is not None:
        depth = lowered(body, depth, up, body.omega, wheel, g, leading)
    acts = leading & (depth > 0.0)
    n, v, d = body.normals[acts], velocity[acts], depth[acts, None]
    v_hat = unit(v, [0.0, 0.0, 0.0])
    traction = np.zeros_like(body.normals)
    traction[acts] = specific_3d(generic_3d(table, n, v_hat, up), n, xi_n, mu_surf) * d
    traction[acts] -= lambda_rho * (dot(n, v) ** 2)[:, None] * n  # eq. (4.2)
    return body.result(traction)


def rft3d(body, xi_n, mu_surf, **surface):
    """3D-RFT, chapter 5, with Table C.3."""
    return _law_3d(printed.TABLE_C3, body, xi_n, mu_surf, **surface)


def rft3d_c4(body, xi_n, mu_surf, **surface):
    """3D-RFT, chapter 5, with Table C.4."""
    return _law_3d(TABLE_C4, body, xi_n, mu_surf, **surface)


def drft3d(body, xi_n, mu_surf, lambda_rho, wheel=None, g=9.81, **surface):
    """3D-RFT with the two terms of eq. (4.2)."""
    return _law_3d(printed.TABLE_C3, body, xi_n, mu_surf, lambda_rho, wheel, g, **surface)


def drft3d_c4(body, xi_n, mu_surf, lambda_rho, wheel=None, g=9.81, **surface):
    """The same with Table C.4."""
    return _law_3d(TABLE_C4, body, xi_n, mu_surf, lambda_rho, wheel, g, **surface)


def drft2d(body, zeta, lambda_rho, wheel=None, g=9.81, plane=(0.0, 1.0, 0.0), up=(0.0, 0.0, 1.0), offset=0.0):
    """2D-RFT, chapter 3, with the two terms of eq. (4.2), in the vertical plane whose normal is `plane`."""
    up, plane = np.asarray(up), np.asarray(plane)
    x = np.cross(plane, up)
    velocity = body.velocities()
    velocity = velocity - dot(velocity, plane)[:, None] * plane
    edge = body.normals - dot(body.normals, plane)[:, None] * plane  # |edge| A is the width times the length ds
    leading = (dot(edge, velocity) >= 0.0) & velocity.any(axis=1) & edge.any(axis=1)
    depth = body.depths(up, offset)
    if wheel is not None:
        depth = lowered(body, depth, up, body.omega, wheel, g, leading)
    acts = leading & (depth > 0.0)
    n, v, d = unit(edge[acts], [0.0, 0.0, 0.0]), velocity[acts], depth[acts, None]
    stress = specific_2d(n, unit(v, [0.0, 0.0, 0.0]), x, up, zeta) * d - lambda_rho * (dot(n, v) ** 2)[:, None] * n
    traction = np.zeros_like(body.normals)
    traction[acts] = stress * np.linalg.norm(edge[acts], axis=1)[:, None]
    return body.result(traction)


def rft2d(body, zeta, **surface):
    """2D-RFT, chapter 3."""
    return drft2d(body, zeta, 0.0, **surface)
