"""The motions of the study of ruts, under sand that forgets: pushes, passes and places of a way are all alike."""

import numpy as np
import pytest

from rftsim.validation import played, ruts

FORGETS = "no ruts"


def test_sand_that_forgets_is_pushed_twice_alike():
    """The second push has the first one's force at every depth, and goes on in proportion to it."""
    found = played.foot(FORGETS)
    depths = np.array([0.003, 0.012, 0.027])
    np.testing.assert_allclose(ruts.ratios(found, depths), 1.0, rtol=1e-6)
    force = np.interp([0.02, 0.04], found["second"]["depth_m"], found["second"]["force"])
    assert force[0] > 0.0
    assert force[1] > 2.0 * force[0]  # the sole's grows with depth, the walls' with its square


def test_sand_that_forgets_heaps_up_nothing():
    """The drag is the same all the way."""
    drag = np.array(played.blade(FORGETS)["drag"])
    np.testing.assert_allclose(drag, drag[0], rtol=1e-6)
    assert drag[0] > 0.0


def test_sand_that_forgets_bears_a_wheel_twice_alike():
    found = played.wheel(FORGETS)
    assert found["slip"][1] == pytest.approx(found["slip"][0], rel=1e-9)
    assert found["sinkage_m"][1] == pytest.approx(found["sinkage_m"][0], rel=1e-9)
    assert 0.0 < found["slip"][0] < 1.0
