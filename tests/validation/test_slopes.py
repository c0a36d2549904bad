"""Conventions of depth and up on a slope: one on level ground, and what each of them is by definition."""

import dataclasses

import numpy as np
import pytest
from rftsim_mpm.campaign import DATA, results
from rftsim_mpm.slope import Slope

from rftsim.validation.slopes import CONTINUUM, CONVENTIONS, LAWS, compare, left_over, resistance

PLATES = [Slope(beta=beta, gamma=gamma) for beta, gamma in ((0.0, 90.0), (90.0, 0.0), (40.0, 40.0), (-40.0, -40.0))]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("plate", PLATES, ids=lambda plate: f"{plate.beta:g}-{plate.gamma:g}")
def test_on_level_ground_all_conventions_agree(law, plate):
    """At theta = 0 both ups are one, and every factor is one."""
    level = plate.as_to_surface
    assert resistance(level, law, leans=False) == pytest.approx(resistance(level, law, leans=True), rel=1e-12)
    assert {convention.factor(0.0) for convention in CONVENTIONS.values()} == {1.0}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("plate", PLATES, ids=lambda plate: f"{plate.beta:g}-{plate.gamma:g}")
def test_the_surface_s_up_knows_no_slope(law, plate):
    """With the surface's up and the depth along its normal a plate feels what it feels on level ground."""
    level = resistance(plate.as_to_surface, law, leans=True)
    for slope in (-20.0, 10.0):
        tilted = dataclasses.replace(plate, slope=slope)
        assert resistance(tilted, law, leans=True) == pytest.approx(level, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("slope", [-20.0, 10.0, 20.0])
def test_gravity_s_up_is_the_law_of_the_plate_turned_back(law, slope):
    """With gravity's up a plate feels what it feels on level ground as it lies and moves to gravity.

    Depths of a plate's faces other than the leading one differ a little, as the plate has a thickness.
    """
    for beta, gamma in ((0.0, 90.0), (90.0, 0.0), (40.0, 40.0)):
        thin = Slope(slope=slope, beta=beta, gamma=gamma, thickness=0.0054)
        turned = resistance(thin.as_to_gravity, law, leans=True)
        assert resistance(thin, law, leans=False) == pytest.approx(turned, rel=0.02)


def test_conventions_differ_by_cosines():
    """Vertical depth is depth along the normal over cos(theta); gravity across the surface is cos(theta) of all."""
    theta = np.radians(20.0)
    by_kind = {(c.vertical, c.across): c.factor(theta) for c in CONVENTIONS.values()}
    assert by_kind == pytest.approx(
        {(False, False): 1.0, (True, False): 1 / np.cos(theta), (False, True): np.cos(theta)}
    )


def test_what_is_left_over_is_fitted():
    """Ratios made by the formula give back its two numbers, downhill and uphill, and miss nothing."""
    angles = [(slope, gamma) for slope in (-20.0, 10.0, 20.0) for gamma in (0.0, 40.0, 90.0)]
    cases = []
    for slope, gamma in angles:
        sine, along = np.sin(np.radians(slope)), np.cos(np.radians(gamma))
        cases.append({"slope": slope, "gamma": gamma, "continuum": 1.0 - 0.7 * sine * along - 1.4 * sine**2})
    assert left_over(cases) == pytest.approx((0.7, 1.4, 0.0), abs=1e-12)


@pytest.fixture(scope="module")
def found():
    return compare(results(DATA / "slopes"))


@pytest.fixture(scope="module")
def cases(found):
    return found["cases"]


def test_every_slope_has_its_level_ground(found):
    """Each plate on a slope is compared, and both ways along both slopes are there."""
    jobs = [Slope(**one["slope"]) for one in results(DATA / "slopes")]
    assert len(found["cases"]) + len(found["others"]) == sum(job.slope != 0.0 for job in jobs)
    drags = {case["slope"] for case in found["cases"] if case["gamma"] == 0.0}
    assert drags == {-20.0, -10.0, 10.0, 20.0}


def test_cells_half_as_large_change_little(found):
    """Resistance over level ground is within 0.04 of that in coarse cells."""
    for one in (other for other in found["others"] if other["cells"] == 20.0):
        (same,) = (case for case in found["cases"] if all(case[n] == one[n] for n in ("slope", "beta", "gamma")))
        assert one["continuum"] == pytest.approx(same["continuum"], abs=0.04)


def test_sand_takes_power_and_gives_none():
    """F . v < 0 on slopes and on level ground."""
    for one in results(DATA / "slopes"):
        assert np.dot(one["force"], Slope(**one["slope"]).direction) < 0.0, one["slope"]


def test_downhill_is_easier_than_uphill(cases):
    """The same plate and motion along the surface, or obliquely, meet less downhill than uphill."""
    found = {(case["beta"], case["gamma"], case["slope"]): case["continuum"] for case in cases}
    pairs = [(key, (*key[:2], -key[2])) for key in found if key[2] > 0.0 and (*key[:2], -key[2]) in found]
    assert len(pairs) >= 10
    for downhill, uphill in pairs:
        assert found[downhill] < found[uphill], downhill


def test_the_level_continuum_is_a_law_too(cases):
    """With the surface's up and depth along the normal, it foretells what level ground gives."""
    for case in cases:
        assert case["ratios"][CONTINUUM]["surface's up, depth along normal"] == pytest.approx(1.0)
