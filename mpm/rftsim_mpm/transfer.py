"""Between particles and grid: quadratic B-splines, one source for plane strain (x, z) and three dimensions (x, y, z).

`DIM` is closed over, so that numba compiles each of the two without the other's branches. A node's row of `grid` holds
its mass, momentum and force; a row of `flow` its new velocity and the change of its velocity during the step. Either is
two fours of `lanes`: mass and momentum, nothing and force. Node 1 of each axis lies on the lower wall, node 0 outside
it.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from rftsim_mpm.compiled import FASTMATH, SOURCE_HASH
from rftsim_mpm.lanes import four, lane, load, store
from rftsim_mpm.material import respond_plane, respond_solid

ROW = 8
"""Numbers in a node's row: two fours, of which the plane leaves the last of each zero."""
MOMENTUM, FORCE = 1, 5
"""Where these begin in a row of `grid`; the mass comes first."""
VELOCITY, CHANGE = MOMENTUM, FORCE
"""Where these begin in a row of `flow`: in the same places."""
OPTIONS = {"fastmath": FASTMATH, "error_model": "numpy", "cache": True}


class Transfer(NamedTuple):
    """The compiled loops between particles and grid, of two or three dimensions."""

    scatter: Any
    """Sums the particles onto the grid."""
    gather: Any
    """Moves the particles and updates their stress."""
    order: Any
    """Returns the permutation that sorts particles by cell."""
    project: Any
    """Takes from velocities what they have on the grid."""


@njit(inline="always")
def spline(f):
    """Return the three weights of a quadratic B-spline at a distance f in [1/2, 3/2) from its first node, in cells."""
    return 0.5 * (1.5 - f) * (1.5 - f), 0.75 - (f - 1.0) * (f - 1.0), 0.5 * (f - 0.5) * (f - 0.5)


@njit(inline="always")
def slope(f):
    """Return the derivatives of the three weights of `spline` by f."""
    return f - 1.5, 2.0 - 2.0 * f, f - 0.5


@njit(inline="always")
def pick(w, a):
    """Return one of three numbers, without the branches of a tuple's own index."""
    return w[0] if a == 0 else (w[1] if a == 1 else w[2])


@njit(inline="always")
def small_exp(e):
    """Return exp(e) to round-off for |e| < 0.01, more than a step strains.

    The library's costs as much as a stress update.
    """
    return 1.0 + e * (1.0 + e * (0.5 + e * (1 / 6 + e * (1 / 24 + e * (1 / 120 + e / 720)))))


def make_transfer(dim: int) -> Transfer:
    """Return the compiled loops of two dimensions (plane strain) or three."""
    DIM, NODES_Y, source = dim, 3 if dim == 3 else 1, SOURCE_HASH  # noqa: N806
    last = dim - 1

    @njit(inline="always")
    def reach(x, p, low, inv_dx, shape):
        """Return a particle's first node, and the weights of three along x, z and y, each followed by its slopes.

        In the plane the three along y are one, of weight 1.
        """
        gx, gz = (x[p, 0] - low[0]) * inv_dx, (x[p, last] - low[last]) * inv_dx
        i, k = int(gx + 0.5), int(gz + 0.5)
        fx, fz = gx - i + 1.0, gz - k + 1.0
        if DIM == 2:
            return i * shape[last] + k, spline(fx), slope(fx), spline(fz), slope(fz), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        gy = (x[p, 1] - low[1]) * inv_dx
        j = int(gy + 0.5)
        fy = gy - j + 1.0
        first = (i * shape[1] + j) * shape[last] + k
        return first, spline(fx), slope(fx), spline(fz), slope(fz), spline(fy), slope(fy)

    @njit(**OPTIONS)
    def scatter(x, v, mass, volume, stress, low, inv_dx, shape, grid):
        """Sum the particles' mass, momentum and internal force -V sigma . grad N onto the grid, which is cleared."""
        source  # noqa: B018
        grid[:] = 0.0
        ny, nz = shape[1] if DIM == 3 else 1, shape[last]
        for p in range(x.shape[0]):
            first, wx, sx, wz, sz, wy, sy = reach(x, p, low, inv_dx, shape)
            m, vol = mass[p], -volume[p] * inv_dx
            if DIM == 2:
                moved = four(m, m * v[p, 0], m * v[p, 1], 0.0)
                txx, tzz, txz = vol * stress[p, 0], vol * stress[p, 2], vol * stress[p, 3]
                tx, ty, tz = four(0.0, txx, txz, 0.0), four(0.0, 0.0, 0.0, 0.0), four(0.0, txz, tzz, 0.0)
            else:
                moved = four(m, m * v[p, 0], m * v[p, 1], m * v[p, 2])
                txx, tyy, tzz = vol * stress[p, 0], vol * stress[p, 1], vol * stress[p, 2]
                tyz, txz, txy = vol * stress[p, 3], vol * stress[p, 4], vol * stress[p, 5]
                tx, ty, tz = four(0.0, txx, txy, txz), four(0.0, txy, tyy, tyz), four(0.0, txz, tyz, tzz)
            for a in range(3):
                wa, sa = pick(wx, a), pick(sx, a)
                for b in range(NODES_Y):
                    row = first + (a * ny + b) * nz
                    wb = pick(wy, b)
                    wab = wa * wb
                    m_, r = wab * moved, wab * tz
                    q = (sa * wb) * tx
                    if DIM == 3:
                        q += (wa * pick(sy, b)) * ty
                    for c in range(3):
                        wc, sc = pick(wz, c), pick(sz, c)
                        node = row + c
                        store(grid, node, 0, load(grid, node, 0) + wc * m_)
                        store(grid, node, 4, load(grid, node, 4) + wc * q + sc * r)

    @njit(**OPTIONS)
    def gather(x, v, mass, volume, stress, theta, theta_d, strain, low, inv_dx, shape, flow, dt, constants):
        """Move the particles with the new grid velocity, FLIP, and let their stress follow its gradient (USL).

        x += dt sum N v_new;  v += sum N (v_new - v_old);  V *= exp(dt tr L).
        """
        source  # noqa: B018
        ny, nz = shape[1] if DIM == 3 else 1, shape[last]
        rate = dt * inv_dx
        for p in range(x.shape[0]):
            first, wx, sx, wz, sz, wy, sy = reach(x, p, low, inv_dx, shape)
            zero = four(0.0, 0.0, 0.0, 0.0)
            new, change = zero, zero  # velocity
            by_x, by_y, by_z = zero, zero, zero  # derivatives of the new one
            for a in range(3):
                wa, sa = pick(wx, a), pick(sx, a)
                for b in range(NODES_Y):
                    row = first + (a * ny + b) * nz
                    wb = pick(wy, b)
                    wab = wa * wb
                    new_, change_, by_z_ = zero, zero, zero
                    for c in range(3):
                        wc, sc = pick(wz, c), pick(sz, c)
                        node = row + c
                        velocity = load(flow, node, 0)
                        new_ += wc * velocity
                        by_z_ += sc * velocity
                        change_ += wc * load(flow, node, 4)
                    new += wab * new_
                    change += wab * change_
                    by_x += (sa * wb) * new_
                    if DIM == 3:
                        by_y += (wa * pick(sy, b)) * new_
                    by_z += wab * by_z_
            by_x, by_y, by_z = rate * by_x, rate * by_y, rate * by_z
            x[p, 0] += dt * lane(new, 1)
            x[p, 1] += dt * lane(new, 2)
            v[p, 0] += lane(change, 1)
            v[p, 1] += lane(change, 2)
            if DIM == 2:
                lxx, lxz, lzx, lzz = lane(by_x, 1), lane(by_z, 1), lane(by_x, 2), lane(by_z, 2)
                opening = lxx + lzz
            else:
                x[p, 2] += dt * lane(new, 3)
                v[p, 2] += lane(change, 3)
                lxx, lxy, lxz = lane(by_x, 1), lane(by_y, 1), lane(by_z, 1)
                lyx, lyy, lyz = lane(by_x, 2), lane(by_y, 2), lane(by_z, 2)
                lzx, lzy, lzz = lane(by_x, 3), lane(by_y, 3), lane(by_z, 3)
                opening = lxx + lyy + lzz
            theta[p] -= opening
            volume[p] *= small_exp(opening)
            if DIM == 2:
                old = stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3]
                t, slip, theta_d[p] = respond_plane(old, theta[p], theta_d[p], lxx, lxz, lzx, lzz, constants)
            else:
                six = stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3], stress[p, 4], stress[p, 5]
                t, slip, theta_d[p] = respond_solid(
                    six, theta[p], theta_d[p], lxx, lxy, lxz, lyx, lyy, lyz, lzx, lzy, lzz, constants
                )
                stress[p, 4], stress[p, 5] = t[4], t[5]
            stress[p, 0], stress[p, 1], stress[p, 2], stress[p, 3] = t[0], t[1], t[2], t[3]
            strain[p] += slip

    @njit(**OPTIONS)
    def order(x, low, inv_dx, shape):
        """Return the permutation that sorts particles by cell, (n,); those of one cell keep their order."""
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

    # Six levels deep, since as two loops one after the other it sums in another order in the plane: other last bits.
    @njit(**OPTIONS)
    def project(x, mass, low, inv_dx, shape, grid, u):
        """Take from velocities, (n, dim), what they have on the grid: u -= P u, by mass-weighted means."""
        source  # noqa: B018
        grid[:] = 0.0
        ny, nz = shape[1] if DIM == 3 else 1, shape[last]
        for back in range(2):
            for p in range(x.shape[0]):
                first, wx, _, wz, _, wy, _ = reach(x, p, low, inv_dx, shape)
                moved = mass[p] * four(1.0, u[p, 0], u[p, 1], u[p, 2] if DIM == 3 else 0.0)
                seen = four(0.0, 0.0, 0.0, 0.0)
                for a in range(3):
                    for b in range(NODES_Y):
                        row = first + (a * ny + b) * nz
                        wab = pick(wx, a) * pick(wy, b)
                        for c in range(3):
                            w, node = wab * pick(wz, c), row + c
                            if back == 0:
                                store(grid, node, 0, load(grid, node, 0) + w * moved)
                            elif grid[node, 0] > 0.0:
                                seen += (w / grid[node, 0]) * load(grid, node, 0)
                u[p, 0] -= lane(seen, 1)
                u[p, 1] -= lane(seen, 2)
                if DIM == 3:
                    u[p, 2] -= lane(seen, 3)

    return Transfer(scatter, gather, order, project)
