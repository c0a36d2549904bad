"""Rigid bodies pressing on particles: a stiff layer on the exact surface, with dry friction that remembers.

Particles act a good part of a cell beyond their centres, whatever the scheme, so that bodies would be felt too early,
too wide and too deep. The layer therefore lies inside the true surface by `inset`. The force is a continuous function
of where the particles are, with no grid in it, and what it takes from the body it gives to the sand.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from rftsim_mpm.compiled import FASTMATH, SOURCE
from rftsim_mpm.transfer import OPTIONS, pick, spline


class Distance(NamedTuple):
    """Signed distance to a body's surface, negative inside, in the body's frame.

    A convex body is its planes, exact inside it; any other a table of distances, interpolated.
    """

    planes: Any
    """Outward normals and offsets, (nplane, dim + 1); none for a body with a table."""
    table: Any
    """Distances [m], (n0, n1, n2); n1 is 1 in the plane."""
    low: Any
    """Place of the table's first entry [m], (3,)."""
    inv_spacing: Any
    """One over the table's spacing [1/m]."""
    reach: Any
    """Radius about the body's origin outside which it touches nothing [m]."""


@njit(inline="always")
def _cell(at, low, inv, n):
    """Index and fraction of a place along one axis of a table, or a negative index outside it."""
    g = (at - low) * inv
    i = int(np.floor(g))
    return (i, g - i) if 0 <= i < n - 1 else (-1, 0.0)


@njit(fastmath=FASTMATH, error_model="numpy")
def _distance(shape, at, normal):
    """Signed distance of a point of the body's frame, and the outward unit normal there (filled)."""
    dim = at.size
    last = dim - 1
    if shape.planes.shape[0] > 0:
        best, which = -np.inf, 0
        for f in range(shape.planes.shape[0]):
            d = -shape.planes[f, dim]
            for a in range(dim):
                d += shape.planes[f, a] * at[a]
            if d > best:
                best, which = d, f
        for a in range(dim):
            normal[a] = shape.planes[which, a]
        return best
    n0, n1, n2 = shape.table.shape
    i, fx = _cell(at[0], shape.low[0], shape.inv_spacing, n0)
    k, fz = _cell(at[last], shape.low[2], shape.inv_spacing, n2)
    j, fy = (0, 0.0) if dim == 2 else _cell(at[1], shape.low[1], shape.inv_spacing, n1)
    if i < 0 or j < 0 or k < 0:
        return np.inf
    total = gx = gy = gz = 0.0
    for a in range(2):
        wx = fx if a else 1.0 - fx
        for b in range(1 if dim == 2 else 2):
            wy = fy if b else 1.0 - fy
            for c in range(2):
                wz = fz if c else 1.0 - fz
                d = shape.table[i + a, j + b, k + c]
                total += wx * wy * wz * d
                gx += (1.0 if a else -1.0) * wy * wz * d
                gy += (1.0 if b else -1.0) * wx * wz * d
                gz += (1.0 if c else -1.0) * wx * wy * d
    length = np.sqrt(gx * gx + gz * gz + (gy * gy if dim == 3 else 0.0)) + 1e-300
    normal[0], normal[last] = gx / length, gz / length
    if dim == 3:
        normal[1] = gy / length
    return total


@njit(fastmath=FASTMATH, error_model="numpy", cache=True)
def distances(shape, points):
    """Signed distances of points of the body's frame, (n, dim) [m]."""
    found, normal = np.empty(points.shape[0]), np.zeros(points.shape[1])
    for p in range(points.shape[0]):
        found[p] = _distance(shape, points[p], normal)
    return found


def make_contact(dim: int) -> Any:
    """The contact loop of two or three dimensions."""
    DIM, source = dim, SOURCE  # noqa: N806
    last = dim - 1

    @njit(**OPTIONS)
    def touch(x, volume, low, inv_dx, gridshape, shape, centre, rotation, body, layer, anchor, held, hit, push, grid):
        """Add one body's contact forces to the grid.

        Args:
            x: Particles, (n, dim) [m].
            volume: (n,) [m^dim].
            low: The grid's lower corner.
            inv_dx: One over the cell size [1/m].
            gridshape: Nodes along each axis.
            shape: The body's `Distance`.
            centre: Of the body's frame [m].
            rotation: From the body's frame to the world, (dim, dim).
            body: Number of the body, from 1.
            layer: Inset [m], stiffness [Pa/m], friction [-].
            anchor: Where each particle sticks, in the frame of the body that holds it, (n, dim) [m]; updated.
            held: Number of that body, or 0, (n,); updated.
            hit: Filled: the particles in contact.
            push: Filled: the forces on them, (n, dim) [N].
            grid: Rows of mass, momentum, force; the forces are added to.

        Returns:
            Number of particles in contact.
        """
        source  # noqa: B018
        inset, stiffness, mu = layer
        ny, nz = gridshape[1], gridshape[last]
        local, normal = np.zeros(DIM), np.zeros(DIM)
        across, force = np.zeros(DIM), np.zeros(DIM)
        contacts = 0
        for p in range(x.shape[0]):
            far = 0.0
            for a in range(DIM):
                far += (x[p, a] - centre[a]) ** 2
            if far > shape.reach * shape.reach:
                if held[p] == body:
                    held[p] = 0
                continue
            for a in range(DIM):
                local[a] = 0.0
                for b in range(DIM):
                    local[a] += rotation[b, a] * (x[p, b] - centre[b])
            depth = -_distance(shape, local, normal) - inset
            if depth <= 0.0:
                if held[p] == body:
                    held[p] = 0
                continue
            if held[p] != body:
                held[p] = body
                anchor[p] = local
            outward, length2 = 0.0, 0.0
            for a in range(DIM):
                outward += (local[a] - anchor[p, a]) * normal[a]
            for a in range(DIM):
                across[a] = local[a] - anchor[p, a] - outward * normal[a]
                length2 += across[a] * across[a]
            limit = mu * depth
            if length2 > limit * limit:
                for a in range(DIM):
                    across[a] *= limit / np.sqrt(length2)
                    anchor[p, a] = local[a] - across[a]
            k = stiffness * (np.sqrt(volume[p]) if DIM == 2 else volume[p] ** (2.0 / 3.0))
            for a in range(DIM):
                force[a] = 0.0
                for b in range(DIM):
                    force[a] += rotation[a, b] * k * (depth * normal[b] - across[b])
                push[contacts, a] = force[a]
            hit[contacts] = p
            contacts += 1
            gx, gz = (x[p, 0] - low[0]) * inv_dx, (x[p, last] - low[last]) * inv_dx
            i, k_ = int(gx + 0.5), int(gz + 0.5)
            wx, wz = spline(gx - i + 1.0), spline(gz - k_ + 1.0)
            gy = (x[p, 1] - low[1]) * inv_dx if DIM == 3 else 0.0
            j = int(gy + 0.5)
            wy = spline(gy - j + 1.0)
            for a in range(3):
                for b in range(3 if DIM == 3 else 1):
                    row = (i + a) * nz + k_ if DIM == 2 else ((i + a) * ny + j + b) * nz + k_
                    wab = pick(wx, a) * (pick(wy, b) if DIM == 3 else 1.0)
                    for c in range(3):
                        for d in range(DIM):
                            grid[row + c, 1 + DIM + d] += wab * pick(wz, c) * force[d]
        return contacts

    return touch
