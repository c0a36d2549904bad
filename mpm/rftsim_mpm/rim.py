"""Where on its rim a wheel presses the sand, and where behind it that ends: [Agarwal] section 4.6.2."""

import math

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.simulation import Simulation

Array = NDArray[np.float64]

BINS = 120
"""Parts of the rim, by their angle at the axle."""
VANISHED = 0.01
"""Pressure over its largest that counts as vanished [-]."""


class Rim:
    """The mean pressure of a wheel on the sand by the angle at its axle, over several moments.

    Args:
        way: 1 where the wheel travels to +x, -1 where it travels to -x.
    """

    def __init__(self, way: float) -> None:
        self.way = way
        self.pressed = np.zeros(BINS)
        """Pressure of each part times its area, from straight up over the front, down, and up behind, (BINS,).

        That on the sides of grousers counts, too."""

    def look(self, sim: Simulation) -> None:
        """Add the pressure of the moment, of the simulation's first body."""
        body, surface = sim.bodies[0], sim.surfaces[0]
        arm, pressure = surface.points @ body.rotation.T, (sim.traction[0] * surface.normals).sum(axis=1)
        place = np.arctan2(-self.way * arm[:, 0], -arm[:, -1]) / (2.0 * math.pi) + 0.5
        index = np.minimum((place * BINS).astype(int), BINS - 1)
        self.pressed += np.bincount(index, pressure * surface.areas, BINS)

    @property
    def rear(self) -> float:
        """Angle from straight down to the rear at which the pressure vanishes [rad]; negative where that is ahead."""
        if not (self.pressed > 0.0).any():
            return -0.5 * math.pi
        most = int(self.pressed.argmax())
        least = VANISHED * self.pressed[most]
        end = most
        while end < BINS - 1 and self.pressed[end] > least:
            end += 1
        before, after = self.pressed[end - 1], self.pressed[end]
        share = (before - least) / (before - after) if before > after else 0.0
        return (end - 0.5 + share) * 2.0 * math.pi / BINS - math.pi
