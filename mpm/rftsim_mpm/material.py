"""Sand as a frictional continuum: the non-dilatant (NDPM) and the dilatant (DPM) plasticity model, and mu(I).

The two are Drucker-Prager without cohesion: elastic while tau <= mu p, flowing along tau = mu p, and free of stress
wherever the sand has opened, rho < rho_c. In plane strain without dilatancy this is Mohr-Coulomb with sin(phi) = mu,
not tan(phi) = mu: where the sand flows, the stress across the plane is the mean of the two in it.

Neither has a length of its own: what flows without dilating gathers in bands as thin as cells let it. With mu(I) the
friction of NDPM grows with the rate of shear, so that bands which thin out get stronger.
"""

import dataclasses
import math

import numpy as np
from numba import njit

from rftsim_mpm.compiled import FASTMATH
from rftsim_mpm.errors import MpmError, check_positive


@dataclasses.dataclass(frozen=True)
class Material:
    """Parameters of [Agarwal] section 2.2; `chi` zero is NDPM, anything else DPM."""

    mu: float
    """Internal friction: mu_s of NDPM, mu_c (at the critical packing) of DPM [-]; infinite for an elastic solid."""
    rho_g: float = 2520.0
    """Density of the grains [kg/m^3]."""
    phi_c: float = 0.6
    """Critical packing fraction [-]; NDPM's rho_c is phi_c rho_g."""
    young: float = 1e6
    """Young's modulus of the elastic part [Pa]: a numerical parameter, see `stiffness`."""
    poisson: float = 0.3
    """Poisson's ratio of the elastic part [-]."""
    chi: float = 0.0
    """Slope of friction and dilatancy against packing fraction [-]."""
    phi_min: float = 0.45
    """Packing fraction below which no connected state exists [-]."""
    mu_2: float | None = None
    """Friction of the fastest flow, mu(I) = mu + (mu_2 - mu) / (1 + I_0 / I) with the inertial number I = gamma' d
    sqrt(rho_g / p) of a shear rate gamma' [Jop2006]; None where friction knows no rate."""
    i_0: float = 0.279
    """I_0 of mu(I) [-]: that of glass beads there."""
    grain: float = 1e-3
    """Diameter d of the grains in mu(I) [m]."""

    def __post_init__(self) -> None:
        if not self.mu > 0.0:
            raise MpmError(f"mu must be positive, not {self.mu:g}")
        check_positive(self, "rho_g", "phi_c", "young", "i_0", "grain")
        if not 0.0 <= self.poisson < 0.5:
            raise MpmError(f"poisson must be in [0, 0.5), not {self.poisson:g}")
        if not (math.isfinite(self.chi) and self.chi >= 0.0):
            raise MpmError(f"chi must be zero (no dilatancy) or positive, not {self.chi:g}")
        if not 0.0 < self.phi_min < self.phi_c < 1.0:
            raise MpmError(f"0 < phi_min < phi_c < 1 is needed, not phi_min {self.phi_min:g}, phi_c {self.phi_c:g}")
        if self.mu_2 is not None and not (self.mu < self.mu_2 < math.inf and self.chi == 0.0):
            raise MpmError(f"mu_2 must be above mu, and finite, and chi zero, not {self.mu_2:g} with chi {self.chi:g}")

    @classmethod
    def of_density(
        cls, mu: float, rho_c: float, young: float = 1e6, mu_2: float | None = None, grain: float = 1e-3
    ) -> "Material":
        """Return NDPM sand of critical density rho_c [kg/m^3], or sand of mu(I)."""
        if not (math.isfinite(rho_c) and rho_c > 0.0):
            raise MpmError(f"rho must be positive and finite, not {rho_c:g}")
        return cls(mu=mu, rho_g=rho_c / 0.6, phi_c=0.6, young=young, mu_2=mu_2, grain=grain)

    @property
    def rho_c(self) -> float:
        """Critical density of the sand, phi_c rho_g [kg/m^3]."""
        return self.phi_c * self.rho_g

    @property
    def bulk(self) -> float:
        """Bulk modulus K of the elastic part [Pa]."""
        return self.young / (3.0 * (1.0 - 2.0 * self.poisson))

    @property
    def shear(self) -> float:
        """Shear modulus G of the elastic part [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def wave_speed(self) -> float:
        """Speed of compression waves at the critical density [m/s]."""
        return math.sqrt((self.bulk + 4.0 / 3.0 * self.shear) / self.rho_c)

    def constants(self, dt: float) -> tuple[float, ...]:
        """Parameters as the compiled loops take them for steps of dt [s].

        They are K, G, mu, phi_c, chi, ln(phi_min), mu_2 - mu, and the shear stress by which a step relaxes at a shear
        rate of I_0, over the root of the pressure [Pa^0.5].
        """
        rise = 0.0 if self.mu_2 is None else self.mu_2 - self.mu
        relaxed = self.shear * dt * self.i_0 / (self.grain * math.sqrt(self.rho_g))
        return self.bulk, self.shear, self.mu, self.phi_c, self.chi, math.log(self.phi_min), rise, relaxed


def bearing_factor(phi: float) -> float:
    """Return N_q = exp(pi tan phi) tan^2(45 deg + phi/2), Prandtl and Reissner, of a friction angle [rad]."""
    return math.exp(math.pi * math.tan(phi)) * math.tan(math.pi / 4 + phi / 2) ** 2


def stiffness(rho: float, gravity: float, depth: float, mu: float, softness: float = 0.02) -> float:
    """Return Young's modulus [Pa] at which the bearing pressure of a depth [m] strains sand by about `softness`.

    rho g z N_q / E with the lower friction angle tan phi = mu. Softer sand takes longer steps; forces change by about
    3 % from there on (measured; see the plate study).
    """
    return rho * gravity * depth * bearing_factor(math.atan(mu)) / softness


@njit(fastmath=FASTMATH, error_model="numpy", inline="always")
def return_map(p, tau, mu, alpha):
    """Return a trial pressure and shear stress to the yield line, [Agarwal] section 2.3.1.

    Args:
        p: Trial pressure [Pa].
        tau: Trial equivalent shear stress [Pa].
        mu: Friction at the present packing [-].
        alpha: K chi (phi_d - phi_c) / G [-].

    Returns:
        Pressure and equivalent shear stress on or below the line.
    """
    if tau <= mu * p:
        return p, tau
    if p <= 0.0 and tau * alpha + p <= 0.0 and alpha * mu + 1.0 >= 0.0:
        return 0.0, 0.0
    p = (tau * alpha + p) / (1.0 + alpha * mu)
    return p, mu * p


@njit(fastmath=FASTMATH, error_model="numpy", inline="always")
def inertial_shear(p, tau, mu, rise, relaxed):
    """Return the shear stress of mu(I) at the end of a step, from a trial one above mu p [Pa].

    It solves tau' = (mu + rise / (1 + I_0 / I)) p with the I of the step's own flow, (tau - tau') / (G dt)
    [Dunatunga2015].

    Args:
        p: Pressure [Pa].
        tau: Trial equivalent shear stress [Pa].
        mu: Friction at rest [-].
        rise: mu_2 - mu [-].
        relaxed: The last of `Material.constants` [Pa^0.5].
    """
    slow, fast, step = mu * p, (mu + rise) * p, relaxed * np.sqrt(p)
    total, product = fast + tau + step, fast * tau + slow * step
    return 2.0 * product / (total + np.sqrt(total * total - 4.0 * product))


@njit(fastmath=FASTMATH, error_model="numpy", inline="always")
def flow(theta, theta_d, tau, constants):
    """Return what becomes of a trial stress: elastic, on the yield line, or none.

    The pressure follows the density, p = K (theta - theta_d). Unlike [Agarwal] section 2.3.1, which integrates its
    rate, this neither drifts nor gains a step's worth of pressure when sand closes.

    Args:
        theta: Logarithm of the packing fraction, ln(rho / rho_g) [-].
        theta_d: Logarithm of the packing fraction of the dense state, ln(phi_d) [-].
        tau: Trial equivalent shear stress [Pa].
        constants: `Material.constants`.

    Returns:
        Factor on the trial deviator, pressure [Pa], increment of plastic shear [-], new theta_d.
    """
    bulk, shear, mu, phi_c, chi, theta_min, rise, relaxed = constants
    if mu == np.inf:
        return 1.0, bulk * (theta - theta_d), 0.0, theta_d
    if theta < theta_d:
        if chi != 0.0 and theta < theta_min:
            theta_d = theta_min
        return 0.0, 0.0, tau / shear, theta_d
    excess = 0.0
    if chi != 0.0:
        excess = (np.exp(theta_d) - phi_c) * chi
    p, tau_new = return_map(bulk * (theta - theta_d), tau, mu + excess, bulk * excess / shear)
    if tau_new == tau:
        return 1.0, p, 0.0, theta_d
    if rise > 0.0 and p > 0.0:
        tau_new = inertial_shear(p, tau, mu, rise, relaxed)
    slip = (tau - tau_new) / shear
    return tau_new / tau, p, slip, theta_d - excess * slip


@njit(fastmath=FASTMATH, error_model="numpy", inline="always")
def respond_plane(stress, theta, theta_d, lxx, lxz, lzx, lzz, constants):
    """Return the stress after a step of plane strain, by Jaumann's rate of the deviator.

    Args:
        stress: xx, yy, zz, xz at the start [Pa].
        theta: At the end of the step, see `flow`.
        theta_d: At its start.
        lxx: Velocity gradient times dt [-], here and in the three that follow.
        lxz: d v_x / d z.
        lzx: d v_z / d x.
        lzz: d v_z / d z.
        constants: `Material.constants`.

    Returns:
        The four stresses [Pa], increment of plastic shear [-], new theta_d.
    """
    xx, yy, zz, xz = stress
    g2 = 2.0 * constants[1]
    old = (xx + yy + zz) * (1.0 / 3.0)
    mean = (lxx + lzz) * (1.0 / 3.0)
    spin = 0.5 * (lxz - lzx)
    turn = 2.0 * spin * xz
    txx = xx - old + g2 * (lxx - mean) + turn
    tyy = yy - old - g2 * mean
    tzz = zz - old + g2 * (lzz - mean) - turn
    txz = xz + 0.5 * g2 * (lxz + lzx) + spin * (zz - xx)
    tau = np.sqrt(0.5 * (txx * txx + tyy * tyy + tzz * tzz) + txz * txz)
    k, p, slip, theta_d = flow(theta, theta_d, tau, constants)
    return (k * txx - p, k * tyy - p, k * tzz - p, k * txz), slip, theta_d


@njit(fastmath=FASTMATH, error_model="numpy", inline="always")
def respond_solid(stress, theta, theta_d, lxx, lxy, lxz, lyx, lyy, lyz, lzx, lzy, lzz, constants):
    """Return the stress after a step in three dimensions: as `respond_plane`, of xx, yy, zz, yz, xz, xy."""
    xx, yy, zz, yz, xz, xy = stress
    g2 = 2.0 * constants[1]
    old = (xx + yy + zz) * (1.0 / 3.0)
    mean = (lxx + lyy + lzz) * (1.0 / 3.0)
    wyz, wxz, wxy = 0.5 * (lyz - lzy), 0.5 * (lxz - lzx), 0.5 * (lxy - lyx)
    txx = xx - old + g2 * (lxx - mean) + 2.0 * (wxy * xy + wxz * xz)
    tyy = yy - old + g2 * (lyy - mean) + 2.0 * (wyz * yz - wxy * xy)
    tzz = zz - old + g2 * (lzz - mean) - 2.0 * (wxz * xz + wyz * yz)
    tyz = yz + 0.5 * g2 * (lyz + lzy) + wyz * (zz - yy) - wxy * xz - wxz * xy
    txz = xz + 0.5 * g2 * (lxz + lzx) + wxz * (zz - xx) + wxy * yz - wyz * xy
    txy = xy + 0.5 * g2 * (lxy + lyx) + wxy * (yy - xx) + wxz * yz + wyz * xz
    tau = np.sqrt(0.5 * (txx * txx + tyy * tyy + tzz * tzz) + tyz * tyz + txz * txz + txy * txy)
    k, p, slip, theta_d = flow(theta, theta_d, tau, constants)
    return (k * txx - p, k * tyy - p, k * tzz - p, k * tyz, k * txz, k * txy), slip, theta_d
