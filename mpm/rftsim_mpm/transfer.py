"""Between particles and grid: quadratic B-splines, one source for plane strain (x, z) and three dimensions (x, y, z).

`DIM` is closed over, so that numba compiles each of the two without the other's branches. A node's row of `grid` holds
its mass, momentum and force; a row of `flow` its new velocity and the change of its velocity during the step. Node 1 of
each axis lies on the lower wall, node 0 outside it.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from rftsim_mpm.compiled import FASTMATH, SOURCE
from rftsim_mpm.material import respond_plane, respond_solid

OPTIONS = {"fastmath": FASTMATH, "error_model": "numpy", "cache": True}


class Transfer(NamedTuple):
    """The compiled loops of one dimension."""

    scatter: Any
    gather: Any
    order: Any
    project: Any


@njit(inline="always")
def spline(f):
    """The three weights of a quadratic B-spline at a distance f in [1/2, 3/2) from its first node, in cells."""
    return 0.5 * (1.5 - f) * (1.5 - f), 0.75 - (f - 1.0) * (f - 1.0), 0.5 * (f - 0.5) * (f - 0.5)


@njit(inline="always")
def slope(f):
    """Derivatives of `spline` by f."""
    return f - 1.5, 2.0 - 2.0 * f, f - 0.5


@njit(inline="always")
def pick(w, a):
    """One of three, without the branches of a tuple's own index."""
    return w[0] if a == 0 else (w[1] if a == 1 else w[2])


@njit(inline="always")
def small_exp(e):
    """exp(e) to round-off for |e| < 0.01, more than a step strains: the library's costs as much as a stress update."""
    return 1.0 + e * (1.0 + e * (0.5 + e * (1 / 6 + e * (1 / 24 + e * (1 / 120 + e / 720)))))


def make_transfer(dim: int) -> Transfer:
    """The loops of two (plane strain) or three dimensions."""
    DIM, source = dim, SOURCE  # noqa: N806
    last = dim - 1

    @njit(**OPTIONS)
    def scatter(x, v, mass, volume, stress, low, inv_dx, shape, grid):
        """Sum the particles' mass, momentum and internal force -V sigma . grad N onto the grid, which is cleared."""
        source  # noqa: B018
        grid[:] = 0.0
        ny, nz = shape[1], shape[last]
        for p in range(x.shape[0]):
            m, vol = mass[p], -volume[p] * inv_dx
            gx, gz = (x[p, 0] - low[0]) * inv_dx, (x[p, last] - low[last]) * inv_dx
            i, k = int(gx + 0.5), int(gz + 0.5)
            wx, sx = spline(gx - i + 1.0), slope(gx - i + 1.0)
            wz, sz = spline(gz - k + 1.0), slope(gz - k + 1.0)
            if DIM == 2:
                px, pz = m * v[p, 0], m * v[p, 1]
                txx, tzz, txz = vol * stress[p, 0], vol * stress[p, 2], vol * stress[p, 3]
                for a in range(3):
                    row = (i + a) * nz + k
                    wa, sa = pick(wx, a), pick(sx, a)
                    m_, px_, pz_ = wa * m, wa * px, wa * pz
                    qx, qz, rx, rz = sa * txx, sa * txz, wa * txz, wa * tzz
                    for c in range(3):
                        wc, sc = pick(wz, c), pick(sz, c)
                        node = grid[np.uintp(row + c)]
                        node[0] += wc * m_
                        node[1] += wc * px_
                        node[2] += wc * pz_
                        node[3] += wc * qx + sc * rx
                        node[4] += wc * qz + sc * rz
            else:
                gy = (x[p, 1] - low[1]) * inv_dx
                j = int(gy + 0.5)
                wy, sy = spline(gy - j + 1.0), slope(gy - j + 1.0)
                px, py, pz = m * v[p, 0], m * v[p, 1], m * v[p, 2]
                txx, tyy, tzz = vol * stress[p, 0], vol * stress[p, 1], vol * stress[p, 2]
                tyz, txz, txy = vol * stress[p, 3], vol * stress[p, 4], vol * stress[p, 5]
                for a in range(3):
                    wa, sa = pick(wx, a), pick(sx, a)
                    for b in range(3):
                        row = ((i + a) * ny + j + b) * nz + k
                        wb = pick(wy, b)
                        wab, sab, tab = wa * wb, sa * wb, wa * pick(sy, b)
                        m_, px_, py_, pz_ = wab * m, wab * px, wab * py, wab * pz
                        qx, rx = sab * txx + tab * txy, wab * txz
                        qy, ry = sab * txy + tab * tyy, wab * tyz
                        qz, rz = sab * txz + tab * tyz, wab * tzz
                        for c in range(3):
                            wc, sc = pick(wz, c), pick(sz, c)
                            node = grid[np.uintp(row + c)]
                            node[0] += wc * m_
                            node[1] += wc * px_
                            node[2] += wc * py_
                            node[3] += wc * pz_
                            node[4] += wc * qx + sc * rx
                            node[5] += wc * qy + sc * ry
                            node[6] += wc * qz + sc * rz

    @njit(**OPTIONS)
    def gather(x, v, mass, volume, stress, theta, theta_d, strain, low, inv_dx, shape, flow, dt, constants):
        """Move the particles with the new grid velocity, FLIP, and let their stress follow its gradient (USL).

        x += dt sum N v_new;  v += sum N (v_new - v_old);  V *= exp(dt tr L).
        """
        source  # noqa: B018
        ny, nz = shape[1], shape[last]
        rate = dt * inv_dx
        for p in range(x.shape[0]):
            gx, gz = (x[p, 0] - low[0]) * inv_dx, (x[p, last] - low[last]) * inv_dx
            i, k = int(gx + 0.5), int(gz + 0.5)
            wx, sx = spline(gx - i + 1.0), slope(gx - i + 1.0)
            wz, sz = spline(gz - k + 1.0), slope(gz - k + 1.0)
            if DIM == 2:
                ux = uz = ax = az = lxx = lxz = lzx = lzz = 0.0
                for a in range(3):
                    row = (i + a) * nz + k
                    wa, sa = pick(wx, a), pick(sx, a)
                    ux_ = uz_ = ax_ = az_ = tx_ = tz_ = 0.0
                    for c in range(3):
                        wc, sc = pick(wz, c), pick(sz, c)
                        node = flow[np.uintp(row + c)]
                        ux_ += wc * node[0]
                        uz_ += wc * node[1]
                        ax_ += wc * node[2]
                        az_ += wc * node[3]
                        tx_ += sc * node[0]
                        tz_ += sc * node[1]
                    ux += wa * ux_
                    uz += wa * uz_
                    ax += wa * ax_
                    az += wa * az_
                    lxx += sa * ux_
                    lzx += sa * uz_
                    lxz += wa * tx_
                    lzz += wa * tz_
                x[p, 0] += dt * ux
                x[p, 1] += dt * uz
                v[p, 0] += ax
                v[p, 1] += az
                opening = rate * (lxx + lzz)
                theta[p] -= opening
                volume[p] *= small_exp(opening)
                old = stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3]
                new, slip, theta_d[p] = respond_plane(
                    old, theta[p], theta_d[p], rate * lxx, rate * lxz, rate * lzx, rate * lzz, constants
                )
            else:
                gy = (x[p, 1] - low[1]) * inv_dx
                j = int(gy + 0.5)
                wy, sy = spline(gy - j + 1.0), slope(gy - j + 1.0)
                ux = uy = uz = ax = ay = az = 0.0
                lxx = lxy = lxz = lyx = lyy = lyz = lzx = lzy = lzz = 0.0
                for a in range(3):
                    wa, sa = pick(wx, a), pick(sx, a)
                    for b in range(3):
                        row = ((i + a) * ny + j + b) * nz + k
                        wb = pick(wy, b)
                        wab, sab, tab = wa * wb, sa * wb, wa * pick(sy, b)
                        ux_ = uy_ = uz_ = ax_ = ay_ = az_ = tx_ = ty_ = tz_ = 0.0
                        for c in range(3):
                            wc, sc = pick(wz, c), pick(sz, c)
                            node = flow[np.uintp(row + c)]
                            ux_ += wc * node[0]
                            uy_ += wc * node[1]
                            uz_ += wc * node[2]
                            ax_ += wc * node[3]
                            ay_ += wc * node[4]
                            az_ += wc * node[5]
                            tx_ += sc * node[0]
                            ty_ += sc * node[1]
                            tz_ += sc * node[2]
                        ux += wab * ux_
                        uy += wab * uy_
                        uz += wab * uz_
                        ax += wab * ax_
                        ay += wab * ay_
                        az += wab * az_
                        lxx += sab * ux_
                        lyx += sab * uy_
                        lzx += sab * uz_
                        lxy += tab * ux_
                        lyy += tab * uy_
                        lzy += tab * uz_
                        lxz += wab * tx_
                        lyz += wab * ty_
                        lzz += wab * tz_
                x[p, 0] += dt * ux
                x[p, 1] += dt * uy
                x[p, 2] += dt * uz
                v[p, 0] += ax
                v[p, 1] += ay
                v[p, 2] += az
                opening = rate * (lxx + lyy + lzz)
                theta[p] -= opening
                volume[p] *= small_exp(opening)
                six = stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3], stress[p, 4], stress[p, 5]
                six, slip, theta_d[p] = respond_solid(
                    six,
                    theta[p],
                    theta_d[p],
                    rate * lxx,
                    rate * lxy,
                    rate * lxz,
                    rate * lyx,
                    rate * lyy,
                    rate * lyz,
                    rate * lzx,
                    rate * lzy,
                    rate * lzz,
                    constants,
                )
                stress[p, 4], stress[p, 5] = six[4], six[5]
                new = six[0], six[1], six[2], six[3]
            strain[p] += slip
            stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3] = new

    @njit(**OPTIONS)
    def order(x, low, inv_dx, shape):
        """The permutation that sorts particles by cell, (n,): a counting sort, so equal cells keep their order."""
        source  # noqa: B018
        n = x.shape[0]
        cell = np.empty(n, np.int64)
        count = np.zeros(np.prod(shape) + 1, np.int64)
        for p in range(n):
            c = 0
            for a in range(DIM):
                c = c * shape[a] + int((x[p, a] - low[a]) * inv_dx + 0.5)
            cell[p] = c
            count[c + 1] += 1
        count = np.cumsum(count)
        found = np.empty(n, np.int64)
        for p in range(n):
            found[count[cell[p]]] = p
            count[cell[p]] += 1
        return found

    @njit(**OPTIONS)
    def project(x, mass, low, inv_dx, shape, grid, u):
        """Take from velocities, (n, dim), what they have on the grid: u -= P u, by mass-weighted means."""
        source  # noqa: B018
        grid[:] = 0.0
        ny, nz = shape[1], shape[last]
        depth = 3 if DIM == 3 else 1
        for back in range(2):
            for p in range(x.shape[0]):
                m = mass[p]
                gx, gz = (x[p, 0] - low[0]) * inv_dx, (x[p, last] - low[last]) * inv_dx
                gy = (x[p, 1] - low[1]) * inv_dx if DIM == 3 else 0.0
                i, j, k = int(gx + 0.5), int(gy + 0.5), int(gz + 0.5)
                wx, wy, wz = spline(gx - i + 1.0), spline(gy - j + 1.0), spline(gz - k + 1.0)
                for a in range(3):
                    for b in range(depth):
                        row = (i + a) * nz + k if DIM == 2 else ((i + a) * ny + j + b) * nz + k
                        wab = pick(wx, a) * (pick(wy, b) if DIM == 3 else 1.0)
                        for c in range(3):
                            w = wab * pick(wz, c)
                            if back == 0:
                                grid[row + c, 0] += w * m
                                for d in range(DIM):
                                    grid[row + c, 1 + d] += w * m * u[p, d]
                            elif grid[row + c, 0] > 0.0:
                                for d in range(DIM):
                                    grid[row + c, 1 + DIM + d] = grid[row + c, 1 + d] / grid[row + c, 0]
                                    u[p, d] -= w * grid[row + c, 1 + DIM + d]

    return Transfer(scatter, gather, order, project)
