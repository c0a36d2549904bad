"""Steps on terrain: bodies rest on the flank of a dune, and the sand does no work on what falls onto dunes."""

import mujoco
import numpy as np
import pytest

import rftsim
import rftsim.engine.block
import rftsim.law.layout
from rftsim import Sand, Terrain
from rftsim.bench.trials import Trial, free_body, leave_alone, make_spec, plate, sphere

SAND = Sand(rho_c=3000.0, mu_int=0.6, mu_surf=0.6, xi_n=0.92e6)
WAVE, STEEP = 2.0, np.tan(np.radians(15.0))
X = np.arange(40) * WAVE / 40
DUNES = Terrain(np.tile(STEEP * WAVE / (2 * np.pi) * np.sin(2 * np.pi * X / WAVE), (40, 1)), WAVE / 40, repeat=True)


@pytest.mark.parametrize("body", [plate(0.3), sphere(1.5)])
def test_a_body_rests_on_the_flank_of_a_dune(body):
    """On a slope of 15 degrees it drifts by less than 0.05 mm in 10 s."""
    assert np.degrees(DUNES.steepest) == pytest.approx(15.0, abs=0.2)
    trial = Trial(make_spec(free_body(body, "0 0 .06")), 5e-3, "implicit", sand=SAND, terrain=DUNES)
    trial.run(3.0)
    left = leave_alone(trial)
    assert left["drift"] < 0.05
    assert left["speed"] < 1e-4


def starts_on_dunes(count):
    """Free bodies that are thrown onto dunes: lost ones, and the largest work of the sand in a step [J]."""
    lost, most = 0, -np.inf
    trial = Trial(
        make_spec(free_body('<geom type="box" size=".06 .04 .02" mass="0.4"/>', "0 0 .3")), 5e-3, "implicit",
        sand=SAND, terrain=DUNES)  # fmt: skip
    model, data = trial.model, trial.data
    for seed in range(count):
        rng = np.random.default_rng(seed)
        mujoco.mj_resetData(model, data)
        place = rng.uniform(-1.0, 1.0, 2)
        data.qpos[:3] = *place, float(DUNES.height_at(*place)) + rng.uniform(0.0, 0.2)
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        data.qvel[:] = rng.normal(size=6) * [1.0, 1.0, 1.0, 5.0, 5.0, 5.0]
        for _ in range(200):
            before = data.qvel.copy()
            mujoco.mj_step(model, data)
            energy = 0.5 * before @ (np.array([0.4] * 3 + [1e-3] * 3) * before)
            work = 0.5 * model.opt.timestep * float(data.qfrc_passive @ (before + data.qvel))
            most = max(most, work - 1e-7 * energy)
        lost += trial.failed
    return lost, most


def test_the_sand_does_no_work_on_what_is_thrown_onto_dunes():
    """As on level sand: in a step no more than what the strain under what rests holds, some microjoules."""
    lost, most = starts_on_dunes(100)
    assert lost == 0
    assert most < 5e-6


def test_the_terrain_moves_in_place_and_its_shape_does_not():
    model = rftsim.load(
        f"<mujoco><worldbody>{free_body(sphere(1.0), '0 0 .3')}</worldbody></mujoco>", SAND, terrain=DUNES
    )
    data = mujoco.MjData(model)
    relief = rftsim.instances(model)[0].relief
    head = rftsim.law.layout.record(relief, rftsim.law.layout.TERRAIN)
    before = float(rftsim.ground(model).height_at(0.3, 0.0))
    head.x += 0.7
    assert float(rftsim.ground(model).height_at(1.0, 0.0)) == pytest.approx(before, abs=1e-12)
    mujoco.mj_step(model, data)
    assert np.isfinite(data.qvel).all()
    head.columns += 1.0
    mujoco.mj_forward(model, data)
    assert np.isnan(rftsim.engine.block.read_block(data.plugin_data, data._address, 0).wrenches).all()
    with pytest.raises(mujoco.FatalError, match="finds no terrain of bed 'sand'"):
        mujoco.MjData(model)
