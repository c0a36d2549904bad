"""A thin upright plate dragged through sand at several depths and speeds: [Agarwal] section 4.7.

F = K z + lambda rho L v^2 per metre of width: what dynamic force laws take their inertial term from.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.follow import part
from rftsim_mpm.plate import Plate, PlateForce, measure
from rftsim_mpm.simulation import Watch

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Drag:
    """Upright plates at several depths and speeds, by default those of [Agarwal] Fig. 4-8.

    The source does not give the internal friction there.
    """

    length: float = 0.016
    """Height of the plate [m]."""
    rho: float = 900.0
    """Critical density of the sand [kg/m^3]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and plate [-]."""
    depths: tuple[float, ...] = (0.02, 0.03, 0.04)
    """Depths of the plate's centre [m]."""
    speeds: tuple[float, ...] = (0.1, 0.32, 0.64)
    """Speeds of the plate [m/s]."""
    travel: float = 2.5
    """Travel before the reading [plate lengths]; a fast plate then heaps up sand ahead, and feels more and more."""
    cells: float = 10.0
    """Cells per plate length."""

    def plates(self) -> list[Plate]:
        """Return one plate for each depth and speed."""
        if len(set(self.depths)) < 2 or len(set(self.speeds)) < 2:
            raise MpmError("drag needs at least two depths and two speeds to fit K and lambda")
        return [
            Plate(
                beta=90.0,
                gamma=0.0,
                mu_int=self.mu_int,
                mu_surf=self.mu_surf,
                rho=self.rho,
                length=self.length,
                depth=depth,
                speed=speed,
                cells=self.cells,
                bed=2.5,
                buried=self.travel,
            )
            for depth in self.depths
            for speed in self.speeds
        ]


class DragForces(NamedTuple):
    """Drag of each plate and what it amounts to."""

    depth: Array
    """Depth of each plate's centre, (n,) [m]."""
    speed: Array
    """Speed of each plate, (n,) [m/s]."""
    drag: Array
    """Force against the motion, (n,) [N/m]."""
    lift: Array
    """Upward force, (n,) [N/m]."""
    stiffness: float
    """K of F = K z + lambda rho L v^2, by least squares [N/m^2]."""
    inertia: float
    """lambda of the same fit [-]."""
    runs: list[PlateForce]
    """The measurement on each plate."""


def drag(study: Drag, watch: Watch | None = None) -> DragForces:
    """Drag all the plates; `watch` is told the share of the whole study that is done."""
    plates = study.plates()
    runs = [measure(plate, part(watch, i, len(plates))) for i, plate in enumerate(plates)]
    depth, speed = np.array([plate.z for plate in plates]), np.array([plate.speed for plate in plates])
    force = np.array([run.force for run in runs])
    basis = np.column_stack([depth, study.rho * study.length * speed**2])
    (stiffness, inertia), *_ = np.linalg.lstsq(basis, -force[:, 0], rcond=None)
    return DragForces(depth, speed, -force[:, 0], force[:, 1], float(stiffness), float(inertia), runs)
