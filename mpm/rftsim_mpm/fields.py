"""The sand's state as pictures need it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from rftsim_mpm.body import Body
from rftsim_mpm.simulation import Simulation

Array = NDArray[np.float64]


class Frame(NamedTuple):
    """One moment: the particles (of the slice through the first body, in three dimensions) and the bodies."""

    time: float
    place: Array
    """Of each particle, (n, 2): x and z [m]."""
    spacing: float
    """Mean distance between particles [m]."""
    strain: Array
    """Equivalent plastic shear strain, (n,) [-]."""
    rate: Array
    """Its rate, as a mean since the frame before, (n,) [1/s]."""
    pressure: Array
    """(n,) [Pa]."""
    packing: Array
    """Packing fraction, (n,) [-]."""
    velocity: Array
    """(n, dim) [m/s]."""
    surface: Array
    """Free surface: the top of the highest particle in each column of cells, (m, 2) [m]."""
    outlines: list[Array]
    """Each body's outline or, in three dimensions, the hull of its side view, (k, 2) [m]."""


class Camera:
    """Takes frames of a simulation; remembers the strain at the last one, for its rate."""

    def __init__(self, sim: Simulation) -> None:
        self._time = sim.time
        self._strain = np.zeros(int(sim.particles.number.max()) + 1)
        self._strain[sim.particles.number] = sim.particles.strain

    def shoot(self, sim: Simulation) -> Frame:
        """A frame of the present moment."""
        p = sim.particles
        rate = (p.strain - self._strain[p.number]) / max(sim.time - self._time, sim.dt)
        self._time = sim.time
        self._strain[p.number] = p.strain
        seen = np.ones(len(p), bool)
        if p.dim == 3:
            middle = sim.bodies[0].position[1] if sim.bodies else 0.5 * sim.size[1]
            seen = np.abs(p.x[:, 1] - middle) <= 0.51 * sim.dx
        size = p.volume[seen] ** (1.0 / p.dim)
        return Frame(
            time=sim.time,
            place=p.x[seen][:, [0, -1]],
            spacing=float(size.mean()),
            strain=p.strain[seen],
            rate=rate[seen],
            pressure=p.pressure[seen],
            packing=p.packing[seen],
            velocity=p.v[seen],
            surface=free_surface(p.x[seen][:, [0, -1]], size, sim.dx),
            outlines=[_outline(body) for body in sim.bodies],
        )


def _outline(body: Body) -> Array:
    corners: Array = body.vertices[:, [0, -1]]
    return corners if body.shape.dim == 2 else corners[ConvexHull(corners).vertices]


def free_surface(place: Array, size: Array, dx: float) -> Array:
    """Height of the sand in each column of cells that has any, (m, 2): half a particle above the highest centre.

    What lies above a gap of more than two cells is in the air and is not counted, unless it is thicker than the gap:
    then a body is below it.
    """
    column, height = np.floor(place[:, 0] / dx).astype(np.int64), place[:, 1]
    order = np.lexsort((height, column))
    column, height, size = column[order], height[order], size[order]
    gap = np.diff(height, prepend=height[0] - 1.0)
    first = np.diff(column, prepend=column[0] - 1) != 0
    loose = ~first & (gap > 2.0 * dx)
    group = np.cumsum(first) - 1
    broken = np.zeros(len(column), bool)
    for i in np.flatnonzero(loose):
        end = np.searchsorted(group, group[i], side="right")
        broken[i:end] |= height[end - 1] - height[i] < gap[i]
    kept = np.flatnonzero(~broken)
    last = kept[np.flatnonzero(np.diff(column[kept], append=column[kept][-1] + 1) != 0)]
    return np.column_stack([(column[last] + 0.5) * dx, height[last] + 0.5 * size[last]])
