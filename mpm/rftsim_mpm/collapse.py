"""Collapse of columns on a rough floor: run-out against aspect ratio.

Published run-outs agree on exponents, not on prefactors: (L - L0)/L0 grows with the aspect ratio a = H/L0 to the
power of one when squat, two thirds when tall.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import level_bed
from rftsim_mpm.errors import MpmError, check_positive
from rftsim_mpm.fields import Frame
from rftsim_mpm.follow import follow
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.simulation import Simulation, Watch


@dataclasses.dataclass(frozen=True)
class Collapse:
    """Columns of several aspect ratios, of each the half beside its middle, which is a mirror."""

    aspects: tuple[float, ...] = (0.5, 0.75, 1.0, 1.5, 4.0, 6.0, 9.0)
    """Heights over half widths [-]."""
    half_width: float = 0.05
    """Half of the column's width at the start, L0 [m]."""
    mu_int: float = 0.4
    """Internal friction of the sand, and of the floor [-]."""
    rho: float = 1500.0
    """Critical density of the sand [kg/m^3]."""
    cells: int = 16
    """Cells in the half width."""

    def __post_init__(self) -> None:
        if len(self.aspects) < 1 or not all(math.isfinite(a) and a > 0.0 for a in self.aspects):
            raise MpmError(f"aspects must be positive, not {self.aspects}")
        if self.cells < 4:
            raise MpmError(f"cells must be at least 4, not {self.cells}")
        check_positive(self, "half_width", "mu_int", "rho")


class Runout(NamedTuple):
    """How far one column ran out, and the sand at the end."""

    aspect: float
    """Height over half width at the start, in whole cells [-]."""
    runout: float
    """Run-out (L - L0)/L0 [-]; L holds 99 % of the sand that is not in the air."""
    frame: Frame
    """The sand at the end."""


def fall(study: Collapse, aspect: float, watch: Watch | None = None) -> Runout:
    """Let one column go, for four times the time that it would fall freely."""
    dx = study.half_width / study.cells
    height = max(1, round(aspect * study.cells)) * dx
    duration = 4.0 * math.sqrt(2.0 * height / 9.81)
    reach = math.ceil((1.0 + 4.0 * max(aspect, aspect ** (2 / 3))) * study.cells) * dx
    material = Material.of_density(study.mu_int, study.rho, stiffness(study.rho, 9.81, height, study.mu_int, 0.02))
    bed = level_bed(material, (study.half_width, height), dx)
    friction = np.array([[0.0, 0.0], [study.mu_int, 0.0]])
    sim = Simulation(material, bed, dx, (reach, height + 4 * dx), wall_friction=friction)
    frame = follow(sim, duration, watch).frames[-1]
    edge = float(np.quantile(bed.x[:, 0], 0.99))
    return Runout(height / study.half_width, edge / study.half_width - 1.0, frame)


def exponent(aspects: NDArray[np.float64], runouts: NDArray[np.float64]) -> float:
    """Return the slope of ln(run-out) against ln(aspect) by least squares [-]."""
    return float(np.polyfit(np.log(aspects), np.log(runouts), 1)[0])
