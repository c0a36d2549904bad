"""What a file, an array or an edit in place holds neither ends the process nor gives a wrong force in silence."""

import copy
import ctypes
import os
from collections import Counter

import mujoco
import mutants
import numpy as np
import pytest
from trees import BALL, SAND, sandy, shaken, spec_of

from rftsim import SceneError, add_sand, instances, tractions, wrenches
from rftsim.engine.seal import SEAL_NUMBERS


@pytest.fixture(scope="module")
def bases():
    return mutants.bases()


forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="gives each mutant a process by forking")


def outcomes(bases, seed, count):
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        base = bases[k % len(bases)]
        kind, make, later = mutants.mutant(base, rng)
        found.append((kind, *mutants.in_process(mutants.lives, base, kind, make, later)))
    return found


def check(found):
    bad = [each for each in found if each[1] not in ("refused", "flagged", "right")]
    assert not bad, bad[:10]
    counts = Counter(each[1] for each in found)
    assert min(counts[kind] for kind in ("refused", "flagged", "right")) > len(found) // 50, counts


@forks
def test_mutated_models(bases):
    """Each is refused in one line, or has the force of what was written, or MuJoCo warns of its NaN."""
    check(outcomes(bases, 0, 100))


@forks
@pytest.mark.slow
def test_a_thousand_mutated_models(bases):
    """The same of a thousand others."""
    check(outcomes(bases, 1, 1000))


@forks
def test_a_mutant_that_ends_its_process_is_seen():
    """The generator's own net holds: a child that reads address 0 is told from one that is refused."""
    assert mutants.in_process(ctypes.string_at, 0).kind == "signal 11"


@pytest.mark.parametrize("force", ["explicit", "implicit"])
@pytest.mark.parametrize("count", [1e6, 1e9, np.nan, 3.0, -1.0])
def test_count_of_triangles(force, count):
    """It is refused when data are made, and NaN where it is written after that; never read as a size."""
    model = sandy(force=force)
    data = shaken(model)
    surface = instances(model)[0].bodies[1]
    surface[14] = count
    with pytest.raises(mujoco.FatalError, match="surface of body 'ball'"):
        mujoco.MjData(model)
    with pytest.raises(SceneError, match="ball"):
        tractions(model, data, "ball")
    mujoco.mj_forward(model, data)
    assert np.isnan(data.qfrc_passive).all()
    mujoco.mj_step(model, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 1


@pytest.mark.parametrize("field", ["xi_n", "mu_surf", "offset"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_parameters_out_of_bounds(field, value):
    """A sand's parameter that is none gives NaN, and the bed's own sentence when data are made of it."""
    model = sandy(force="implicit")
    data = shaken(model)
    instances(model)[0].bed[field] = value
    mujoco.mj_forward(model, data)
    assert np.isnan(data.qfrc_passive).all()
    with pytest.raises(mujoco.FatalError, match=r"bed 'sand': its normal must be .*parameters finite"):
        mujoco.MjData(model)


@pytest.mark.parametrize("force", ["explicit", "implicit"])
@pytest.mark.parametrize("place", ["lowest", "response", "table", "triangle"])
def test_edits_of_what_is_sealed(force, place):
    """A NaN box, an unknown law and other coefficients or triangles are NaN in place, and refused in new data."""
    model = sandy(force=force)
    data = shaken(model)
    bed, surface = instances(model)[0].bed, instances(model)[0].bodies[1]
    if place == "lowest":
        surface[3] = np.nan
    elif place == "response":
        bed.response = 7.0
    elif place == "table":
        bed.table[0, 0] *= 1.0 + 1e-9
    else:
        surface[40] *= 1.01
    mujoco.mj_forward(model, data)
    assert np.isnan(data.qfrc_passive).all()
    with pytest.raises(mujoco.FatalError, match="written"):
        mujoco.MjData(model)
    with pytest.raises(SceneError, match="was changed"):
        tractions(model, data, "ball")


@pytest.mark.parametrize("force", ["explicit", "implicit"])
@pytest.mark.parametrize("edited", ["ball", "twin", None])
def test_edits_of_one_of_two_bodies_alike(force, edited):
    """Bodies with the same numbers read the same ones, and whosever are changed, that is NaN; else both are pressed."""
    model = sandy(BALL + BALL.replace('"ball" pos="0', '"twin" pos="3'), force=force)
    data = mujoco.MjData(model)
    data.qvel[[2, 8]] = -1.0
    bed = instances(model)[0]
    np.testing.assert_array_equal(*bed.bodies.values())
    if edited:
        bed.bodies[model.body(edited).id][40] *= 1.01
    found = False
    for _ in range(3):  # two surfaces are more numbers than are looked at in one go
        mujoco.mj_forward(model, data)
        found = found or np.isnan(data.qfrc_passive).any()
    assert found == bool(edited)
    if not edited:
        np.testing.assert_allclose(data.qfrc_passive[:6], data.qfrc_passive[6:], rtol=1e-9, atol=1e-12)
        assert data.qfrc_passive[2] > 1.0


@pytest.mark.parametrize("force", ["explicit", "implicit"])
def test_bodies_taken_from_the_plugin(force):
    """Data made before, and copies into them, go on as they did; new data and new copies are refused."""
    model = sandy(force=force)
    data, twin = shaken(model), mujoco.MjData(model)
    before = wrenches(model, data).force[1].copy()
    model.body_plugin[1] = -1
    for _ in range(6):
        mujoco.mj_copyData(twin, model, data)
        for each in (data, twin):
            mujoco.mj_forward(model, each)
            np.testing.assert_array_equal(each.sensordata[:3], before)
        for make in (lambda: copy.copy(data), lambda: mujoco.MjData(model)):
            with pytest.raises(mujoco.FatalError, match=r"'ball'|'sand'"):
                make()


def test_data_of_another_model_are_an_error_that_says_so():
    """Reading what a bed did from data that have none."""
    with pytest.raises(SceneError, match="holds nothing of the model"):
        wrenches(sandy(), mujoco.MjData(spec_of().compile()))


def test_state_that_is_none():
    """NaN in plugin_state is NaN of the force, and gone after a reset."""
    model = sandy(force="implicit")
    data = shaken(model)
    data.plugin_state[:] = np.nan
    mujoco.mj_forward(model, data)
    assert np.isnan(data.qfrc_passive).all()
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    assert np.isfinite(data.qfrc_passive).all()


def test_a_step_that_cannot_be_solved_is_no_force():
    """Without a time step there is no force at its end: NaN, and what was in memory is not taken for one."""
    model = sandy(force="implicit")
    data = shaken(model)
    model.opt.timestep = 0.0
    mujoco.mj_forward(model, data)
    assert np.isnan(data.qfrc_passive).all()


def test_bodies_whose_names_are_numbers():
    """A body `1-ball` beside `ball` has its own surface, and so has every name that could be a numeric's."""
    other = BALL.replace('"ball" pos="0', '"1-ball" pos="3').replace('size=".1"', 'size=".05"')
    spec = spec_of(BALL + other)
    add_sand(spec, SAND, force="explicit", reduction=0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[[2, 8]] = -1.0
    mujoco.mj_forward(model, data)
    alone = sandy(other)
    single = mujoco.MjData(alone)
    single.qvel[2] = -1.0
    mujoco.mj_forward(alone, single)
    np.testing.assert_allclose(data.sensor("1-ball_sand").data, single.sensordata, rtol=1e-9, atol=1e-9)


def test_batch_of_edits():
    """Through batch.expand, one simulation's count of triangles makes its own force NaN and no other's."""
    batches = pytest.importorskip("mujoco.batch")
    model = sandy()
    batch = batches.Batch(model, nsim=3, nthread=2)
    batch.bind("qpos")[:], batch.bind("qvel")[:, 2] = model.qpos0, -1.0
    start = model.numeric("rftsim-body:ball").adr[0]
    batch.expand("numeric_data")[1, start + 14] = 1e9
    sensors = batch.bind("sensordata")
    batch.step()
    assert sensors[0, 2] > 1.0
    np.testing.assert_array_equal(sensors[2], sensors[0])
    assert not sensors[1, 2] > 1.0


def test_seals_survive_xml_twice():
    """MuJoCo prints six digits, and a seal knows the numbers by them too."""
    spec = spec_of()
    add_sand(spec, SAND)
    text = mujoco.MjSpec.from_string(spec.to_xml()).to_xml()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[2] = -1.0
    mujoco.mj_step(model, data)
    assert data.sensordata[2] > 1.0
    assert model.numeric("rftsim-sand:sand").data.size == instances(model)[0].packed.size + SEAL_NUMBERS
