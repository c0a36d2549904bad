"""The solids of section 5.9: their sizes are the text's."""

import numpy as np
import pytest
from rftsim_mpm.errors import MpmError
from rftsim_mpm.intruders import INTRUDERS, intruder, is_its_own_image

ELLIPSOID = 4.0 / 3.0 * np.pi * 0.075 * 0.045 * 0.045


@pytest.mark.parametrize(
    ("name", "volume"),
    [("sphere", 4.0 / 3.0 * np.pi * 0.05**3), ("ellipsoid", ELLIPSOID), ("half-ellipsoid", ELLIPSOID / 2),
     ("quarter-ellipsoid", ELLIPSOID / 4), ("cube-60-45", 0.075**3), ("prism-wide", 0.5 * 0.075**2 * 0.105),
     ("prism-tall", 0.5 * 0.105**2 * 0.075)],
)  # fmt: skip
def test_volumes(name, volume):
    """Volumes of the solids are those of the sizes given; what is round has chords for arcs."""
    shape = intruder(name)
    assert shape.content == pytest.approx(volume, rel=0.015)
    assert abs(shape.normals.T @ shape.areas).max() < 1e-12


def test_which_are_their_own_image():
    own = [name for name in INTRUDERS if is_its_own_image(intruder(name))]
    assert own == ["sphere", "ellipsoid", "cube-edge-on", "prism-wide", "prism-tall"]


def test_no_such_intruder():
    with pytest.raises(MpmError, match="take sphere, ellipsoid"):
        intruder("spher")
