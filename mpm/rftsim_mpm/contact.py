"""Rigid bodies against the sand as a continuum: at points all over their surfaces, with dry friction that remembers.

At each point the sand has a velocity and a filling, means over the grid about it weighted by mass. Where there is sand,
a stiff layer between it and the surface takes up their relative motion as a traction along the point's own normal and,
up to the friction, across it. So the load is carried by the sand as the grid sees it, not by the few particles that
happen to be nearest, and a point's normal never changes. What it takes from the body it gives to the sand.
"""

from typing import Any

import numpy as np
from numba import njit

from rftsim_mpm.compiled import SOURCE_HASH
from rftsim_mpm.lanes import four, lane, load, store
from rftsim_mpm.transfer import MOMENTUM, OPTIONS, pick, spline
from rftsim_mpm.walls import mirrored

ONSET = 0.5
"""Filling at which contact begins: that of a point on the surface of a level bed."""
RAMP = 0.1
"""Further filling over which the layer gains its stiffness."""


def make_contact(dim: int) -> Any:
    """Return the compiled contact loop of two or three dimensions."""
    DIM, source = dim, SOURCE_HASH  # noqa: N806
    last = dim - 1
    count = 3**dim

    @njit(inline="always")
    def put(points, q, centre, rotation, low, inv_dx, shape, place):
        """Fill a point's place in the world; return whether the grid reaches round it, and whether a wall is near."""
        inside, beside = True, False
        for a in range(DIM):
            place[q, a] = centre[a]
            for b in range(DIM):
                place[q, a] += rotation[a, b] * points[q, b]
            g = (place[q, a] - low[a]) * inv_dx
            inside = inside and g >= 0.0 and g <= shape[a] - 3
            beside = beside or g < 2.5 or g > shape[a] - 5.5
        return inside, beside

    @njit(inline="always")
    def planes(shape, at):
        """Return a factor 2 for each wall in whose plane a node lies, where it has half of the mirrored bed's mass."""
        share = 1.0
        for d in range(DIM):
            share *= 2.0 if at[d] == 1 or at[d] == shape[d] - 2 else 1.0
        return share

    @njit(inline="always")
    def with_images(grid, shape, at, found, seen):
        """Return mass and momentum of a node beside walls and of its images behind them, summed."""
        seen[:] = 0.0
        for image in range(mirrored(shape, at, found)):
            node = found[image, 0]
            seen[0, 0] += grid[node, 0]
            for d in range(DIM):
                if at[d] != 1 and at[d] != shape[d] - 2:
                    seen[0, 1 + d] += found[image, 1 + d] * grid[node, MOMENTUM + d]
        return load(seen, 0, 0)

    @njit(inline="always")
    def slide(place, q, centre, velocity, spin, seen, total, slip):
        """Fill the sand's velocity less that of the body at a point, in the world."""
        for a in range(DIM):
            slip[a] = seen[0, 1 + a] / total - velocity[a]
        if DIM == 2:
            slip[0] -= spin[0] * (place[q, 1] - centre[1])
            slip[1] += spin[0] * (place[q, 0] - centre[0])
        else:
            rx, ry, rz = place[q, 0] - centre[0], place[q, 1] - centre[1], place[q, last] - centre[last]
            slip[0] -= spin[1] * rz - spin[2] * ry
            slip[1] -= spin[2] * rx - spin[0] * rz
            slip[last] -= spin[0] * ry - spin[1] * rx

    @njit(inline="always")
    def press(slip, rotation, q, normals, stiffness, mu, local, t, traction):
        """Let a point's traction follow the slip, at most mu times the pressure across; none where it would pull.

        Returns:
            Whether the point presses.
        """
        normal = 0.0
        for a in range(DIM):
            local[a] = 0.0
            for b in range(DIM):
                local[a] += rotation[b, a] * slip[b]
            t[a] = traction[q, a] - stiffness * local[a]
            normal += t[a] * normals[q, a]
        if normal <= 0.0:
            traction[q, :] = 0.0
            return False
        across = 0.0
        for a in range(DIM):
            t[a] -= normal * normals[q, a]
            across += t[a] * t[a]
        across = np.sqrt(across)
        share = mu * normal / across if across > mu * normal else 1.0
        for a in range(DIM):
            traction[q, a] = share * t[a] + normal * normals[q, a]
        return True

    @njit(inline="always")
    def give(grid, rotation, q, areas, traction, total, weight, rows, push):
        """Fill the force of a point on the sand, in the world, and share it out among the nodes about it."""
        for a in range(DIM):
            for b in range(DIM):
                push[q, a] += rotation[a, b] * areas[q] * traction[q, b]
        per_mass = (1.0 / total) * four(0.0, push[q, 0], push[q, 1], push[q, last] if DIM == 3 else 0.0)
        for n in range(count):
            store(grid, rows[n], 4, load(grid, rows[n], 4) + weight[n] * per_mass)

    @njit(**OPTIONS)
    def touch(grid, low, inv_dx, shape, full, motion, points, normals, areas, stiffness, mu, traction, place, push):
        """Add one body's contact forces to the grid.

        Args:
            grid: Rows of mass, momentum, force; the forces are added to.
            low: The grid's lower corner.
            inv_dx: One over the cell size [1/m].
            shape: Nodes along each axis.
            full: Mass of a full cell.
            motion: Place of the body's frame [m], its rotation to the world, velocity and spin.
            points: Points of the surface, in the body's frame, (n, dim) [m].
            normals: Outward unit normals there, (n, dim).
            areas: Area that each point stands for, (n,) [m^2, in the plane m].
            stiffness: Stiffness of the layer, times the time step [Pa s/m].
            mu: Friction between body and sand [-].
            traction: Stress of the body on the sand, in the body's frame, (n, dim) [Pa]; updated.
            place: Filled: the points in the world, (n, dim) [m].
            push: Filled: the forces on the sand, (n, dim) [N].
        """
        source  # noqa: B018
        centre, rotation, velocity, spin = motion
        ny, nz = shape[1], shape[last]
        weight, rows = np.zeros(count), np.zeros(count, np.int64)
        seen = np.zeros((1, 4))  # mass and momentum
        slip, local, t, at = np.zeros(DIM), np.zeros(DIM), np.zeros(DIM), np.zeros(DIM, np.int64)
        found = np.ones((1 << DIM, 1 + DIM), np.int64)
        push[:] = 0.0
        for q in range(points.shape[0]):
            inside, beside = put(points, q, centre, rotation, low, inv_dx, shape, place)
            if not inside:
                traction[q, :] = 0.0
                continue
            gx, gz = (place[q, 0] - low[0]) * inv_dx, (place[q, last] - low[last]) * inv_dx
            gy = (place[q, 1] - low[1]) * inv_dx if DIM == 3 else 0.0
            i, j, k = int(gx + 0.5), int(gy + 0.5), int(gz + 0.5)
            wx, wy, wz = spline(gx - i + 1.0), spline(gy - j + 1.0), spline(gz - k + 1.0)
            mean = four(0.0, 0.0, 0.0, 0.0)
            n = 0
            for a in range(3):
                for b in range(3 if DIM == 3 else 1):
                    row = (i + a) * nz + k if DIM == 2 else ((i + a) * ny + j + b) * nz + k
                    wab = pick(wx, a) * (pick(wy, b) if DIM == 3 else 1.0)
                    for c in range(3):
                        w = wab * pick(wz, c)
                        at[0], at[1], at[last] = i + a, j + b, k + c  # in the plane, z overwrites y
                        w *= planes(shape, at) if beside else 1.0
                        sand = with_images(grid, shape, at, found, seen) if beside else load(grid, row + c, 0)
                        mean += w * sand
                        weight[n], rows[n] = w * lane(sand, 0), row + c
                        n += 1
            total = lane(mean, 0)
            ramp = min(1.0, (total / full - ONSET) / RAMP)
            if ramp <= 0.0:
                traction[q, :] = 0.0
                continue
            store(seen, 0, 0, mean)
            slide(place, q, centre, velocity, spin, seen, total, slip)
            if press(slip, rotation, q, normals, ramp * stiffness, mu, local, t, traction):
                give(grid, rotation, q, areas, traction, total, weight, rows, push)

    return touch
