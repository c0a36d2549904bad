"""The material models on one element, against what can be derived by hand."""

import math

import numpy as np
import pytest
from numba import njit
from rftsim_mpm.bed import earth_pressure
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material, bearing_factor, inertial_shear, respond_plane, respond_solid, return_map


@njit
def _path(gradient, hold, steps, stress, theta, theta_d, constants):
    """Strain an element at a constant gradient.

    Where `hold` is negative, it widens in x so that s_xx stays so; where positive, in z as the dense state does.
    """
    slip, drift = 0.0, 0.0
    for _ in range(steps):
        lxx, lxz, lzx, lzz = gradient
        if hold < 0.0:  # secant steps on the lateral strain; the stress is piecewise linear in it
            a, b = -0.5 * lzz, -1.5 * lzz
            fa = respond_plane(stress, theta - a - lzz, theta_d, a, lxz, lzx, lzz, constants)[0][0] - hold
            for _ in range(60):
                fb = respond_plane(stress, theta - b - lzz, theta_d, b, lxz, lzx, lzz, constants)[0][0] - hold
                if abs(fb - fa) < 1e-12 * abs(hold):
                    break
                a, b, fa = b, b - fb * (b - a) / (fb - fa), fb
            lxx = b
        if hold > 0.0:
            lzz -= drift
        theta -= lxx + lzz
        before = theta_d
        stress, increment, theta_d = respond_plane(stress, theta, theta_d, lxx, lxz, lzx, lzz, constants)
        slip += increment
        drift = theta_d - before
    return stress, theta, theta_d, slip


def start(material, pressure, phi=None):
    theta_d = math.log(material.phi_c if phi is None else phi)
    return (-pressure, -pressure, -pressure, 0.0), theta_d + pressure / material.bulk, theta_d


@pytest.mark.parametrize("mu", [0.2, 0.3, 0.4, 0.5, 0.6])
def test_biaxial(mu):
    """Plane strain under constant lateral stress fails at sigma_1 / sigma_3 = (1 + mu)/(1 - mu): sin phi = mu."""
    material = Material.of_density(mu, 1500.0, 1e6)
    stress, *_ = _path((0.0, 0.0, 0.0, -2e-5), -100.0, 5000, *start(material, 100.0), material.constants(1e-4))
    assert stress[0] == pytest.approx(-100.0, rel=1e-9)
    assert stress[2] / stress[0] == pytest.approx((1.0 + mu) / (1.0 - mu), rel=1e-4)
    assert stress[1] == pytest.approx(0.5 * (stress[0] + stress[2]), rel=1e-4)


@pytest.mark.parametrize("mu", [0.2, 0.4, 0.6])
def test_simple_shear(mu):
    """At constant volume tau/sigma_n tends to mu, as the normal stresses turn equal."""
    material = Material.of_density(mu, 1500.0, 1e6)
    stress, *_ = _path((0.0, 1e-5, 0.0, 0.0), 0.0, 20000, *start(material, 10.0), material.constants(1e-4))
    assert stress[3] / -stress[2] == pytest.approx(mu, rel=1e-4)


@pytest.mark.parametrize("rate", [0.01, 1.0, 100.0, 1000.0])
def test_friction_grows_with_the_rate(rate):
    """Simple shear at a rate tends to mu(I) = mu + (mu_2 - mu)/(1 + I_0/I), I = rate d sqrt(rho_g/p) [Jop2006]."""
    material, dt, pressure = Material.of_density(0.38, 1500.0, 1e6, mu_2=0.64, grain=5e-4), 1e-4, 50.0
    stress, *_ = _path((0.0, rate * dt, 0.0, 0.0), 0.0, 40000, *start(material, pressure), material.constants(dt))
    inertial = rate * material.grain * math.sqrt(material.rho_g / pressure)
    expected = material.mu + (0.64 - material.mu) / (1.0 + material.i_0 / inertial)
    assert stress[3] / -stress[2] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("tau", [1.001, 1.5, 40.0])
def test_inertial_shear_is_that_of_its_own_flow(tau):
    """The returned stress is mu(I) p for the I that the step's own plastic shear makes."""
    p, mu, rise, shear, dt, grain, rho_g, i_0 = 80.0, 0.4, 0.26, 4e5, 2e-5, 1e-3, 2500.0, 0.279
    trial = tau * mu * p
    found = inertial_shear(p, trial, mu, rise, shear * dt * i_0 / (grain * math.sqrt(rho_g)))
    inertial = (trial - found) / (shear * dt) * grain * math.sqrt(rho_g / p)
    assert found == pytest.approx((mu + rise / (1.0 + i_0 / inertial)) * p, rel=1e-9)


def test_mu_of_i_needs_a_faster_friction_and_no_dilatancy():
    for bad in ({"mu_2": 0.3}, {"mu_2": math.inf}, {"mu_2": 0.6, "chi": 2.5}, {"mu_2": 0.6, "grain": 0.0}):
        with pytest.raises(MpmError, match=r"mu_2|grain"):
            Material(0.4, **bad)


@pytest.mark.parametrize("phi_0", [0.57, 0.63])
def test_dilatancy_in_closed_form(phi_0):
    """Plastic shear gamma turns phi_0 into phi_c / (1 + (phi_c/phi_0 - 1) exp(-chi phi_c gamma)): eq. (2.8) solved."""
    phi_c, chi = 0.6, 5.0
    material = Material(0.4, phi_c=phi_c, chi=chi, young=1e8)
    stress, theta, theta_d = start(material, 5000.0, phi_0)
    _, _, theta_d, gamma = _path((0.0, 5e-5, 0.0, 0.0), 1.0, 10000, stress, theta, theta_d, material.constants(1e-4))
    expected = phi_c / (1.0 + (phi_c / phi_0 - 1.0) * math.exp(-chi * phi_c * gamma))
    assert gamma > 0.45
    assert math.exp(theta_d) == pytest.approx(expected, rel=1e-4)


def test_dilatancy_anchor():
    """phi_0 0.57, phi_c 0.60, chi 5, gamma 0.5 gives 0.593036."""
    phi_0, phi_c, chi = 0.57, 0.60, 5.0
    theta_d, slip = math.log(phi_0), 1e-5
    for _ in range(50000):
        theta_d -= (math.exp(theta_d) - phi_c) * chi * slip
    assert math.exp(theta_d) == pytest.approx(0.593036, abs=2e-6)


def test_dilatant_pressure_follows_the_density_of_the_dense_state():
    """The return map's pressure is K ln(rho / (phi_d rho_g)) with the phi_d that it returns, to round-off."""
    material = Material(0.4, phi_c=0.6, chi=5.0, young=1e7)
    stress, theta, theta_d = start(material, 5000.0, 0.62)
    stress, theta, theta_d, _ = _path((0.0, 1e-4, 0.0, 0.0), 0.0, 500, stress, theta, theta_d, material.constants(1e-4))
    assert -sum(stress[:3]) / 3.0 == pytest.approx(material.bulk * (theta - theta_d), rel=1e-9)
    assert theta_d < math.log(0.62)


def test_dilatancy_needs_chi():
    """chi = 0 is NDPM bit for bit, whatever phi_c: by a random walk of strain through opening and closing."""
    rng = np.random.default_rng(3)
    walk = rng.normal(scale=2e-4, size=(3000, 4))
    plain, dilatant = Material(0.4, young=1e6), Material(0.4, young=1e6, chi=1e-300)
    states = [start(material, 100.0) for material in (plain, dilatant)]
    opened = 0
    for lxx, lxz, lzx, lzz in walk:
        states = [
            (lambda out, theta: (out[0], theta, out[2]))(
                respond_plane(stress, theta - lxx - lzz, theta_d, lxx, lxz, lzx, lzz, material.constants(1e-4)),
                theta - lxx - lzz,
            )
            for material, (stress, theta, theta_d) in zip((plain, dilatant), states, strict=True)
        ]
        assert states[0] == states[1]
        opened += states[0][0][0] == 0.0
    assert 100 < opened < 2900


@pytest.mark.parametrize("phi", [0.55, 0.60, 0.63])
def test_returned_stress_is_on_the_yield_line(phi):
    """Any trial state comes back with tau <= mu p; from outside it with tau = mu p, moved along the flow direction."""
    chi, k_over_g = 5.0, 13.0 / 6.0
    excess = (phi - 0.6) * chi
    mu, alpha = 0.4 + excess, k_over_g * excess
    rng = np.random.default_rng(0)
    for p, tau in zip(rng.uniform(-2.0, 2.0, 500), rng.uniform(0.0, 3.0, 500), strict=True):
        q, s = return_map(p, tau, mu, alpha)
        assert s <= mu * q + 1e-15
        if tau > mu * p and q > 0.0:
            assert s == pytest.approx(mu * q, rel=1e-12)
            assert q - p == pytest.approx(alpha * (tau - s), abs=1e-12)
        elif tau <= mu * p:
            assert (q, s) == (p, tau)


def test_plane_strain_is_the_solid_without_the_third_axis():
    """The two responses agree on every plane motion, and the solid's on a rotation of the axes."""
    rng = np.random.default_rng(1)
    material = Material(0.4, chi=3.0, young=1e6)
    constants = material.constants(1e-4)
    for _ in range(50):
        lxx, lxz, lzx, lzz = rng.normal(scale=1e-3, size=4)
        xx, yy, zz, xz = rng.normal(scale=100.0, size=4) - np.array([1000.0, 1000.0, 1000.0, 0.0])
        theta_d = math.log(0.61)
        theta = theta_d + 1000.0 / material.bulk
        plane, slip, dense = respond_plane((xx, yy, zz, xz), theta, theta_d, lxx, lxz, lzx, lzz, constants)
        solid, slip3, dense3 = respond_solid(
            (xx, yy, zz, 0.0, xz, 0.0), theta, theta_d, lxx, 0.0, lxz, 0.0, 0.0, 0.0, lzx, 0.0, lzz, constants
        )
        np.testing.assert_allclose((*plane, slip, dense), (*solid[:3], solid[4], slip3, dense3), rtol=1e-9, atol=1e-9)
        assert solid[3] == solid[5] == 0.0
        turned, slip_t, _ = respond_solid(  # x -> y -> z -> x
            (zz, xx, yy, 0.0, 0.0, xz), theta, theta_d, lzz, lzx, 0.0, lxz, lxx, 0.0, 0.0, 0.0, 0.0, constants
        )
        np.testing.assert_allclose((turned[1], turned[2], turned[0], turned[5]), plane, rtol=1e-9, atol=1e-9)
        assert slip_t == pytest.approx(slip, rel=1e-9, abs=1e-15)


def test_jaumann_rotates_the_stress():
    """A rigid turn by a quarter swaps the stresses: second order in the step."""
    material = Material(math.inf, young=1e6)
    for steps in (200, 400):
        turn = 0.5 * math.pi / steps
        stress, theta = (-300.0, -200.0, -100.0, 0.0), math.log(0.6) + 200.0 / material.bulk
        for _ in range(steps):
            stress, _, _ = respond_plane(stress, theta, math.log(0.6), 0.0, turn, -turn, 0.0, material.constants(1e-4))
        error = abs(stress[0] + 100.0)
        assert error < 400.0 * math.pi**2 / steps
    assert stress[1] == pytest.approx(-200.0)


def test_bearing_factor():
    """N_q of 30 degrees is 18.40 in every table."""
    assert bearing_factor(math.radians(30.0)) == pytest.approx(18.401, abs=1e-3)


@pytest.mark.parametrize("mu", np.linspace(0.05, 0.95, 10))
def test_a_level_bed_can_stand(mu):
    """K_0 lies between K_a and 1, and satisfies the yield condition with equal horizontal stresses."""
    k = earth_pressure(mu)
    assert (1.0 - mu) / (1.0 + mu) < k < 1.0
    assert (1.0 - k) / math.sqrt(3.0) <= mu * (1.0 + 2.0 * k) / 3.0


@pytest.mark.parametrize(
    ("bad", "said"),
    [({"mu": 0.0}, "mu"), ({"mu": 0.4, "young": -1.0}, "young"), ({"mu": 0.4, "poisson": 0.5}, "poisson"),
     ({"mu": 0.4, "chi": -1.0}, "chi"), ({"mu": 0.4, "phi_c": 0.4}, "phi_min"), ({"mu": math.nan}, "mu")],
)  # fmt: skip
def test_materials_that_cannot_be(bad, said):
    with pytest.raises(MpmError, match=said):
        Material(**bad)
