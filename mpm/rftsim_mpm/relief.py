"""The free surface of sand in the plane as a height over x: where the sand fills half of the space."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.simulation import Simulation

Array = NDArray[np.float64]

FILLED = 0.5
"""Share of the space about a place in the surface that sand fills, as far above as below [-]."""
WALL = (0.2, 0.8)
"""Shares of a hollow's depth between which the slope of its walls is read [-]."""


class Relief(NamedTuple):
    """The sand's surface over x, at nodes a cell apart, and how well it tells of the sand below it."""

    x: Array
    """Places from the lower wall, (n,) [m]."""
    height: Array
    """Height above the undisturbed surface, (n,) [m]."""
    missed: float
    """Sand between the floor and this surface over the sand that there is, less one [-]."""

    def area(self, height: Array | None = None) -> float:
        """Return the area under a height over x, by default this one, by the rule of trapezoids [m^2]."""
        return float(np.trapezoid(self.height if height is None else height, self.x))

    @property
    def hollow(self) -> float:
        """Area that lies below the undisturbed surface [m^2]."""
        return self.area(np.maximum(-self.height, 0.0))

    @property
    def raised(self) -> float:
        """Area that lies above the undisturbed surface [m^2]."""
        return self.area(np.maximum(self.height, 0.0))

    def at(self, x: Array | float) -> Array:
        """Return the height at places [m], between the nodes along straight lines."""
        return np.asarray(np.interp(x, self.x, self.height))

    def part(self, low: float, high: float) -> "Relief":
        """Return the nodes from one place to another [m]."""
        own = (self.x >= low) & (self.x <= high)
        return Relief(self.x[own], self.height[own], self.missed)

    def wall_slope(self) -> float:
        """Return the slope to the right of the lowest place, by a line between shares of its depth [deg]."""
        lowest = int(self.height.argmin())
        depth = -float(self.height[lowest])
        rising = self.height[lowest:] > -WALL[0] * depth
        end = lowest + (int(rising.argmax()) if rising.any() else len(rising) - 1)
        low, high = -WALL[1] * depth, -WALL[0] * depth
        own = [i for i in range(lowest, end) if low <= self.height[i] <= high]
        if len(own) < 2:
            return 90.0
        return math.degrees(math.atan(float(np.polyfit(self.x[own], self.height[own], 1)[0])))

    def front_slope(self) -> float:
        """Return the slope beyond the highest place, by a line between the same shares of its height [deg]."""
        return Relief(self.x, -self.height, self.missed).wall_slope()

    def kept(self) -> dict[str, Any]:
        """Return places and heights as files keep them, to a hundredth of a millimetre."""
        return {"x_m": np.round(self.x, 5).tolist(), "height_m": np.round(self.height, 5).tolist()}


def read_relief(sim: Simulation, level: float) -> Relief:
    """Return the surface of the sand as it is.

    Each particle, of the volume that it has where sand carries load, is spread over the nodes by the quadratic
    B-spline, mirrored at the walls; the surface is the highest place in each column of nodes where half of the space
    is filled, between two nodes along a straight line. Grains in the air fill less. Under a body it is the sand below.

    Args:
        sim: A simulation in the plane.
        level: Height of the undisturbed surface above the floor [m].
    """
    p = sim.particles
    if p.dim != 2:
        raise MpmError("a surface over x alone is read in the plane: dim 2, not 3")
    area = p.mass / (sim.material.rho_g * np.exp(np.maximum(p.theta, p.theta_d)))
    filled = _filled(p.x / sim.dx, area / sim.dx**2, np.rint(sim.size / sim.dx).astype(int))
    top = filled.shape[1] - 1 - np.argmax(filled[:, ::-1] >= FILLED, axis=1)
    rows = np.arange(len(top))
    below, above = filled[rows, top], filled[rows, np.minimum(top + 1, filled.shape[1] - 1)]
    height = sim.dx * (top + (below - FILLED) / np.maximum(below - above, 1e-9))
    height[below < FILLED] = 0.0  # a column without sand
    found = Relief(np.asarray(sim.dx * rows, float), height - level, 0.0)
    return found._replace(missed=(found.area() + level * float(found.x[-1])) / float(area.sum()) - 1.0)


def _filled(place: Array, share: Array, cells: NDArray[np.int64]) -> Array:
    """Share of the space about each node that sand fills, (cells + 1), by places [cells] and volumes [cells^2]."""
    shape = cells + 3  # a node outside each wall
    first = np.floor(place + 0.5).astype(int) - 1
    f = place - first
    weights = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]
    grid = np.zeros(shape)
    for a in range(3):
        for b in range(3):
            np.add.at(grid, (first[:, 0] + a + 1, first[:, 1] + b + 1), share * weights[a][:, 0] * weights[b][:, 1])
    for side in (grid, grid[::-1], grid.T, grid.T[::-1]):  # what lies outside a wall is its mirror image
        side[2] += side[0]
        side[1] *= 2.0
    return grid[1:-1, 1:-1]
