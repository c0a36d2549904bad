"""Strength of sand from its density and internal friction: [Agarwal] Table C.1 and Fig. C-2, as printed."""

from typing import Final

import numpy as np

from rftsim.errors import SandError

GRAVITY: Final = 9.81
"""Gravity that the source's strengths belong to [m/s^2]."""

TABLE_C1: Final = (
    (0.0, 0.0),
    (0.1, 0.13e6),
    (0.2, 0.28e6),
    (0.3, 0.51e6),
    (0.4, 0.92e6),
    (0.5, 1.58e6),
    (0.7, 5.32e6),
    (0.9, 12.32e6),
)
"""[Agarwal] Table C.1: internal friction mu_int [-] against xi_n [N/m^3], at rho_c = 3000 kg/m^3."""

TABLE_C1_RHO_C: Final = 3000.0
"""Density of Table C.1 [kg/m^3]."""

XI_N_CUBIC: Final = (89.0, -386.0, 894.0)
"""[Agarwal] Fig. C-2: xi_n / (rho_c g) = 89 mu - 386 mu^2 + 894 mu^3. Misses Table C.1 by up to 34 %."""


def xi_n_from_table(rho_c: float, mu_int: float, g: float = GRAVITY) -> float:
    """The strength xi_n [N/m^3] by interpolation in [Agarwal] Table C.1, from SI units.

    Raises:
        SandError: mu_int is outside the table.
    """
    mu, xi = np.array(TABLE_C1).T
    if not mu[0] < mu_int <= mu[-1]:
        raise SandError(f"mu_int = {mu_int:g} is outside Table C.1 (0 to {mu[-1]:g}): give xi_n itself")
    return float(np.interp(mu_int, mu, xi)) * rho_c / TABLE_C1_RHO_C * g / GRAVITY


def xi_n_cubic(rho_c: float, mu_int: float, g: float = GRAVITY) -> float:
    """The strength xi_n [N/m^3] by the cubic of [Agarwal] Fig. C-2, which misses Table C.1 by up to 34 %."""
    a, b, c = XI_N_CUBIC
    return rho_c * g * mu_int * (a + mu_int * (b + mu_int * c))
