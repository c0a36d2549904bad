"""The grid's own step, and the walls of the box.

A wall is a plane of mirror symmetry: on the grid, the sand has a mirror image behind it. A frictionless wall is
therefore exactly the middle of a bed twice as wide. Friction acts on the nodes in the plane, at most mu times the
normal impulse.
"""

from typing import Any

import numpy as np
from numba import njit

from rftsim_mpm.compiled import FASTMATH, SOURCE_HASH
from rftsim_mpm.lanes import four, load, store
from rftsim_mpm.transfer import CHANGE, FORCE, MOMENTUM, OPTIONS, VELOCITY


@njit(inline="always")
def mirrored(shape, at, found):
    """Fill a node's images behind the walls it is next to, itself first, and return how many these are.

    A row of `found` is the image's number and, for each axis, the sign that mirroring gives to that component.
    """
    dim = shape.size
    count = 1
    found[0, :] = 1
    found[0, 0] = 0
    for a in range(dim):
        found[0, 0] = found[0, 0] * shape[a] + at[a]
    stride = 1
    for a in range(dim - 1, -1, -1):
        wall = 1 if at[a] <= 2 else shape[a] - 2
        distance = at[a] - wall
        if abs(distance) == 1:
            for image in range(count):
                found[count + image] = found[image]
                found[count + image, 0] -= 2 * distance * stride
                found[count + image, 1 + a] = -1
            count *= 2
        stride *= shape[a]
    return count


@njit(fastmath=FASTMATH, error_model="numpy")
def _rub(grid, shape, dt, axis, side, mu, flow, impulse):
    """Coulomb friction of one wall on the sand in its plane."""
    dim = shape.size
    stride, count = 1, 1
    for a in range(dim):
        stride *= shape[a] if a > axis else 1
        count *= shape[a] if a != axis else 1
    plane = 1 if side == 0 else shape[axis] - 2
    inward = 1.0 if side == 0 else -1.0
    for column in range(count):
        node = (column // stride * shape[axis] + plane) * stride + column % stride
        mass = grid[node, 0]
        normal, speed2 = 0.0, 0.0
        for n in range(node - stride, node + stride + 1, stride):
            normal += inward * (grid[n, 0] * flow[n, CHANGE + axis] - dt * grid[n, FORCE + axis])
        for a in range(dim):
            speed2 += flow[node, VELOCITY + a] * flow[node, VELOCITY + a] if a != axis else 0.0
        if mass <= 0.0 or normal <= 0.0 or speed2 == 0.0:
            continue
        share = min(1.0, mu * normal / (mass * np.sqrt(speed2)))
        for a in range(dim):
            if a != axis:
                loss = share * flow[node, VELOCITY + a]
                flow[node, VELOCITY + a] -= loss
                flow[node, CHANGE + a] -= loss
                impulse[axis, side, a] -= mass * loss


def make_grid_step(dim: int) -> Any:
    """Return the compiled grid step of two or three dimensions."""
    DIM, source = dim, SOURCE_HASH  # noqa: N806

    @njit(**OPTIONS)
    def step(grid, shape, gravity, dt, friction, flow, impulse):
        """Turn mass, momentum and force into the new velocity and its change.

        Args:
            grid: (nnode, ROW), as `scatter` and the contacts leave it; gravity is added to its forces.
            shape: Nodes along each axis, (dim,); at least 7.
            gravity: Acceleration, (dim,) [m/s^2].
            dt: Time step [s].
            friction: Friction of the lower and the upper wall across each axis, (dim, 2).
            flow: Filled: new velocity and its change, (nnode, ROW).
            impulse: Filled: impulse of each wall on the sand, (dim, 2, dim) [N s].
        """
        source  # noqa: B018
        impulse[:] = 0.0
        at = np.zeros(DIM, np.int64)
        at[DIM - 1] = -1
        found = np.ones((1 << DIM, 1 + DIM), np.int64)
        weight = four(0.0, gravity[0], gravity[1], gravity[2] if DIM == 3 else 0.0)
        for node in range(grid.shape[0]):
            store(grid, node, 4, load(grid, node, 4) + grid[node, 0] * weight)
        for node in range(grid.shape[0]):
            axis = DIM - 1
            at[axis] += 1
            while at[axis] == shape[axis]:
                at[axis] = 0
                axis -= 1
                at[axis] += 1
            beside = False
            for a in range(DIM):
                beside = beside or at[a] <= 2 or at[a] >= shape[a] - 3
            if not beside:
                mass = grid[node, 0]
                inverse = 1.0 / mass if mass > 0.0 else 0.0
                change = (dt * inverse) * load(grid, node, 4)
                store(flow, node, 0, inverse * load(grid, node, 0) + change)
                store(flow, node, 4, change)
                continue
            images = mirrored(shape, at, found)
            mass = 0.0
            for image in range(images):
                mass += grid[found[image, 0], 0]
            for a in range(DIM):
                momentum = force = 0.0
                for image in range(images):
                    momentum += found[image, 1 + a] * grid[found[image, 0], MOMENTUM + a]
                    force += found[image, 1 + a] * grid[found[image, 0], FORCE + a]
                if mass <= 0.0 or at[a] == 1 or at[a] == shape[a] - 2:
                    momentum, force = 0.0, 0.0
                inverse = 1.0 / mass if mass > 0.0 else 0.0
                gained = force * inverse * dt
                flow[node, VELOCITY + a] = momentum * inverse + gained
                flow[node, CHANGE + a] = gained
                if at[a] <= 2 or at[a] >= shape[a] - 3:
                    side = 0 if at[a] <= 2 else 1
                    impulse[a, side, a] += grid[node, 0] * gained - dt * grid[node, FORCE + a]
        for a in range(DIM):
            for side in range(2):
                if friction[a, side] > 0.0:
                    _rub(grid, shape, dt, a, side, friction[a, side], flow, impulse)

    return step
