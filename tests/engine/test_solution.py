"""The tolerance and the iterations of the implicit force: from whoever sets them into the model."""

import mujoco
import numpy as np
import pytest
from trees import SAND, sandy, spec_of, xml

import rftsim
from rftsim import SceneError, add_sand, instances
from rftsim.law import layout

LEG = '<body name="leg" pos="0 0 .03"><freejoint/><geom type="capsule" size=".02 .06" euler="20 0 0"/></body>'


def carried(model):
    """The tolerance and the iterations that a model's one bed has."""
    (one,) = instances(model)
    return float(one.bed.tolerance), float(one.bed.iterations)


def test_defaults():
    assert carried(sandy(LEG, force="implicit")) == (layout.TOLERANCE, layout.ITERATIONS) == (3e-3, 40)


def test_options_reach_the_bed():
    assert carried(sandy(LEG, force="implicit", tolerance=0.02, iterations=7)) == (0.02, 7)
    assert carried(rftsim.load(xml(LEG), SAND, tolerance=1e-6, iterations=np.int64(60))) == (1e-6, 60)


def test_saved_models_keep_them(tmp_path):
    """As XML, and as MuJoCo's binary."""
    spec = spec_of(LEG)
    add_sand(spec, SAND, tolerance=2.5e-4, iterations=33)
    model = spec.compile()
    assert carried(mujoco.MjModel.from_xml_string(spec.to_xml())) == (2.5e-4, 33)
    path = str(tmp_path / "model.mjb")
    mujoco.mj_saveModel(model, path, None)
    assert carried(mujoco.MjModel.from_binary_path(path)) == (2.5e-4, 33)


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, 1e-7, 0.11, np.nan, np.inf, "0.01", None, True])
def test_tolerances_that_cannot_be(tolerance):
    spec = spec_of(LEG)
    with pytest.raises(SceneError, match=r"tolerance is that of the implicit force, 1e-06 to 0\.1, not"):
        add_sand(spec, SAND, tolerance=tolerance)
    assert not list(spec.numerics)


def test_a_tolerance_of_zero_was_meant_for_the_surfaces():
    with pytest.raises(SceneError, match="reduction=0 keeps every triangle"):
        add_sand(spec_of(LEG), SAND, tolerance=0)


@pytest.mark.parametrize("iterations", [0, -1, 61, 5.0, np.nan, "20", None, True])
def test_iterations_that_cannot_be(iterations):
    with pytest.raises(SceneError, match="iterations must be a whole number from 1 to 60, not"):
        add_sand(spec_of(LEG), SAND, iterations=iterations)


def test_reductions_do_not_ask_for_them(tmp_path, monkeypatch):
    """What was found for one tolerance is known for another."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for tolerance in (1e-4, 1e-2):
        add_sand(spec_of(LEG), SAND, tolerance=tolerance)
        assert len(list((tmp_path / "rftsim" / "reduced").iterdir())) == 1
