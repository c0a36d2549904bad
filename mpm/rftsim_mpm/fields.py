"""The sand's state as pictures need it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from rftsim_mpm.body import Body
from rftsim_mpm.simulation import Simulation

Array = NDArray[np.float64]


class Frame(NamedTuple):
    """One moment: the particles (in three dimensions those of the slice through the first body) and the bodies."""

    time: float
    """Simulated time [s]."""
    place: Array
    """Places of the particles, (n, 2): x and z [m]."""
    spacing: float
    """Mean distance between particles [m]."""
    strain: Array
    """Equivalent plastic shear strain, (n,) [-]."""
    rate: Array
    """Rate of the equivalent plastic shear strain, as a mean since the frame before, (n,) [1/s]."""
    pressure: Array
    """Mean of the three normal stresses, compression positive, (n,) [Pa]."""
    packing: Array
    """Packing fraction, (n,) [-]."""
    velocity: Array
    """Velocities of the particles, (n, dim) [m/s]."""
    surface: Array
    """Free surface: the top of the highest particle in each column of cells, (m, 2) [m]."""
    outlines: list[Array]
    """Each body's outline or, in three dimensions, the hull of its side view, (k, 2) [m]."""


class StrainRate:
    """The rate of plastic strain since it was last asked for, at first since time zero."""

    def __init__(self) -> None:
        self._time = 0.0
        self._strain = np.zeros(0)

    def since_last(self, sim: Simulation) -> Array:
        """Return each particle's mean rate of equivalent plastic shear strain, shape (n,) [1/s]."""
        p = sim.particles
        if not self._strain.size:
            self._strain = np.zeros(int(p.number.max()) + 1)
        rate: Array = (p.strain - self._strain[p.number]) / max(sim.time - self._time, sim.dt)
        self._strain[p.number], self._time = p.strain, sim.time
        return rate


def in_slice(sim: Simulation) -> NDArray[np.bool_]:
    """Whether each particle lies in the slice a cell thick through the first body; all do in the plane, shape (n,)."""
    p = sim.particles
    if p.dim == 2:
        return np.ones(len(p), bool)
    middle = sim.bodies[0].position[1] if sim.bodies else 0.5 * sim.size[1]
    found: NDArray[np.bool_] = np.abs(p.x[:, 1] - middle) <= 0.51 * sim.dx
    return found


class Camera:
    """Takes frames of a simulation; remembers the strain at the last one, for its rate."""

    def __init__(self, sim: Simulation) -> None:
        self._rate = StrainRate()
        self._rate.since_last(sim)

    def shoot(self, sim: Simulation) -> Frame:
        """Return a frame of the present moment, and remember its strain."""
        p, seen = sim.particles, in_slice(sim)
        rate = self._rate.since_last(sim)
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
    """Return the top of the sand in each column of cells that has any, (m, 2): half a particle above a centre.

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
