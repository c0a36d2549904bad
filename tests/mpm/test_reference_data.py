"""The plates that are shipped: whole, symmetric, dissipative; and where the source's Table C.1 comes from."""

import math

import numpy as np
import pytest
from rftsim_mpm.campaign import DATA, results, status
from rftsim_mpm.reading import limit
from slip_lines import bearing_pressure

ALPHA_Z = 0.87574
"""alpha_z of a flat plate pushed down, over xi_n, by Table C.3."""
TABLE_C1 = {0.3: 0.51e6, 0.4: 0.92e6, 0.5: 1.58e6}
"""xi_n at rho 3000 kg/m^3 by internal friction [N/m^3], [Agarwal] appendix C."""


@pytest.fixture(scope="module")
def plates():
    return results(DATA / "plates")


@pytest.mark.parametrize(
    "name",
    [*("plates", "flat", "deep", "rates", "speeds", "wheels", "solids", "slopes", "ruts"), "held", "loaded", "drum"],
)
def test_they_are_whole(name):
    """Everything that was asked for is there, as it was written."""
    found = status(DATA / name)
    assert not found.damaged
    assert not found.missing


def test_there_are_enough(plates):
    """At least 60 at mu_int 0.4, with twisted ones and ones that rise; flat ones from mu_int 0.2 to 0.7."""
    sand = [found["plate"] for found in plates if found["plate"]["mu_int"] == 0.4]
    assert len(sand) >= 60
    assert sum(plate["psi"] != 0.0 for plate in sand) >= 20
    assert sum(plate["gamma"] < 0.0 for plate in sand) >= 20
    assert {found["plate"]["mu_int"] for found in plates} == {0.2, 0.3, 0.4, 0.5, 0.6, 0.7}


def test_sand_takes_power_and_gives_none(plates):
    """alpha . v < 0, whatever the plate does."""
    for found in plates:
        gamma = np.radians(found["plate"]["gamma"])
        assert np.dot(found["alpha_N_m3"], [np.cos(gamma), 0.0, -np.sin(gamma)]) < 0.0, found["plate"]


def test_forces_grow_with_friction(plates):
    """xi_n grows faster than linearly with mu_int, as Fig. C-2 has it."""
    flat = sorted((f["plate"]["mu_int"], f["alpha_N_m3"][2]) for f in plates if f["plate"]["mu_surf"] == 0.2)
    mu, alpha = np.array(flat).T
    assert (np.diff(alpha / mu) > 0.0).all()


def over_slip_lines(plate, alpha_z):
    """Pressure on a square plate over that on the smooth circle of its area, by slip lines with tan(phi) = mu [-]."""
    depth = plate["depth"] / plate["length"] * math.sqrt(math.pi) / 2.0  # in diameters
    return alpha_z / (plate["rho"] * 9.81) / (bearing_pressure(math.atan(plate["mu_int"]), depth) / depth)


def test_slip_lines_bear_what_is_published():
    """N_gamma of a smooth circle at 30 degrees is 7.10 [Martin2005]; on loads alone p grows with them (no gravity)."""
    assert 2.0 * bearing_pressure(math.radians(30.0), 1e-4, lines=48) == pytest.approx(7.10, rel=0.03)
    deep, deeper = (bearing_pressure(math.radians(30.0), depth) / depth for depth in (1e4, 2e4))
    assert deeper == pytest.approx(deep, rel=1e-3)


def test_flat_plates_bear_a_steady_share_of_their_slip_lines(plates):
    """Over mu 0.2 to 0.7, where the pressure grows 23-fold: constant within 10 %, between 1.1 and 1.45.

    A square bears more than a circle, its sides are rough, and the sand rises beside it. Table C.1 would be 1.9 to 2.3.
    """
    flat = [f for f in plates if f["plate"]["beta"] == 0.0 and f["plate"]["gamma"] == 90.0]
    ratios = np.array([over_slip_lines(f["plate"], f["alpha_N_m3"][2]) for f in flat])
    assert len({f["plate"]["mu_int"] for f in flat}) == 6
    assert ratios.max() / ratios.min() < 1.1
    assert 1.1 < ratios.min() < ratios.max() < 1.45


@pytest.mark.parametrize("cells", [7.0, 10.0])
def test_the_share_is_steady_at_other_cells(cells):
    own = [f for f in results(DATA / "flat") if (f["plate"]["early"], f["plate"]["cells"]) == (0.0, cells)]
    ratios = np.array([over_slip_lines(f["plate"], f["alpha_N_m3"][2]) for f in own])
    assert len(ratios) == 3
    assert ratios.max() / ratios.min() < 1.1
    assert 1.1 < ratios.min() < ratios.max() < 1.45


def flat_plates():
    return {
        (f["plate"]["mu_int"], f["plate"]["early"], f["plate"]["cells"]): f["alpha_N_m3"][2]
        for f in results(DATA / "flat")
    }


@pytest.mark.parametrize("mu", sorted(TABLE_C1))
def test_table_c1_has_contact_a_cell_early(mu):
    """With contact a cell outside the plate and cells as large as it is thick, Table C.1 comes out within 10 %."""
    assert flat_plates()[mu, 1.0, 7.0] == pytest.approx(ALPHA_Z * TABLE_C1[mu], rel=0.10)


@pytest.mark.parametrize("mu", sorted(TABLE_C1))
def test_both_contacts_have_one_limit(mu):
    """Finer cells bring the two contacts closer together: their limits of vanishing cells agree within 15 %."""
    found = flat_plates()
    limits = [float(limit(found[mu, e, 7.0], found[mu, e, 10.0], 10.0 / 7.0)) for e in (0.0, 1.0)]
    assert limits[1] == pytest.approx(limits[0], rel=0.15)
    assert found[mu, 1.0, 10.0] / found[mu, 0.0, 10.0] < found[mu, 1.0, 7.0] / found[mu, 0.0, 7.0]


@pytest.mark.parametrize(("mu", "share"), [(0.3, 0.623), (0.4, 0.664), (0.5, 0.743)])
def test_the_limit_is_below_table_c1(mu, share):
    """xi_n in the limit of vanishing cells is not that of Table C.1, see above, but 62 to 74 % of it."""
    found = flat_plates()
    alpha = float(limit(found[mu, 0.0, 7.0], found[mu, 0.0, 10.0], 10.0 / 7.0))
    assert alpha / (ALPHA_Z * TABLE_C1[mu]) == pytest.approx(share, abs=0.002)


def held(grousers, mu, dx, shift=0.0, mu_2=None, duration=None):
    """Load [N/m] and torque [N] of a shipped wheel at slip 0.3."""
    wanted = {"grousers": grousers, "mu_int": mu, "dx": pytest.approx(dx), "shift": shift, "prescribed_slip": 0.3}
    wanted |= {"mu_2": mu_2, "duration": duration}
    own = [f["heldwheel"] | f for f in results(DATA / "held")]
    own = [one for one in own if all(one.get(name) == value for name, value in wanted.items())]
    assert len(own) == 1
    return own[0]["load_N_m"], own[0]["torque_N"]


def test_a_wheel_in_weak_sand_has_converged():
    """At mu 0.4, load and torque: at most 5 % from cells of 2 to 1.33 mm, and from half a cell aside."""
    expected = pytest.approx(held(20, 0.4, 0.002), rel=0.05)
    assert held(20, 0.4, 0.004 / 3.0) == expected
    assert held(20, 0.4, 0.002, shift=0.5) == expected


@pytest.mark.parametrize(("grousers", "mu", "mu_2"), [(0, 0.4, 0.66), (20, 0.56, 0.82)])
def test_where_friction_grows_with_the_rate_wheels_have_converged(grousers, mu, mu_2):
    """With mu(I), load and torque: at most 5 % from cells of 2 to 1.33 mm, and from half a cell aside."""
    expected = pytest.approx(held(grousers, mu, 0.002, mu_2=mu_2), rel=0.05)
    assert held(grousers, mu, 0.004 / 3.0, mu_2=mu_2) == expected
    assert held(grousers, mu, 0.002, shift=0.5, mu_2=mu_2) == expected


def test_a_disc_on_poppy_seeds_has_converged_in_long_means():
    """With mu(I) from 0.56: at most 5 % from cells of 2 to 1.33 mm over twice the way, and from half a cell aside."""
    long = {"mu_2": 0.82, "duration": 1.44}
    assert held(0, 0.56, 0.004 / 3.0, **long) == pytest.approx(held(0, 0.56, 0.002, **long), rel=0.05)
    assert held(0, 0.56, 0.002, shift=0.5, mu_2=0.82) == pytest.approx(held(0, 0.56, 0.002, mu_2=0.82), rel=0.05)


@pytest.mark.parametrize(("mu", "least"), [(0.4, 0.85), (0.56, 0.7)])
def test_a_disc_bears_less_the_finer_its_cells(mu, least):
    """Without dilatancy there is no exact limit load: finer cells go from the upper limit towards the lower.

    N_q at sin(phi) = mu is 1.20 and 1.75 times that at tan(phi) = mu; the loads stay within such a range.
    """
    loads = [held(0, mu, dx)[0] for dx in (0.004, 0.002, 0.004 / 3.0)]
    assert loads == sorted(loads, reverse=True)
    assert loads[-1] > least * loads[0]
