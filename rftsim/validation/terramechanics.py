"""The comparator of classical terramechanics: a smooth rigid wheel by Bekker, Wong and Reece, Janosi and Hanamoto."""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from rftsim_models.wheels import GROUSER_WHEEL

from rftsim.sand.presets import PRESETS
from rftsim.surface.triangles import Array
from rftsim.validation.balance import steady


class Soil(NamedTuple):
    """The parameters of a soil, as [Agarwal] eqs. (1.4) and (1.5) have them."""

    k_c: float
    """Cohesive modulus of sinkage [N/m^(n+1)]."""
    k_phi: float
    """Frictional modulus of sinkage [N/m^(n+2)]."""
    exponent: float
    """Exponent n of sinkage [-]."""
    friction: float
    """Tangent of the friction angle phi [-]."""
    shear: float
    """Shear displacement modulus K [m]."""
    cohesion: float = 0.0
    """Cohesion c [Pa]."""
    tested: tuple[float, float] = (0.01, math.inf)
    """Least and largest width b for which k_c / b is known [m]; it is not extrapolated."""
    c1: float = 0.18
    """First factor of where the stress peaks, theta_m = (c1 + c2 slip) theta_f, in loose sand [Wong1967]."""
    c2: float = 0.32
    """Second factor of where the stress peaks."""

    def stiffness(self, width: float) -> float:
        """The modulus k_c / b + k_phi of a contact whose lesser extent b is a width [m]; in N/m^(n+2)."""
        return self.k_c / min(max(width, self.tested[0]), self.tested[1]) + self.k_phi


SHEAR_LOOSE: Final = 0.025
"""Shear displacement modulus K of loose sand, [Wong2008] [m]."""
DRY_SAND: Final = Soil(990.0, 1.52843e6, 1.1, math.tan(math.radians(28)), SHEAR_LOOSE, cohesion=1040.0)
"""Dry sand of the Land Locomotion Laboratory, [Wong2008]."""
POPPY: Final = Soil(0.0, float(PRESETS["poppy-seeds"].zeta or 0.0), 1.0, math.tan(math.radians(36)), 0.045)
"""Loose poppy seeds: the plate's 0.35 N/cm^3 of [Agarwal] Table 4.2, friction and K of [Agarwal2019]."""
POPPY_SOURCE: Final = "Wong-Reece; plate of Table 4.2, φ and K of [Agarwal2019]"
"""Source of the poppy seeds' numbers."""
POINTS: Final = 400
"""Points of the integrals over the contact."""


class WheelForce(NamedTuple):
    """Force of the soil on the wheel, by its components."""

    drawbar: float
    """Component along x, the wheel's heading [N]."""
    side: float
    """Component along y, across the heading [N]."""
    load: float
    """Upward component [N]."""


def wheel_force(
    soil: Soil, radius: float, width: float, sinkage: float, rim: float, velocity: tuple[float, float]
) -> WheelForce:
    """Force of the soil on a rigid wheel at a given sinkage; [Agarwal] eqs. (1.4), (1.5), and [Wong1967].

    Normal stress rises from entry (theta_f) to theta_m and falls to zero at the bottom. The shear displacement is the
    slip velocity's time integral since entry, and the shear stress points along it; across the wheel as in
    [Ishigami2007], without bulldozing at the wheel's side.

    Args:
        soil: The soil.
        radius: Outer radius of the wheel [m].
        width: Width of the wheel [m].
        sinkage: Sinkage of the outer circle [m].
        rim: Speed of the rim, omega R, positive [m/s].
        velocity: Velocity of the axle, along and across the heading [m/s].
    """
    entry = math.acos(1.0 - min(max(sinkage / radius, 1e-9), 1.0))
    slip = 1.0 - velocity[0] / rim if velocity[0] < rim else rim / velocity[0] - 1.0
    peak = min(max((soil.c1 + soil.c2 * slip) * entry, 0.0), 0.9 * entry)
    theta = np.linspace(0.0, entry, POINTS)
    front = np.where(theta >= peak, theta, entry - theta / max(peak, 1e-9) * (entry - peak))
    depth = radius * np.maximum(np.cos(front) - math.cos(entry), 0.0)
    contact = min(width, radius * math.sin(entry))
    normal = soil.stiffness(contact) * depth**soil.exponent
    since = (entry - theta) / (rim / radius)
    along = radius * (entry - theta) - velocity[0] / rim * radius * (math.sin(entry) - np.sin(theta))
    across = -velocity[1] * since
    travel = np.hypot(along, across) + 1e-12
    shear = (soil.cohesion + soil.friction * normal) * -np.expm1(-travel / soil.shear)

    def total(stress: Array) -> float:
        return float(np.trapezoid(stress, theta)) * radius * width

    ahead, aside = shear * along / travel, shear * across / travel
    return WheelForce(
        total(ahead * np.cos(theta) - normal * np.sin(theta)),
        total(aside),
        total(normal * np.cos(theta) + ahead * np.sin(theta)),
    )


def sinkage_under(
    soil: Soil, load: float, radius: float, width: float, rim: float, velocity: tuple[float, float]
) -> float:
    """Find the sinkage at which a wheel carries a load [N]; the radius where none does [m]."""

    def excess(sinkage: float) -> float:
        return wheel_force(soil, radius, width, sinkage, rim, velocity).load - load

    deepest = 0.999 * radius
    from scipy.optimize import brentq  # not before it is needed: it takes a second

    return float(brentq(excess, 1e-4 * radius, deepest)) if excess(deepest) > 0.0 else radius


def free_wheel() -> dict[str, Any]:
    """Steady rolling v / (R omega) and sinkage / l of the wheel of [Agarwal] Table 4.1 on loose poppy seeds."""

    def force(rolling: float, sinkage: float) -> tuple[float, float]:
        found = wheel_force(POPPY, GROUSER_WHEEL.outer_radius, GROUSER_WHEEL.width, sinkage, 1.0, (rolling, 0.0))
        return found.drawbar, found.load

    return {**steady(GROUSER_WHEEL, force)}
