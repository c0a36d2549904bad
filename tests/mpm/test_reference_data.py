"""The plates that are shipped: whole, symmetric, dissipative; and where the source's Table C.1 comes from."""

import numpy as np
import pytest
from rftsim_mpm.campaign import DATA, results, status
from rftsim_mpm.reading import limit

ALPHA_Z = 0.87574
"""alpha_z of a flat plate pushed down, over xi_n, by Table C.3."""
TABLE_C1 = {0.3: 0.51e6, 0.4: 0.92e6, 0.5: 1.58e6}
"""xi_n at rho 3000 kg/m^3 by internal friction [N/m^3], [Agarwal] appendix C."""


@pytest.fixture(scope="module")
def plates():
    return results(DATA / "plates")


@pytest.mark.parametrize("name", ["plates", "flat", "deep", "rates", "wheels", "solids", "slopes"])
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
