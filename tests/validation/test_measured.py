"""The measured wheel, where its data are; and what the rules for its grousers are by themselves."""

from pathlib import Path

import numpy as np
import pytest

from rftsim import surface_force
from rftsim.sand.medium import Sand
from rftsim.validation import measured, pockets
from rftsim.validation.cmu import WHEEL_FILE
from rftsim.validation.pockets import Grousers, Motion, Shaded

DATA = Path(__file__).parents[3] / "shared/data/cmu"
SAND = Sand(rho_c=1330.0, mu_int=0.55, mu_surf=0.35)
WHEEL = Grousers(hub=0.0575, tip=0.0625, width=0.06, number=24, thickness=0.002)
MOTION = Motion(0.045, 0.1, np.array([0.008, 0.004, 0.0]), 0.25)


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured data are not here")
def test_one_third_of_the_grousers_halves_the_error():
    """RMSE of the drawbar, nothing fitted: at least twice better with a third; side within 4 N, load within 6.5 N."""
    found = {rule: measured.rmse(measured.by_force_law(rule, DATA / WHEEL_FILE)) for rule in measured.SHARES}
    third = found["one third"]
    assert found["full grousers"]["drawbar"] > 2.0 * third["drawbar"]
    assert third["side"] < 4.0
    assert third["load"] < 6.5


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured data are not here")
def test_pockets_that_take_the_cheaper_way_do_as_well():
    """Least power per pocket, no third: drawbar more than twice better than with full grousers (6.6 N), side 4 N."""
    found = measured.rmse(measured.by_force_law(measured.LEAST, DATA / WHEEL_FILE))
    assert found["drawbar"] < 6.5 / 2.0
    assert found["side"] < 4.0


def test_a_solid_feels_what_its_surface_does():
    c, s = np.cos(MOTION.phase), np.sin(MOTION.phase)
    solid = WHEEL.with_height(1.0)
    expected = surface_force(
        solid.surface,
        SAND,
        position=(0, 0, MOTION.height),
        rotation=[[c, 0, s], [0, 1, 0], [-s, 0, c]],
        velocity=MOTION.velocity,
        angular_velocity=(0, MOTION.rate, 0),
    ).force
    np.testing.assert_allclose(pockets.force(solid, SAND, MOTION, "rft3d"), expected, rtol=1e-9)


@pytest.mark.parametrize("rate", [0.05, 0.16, 0.25, 0.6])
def test_the_cheaper_way_costs_least(rate):
    """The sand takes no more power from the wheel than where every pocket flows, or every one is carried along."""
    motion = MOTION._replace(rate=rate)
    shaded = Shaded(WHEEL)
    flowing = shaded._by_pocket(shaded.flowing, SAND, SAND, motion, "rft3d")
    carried = shaded._by_pocket(shaded.carried, SAND, pockets._on_itself(SAND), motion, "rft3d")
    least = np.maximum(flowing[1], carried[1]).sum()
    assert least >= max(flowing[1].sum(), carried[1].sum())
    cheaper = np.where((flowing[1] >= carried[1])[:, None], flowing[0], carried[0]).sum(axis=0)
    np.testing.assert_allclose(shaded.force(SAND, motion, "rft3d"), cheaper)


def test_without_grousers_there_is_nothing_to_shade():
    """Hub and tip alike, friction alike: all rules are one."""
    sand = SAND.replace(mu_surf=SAND.mu_int)
    smooth = Grousers(hub=0.06, tip=0.06, width=0.06, number=24, thickness=0.002)
    disc = pockets.force(smooth.disc(), sand, MOTION, "rft3d")
    np.testing.assert_allclose(Shaded(smooth).force(sand, MOTION, "rft3d"), disc, rtol=1e-12)
