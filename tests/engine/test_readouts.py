"""What MuJoCo's sensors and its account of forces read on sand: what they read on rigid ground."""

import copy
import re

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from trees import SAND, shaken, spec_of, tree

from rftsim import add_sand, rne_post_constraint, tractions, wrenches
from rftsim.law.laws import get_law
from rftsim.model.readings import reading_doubts

G = 9.81
LEG, FOOT = 9.2, 1.0
"""Masses [kg]."""
WEIGHT = (LEG + FOOT) * G
"""Of the foot and what stands on it [N]."""
SETTLED = 1500
"""Steps after which what was put down lies still."""
PLANE = '<geom name="ground" type="plane" size="9 9 .1"/>'
STANDING = """
<body name="{p}leg" pos="{x} 0 .04"> <freejoint/>
  <geom type="sphere" size=".02" mass="9.2" pos="{load} 0 0" contype="0" conaffinity="0"/>
  <body name="{p}foot" pos="0 0 -.02">
    <geom type="box" size=".1 .05 .02" mass="1"/>
    <site name="{p}ankle" pos=".01 0 .02" quat=".6 0 .8 0"/>
    <site name="{p}sole" type="box" size=".11 .06 .03"/>
    <site name="{p}toe" type="box" size=".1 .06 .03" pos=".1 0 0"/>
    <site name="{p}heel" type="box" size=".1 .06 .03" pos="-.1 0 0"/>
    <site name="{p}below" type="box" size=".2 .1 .01" pos="0 0 -.1"/>
    <site name="{p}above" type="box" size=".2 .1 .01" pos="0 0 .1"/>
  </body>
</body>
"""
SENSORS = """
  <force name="{p}force" site="{p}ankle"/> <torque name="{p}torque" site="{p}ankle"/>
  <touch name="{p}touch" site="{p}sole"/> <touch name="{p}toe" site="{p}toe"/> <touch name="{p}heel" site="{p}heel"/>
  <touch name="{p}below" site="{p}below"/> <touch name="{p}above" site="{p}above"/>
"""


def standing(load=0.0, x=0.0, p=""):
    return STANDING.format(load=load, x=x, p=p)


def sensing(more="", p=""):
    return f"<sensor>{SENSORS.format(p=p)}{more}</sensor>"


def on_sand(bodies, extra=None, option="", force="implicit", **options):
    spec = spec_of(bodies, option, sensing() if extra is None else extra)
    add_sand(spec, SAND, force=force, **options)
    return spec.compile()


def on_plane(bodies, extra=None):
    return spec_of(PLANE + bodies, "", sensing() if extra is None else extra).compile()


def after(model, nstep=SETTLED):
    """Data so many steps after the start, by default at rest."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep)
    mujoco.mj_forward(model, data)
    assert not any(data.warning.number)
    return data


def reading(data, name):
    """A sensor's only number, or what a sensor of the ankle reads, in the world frame."""
    found = data.sensor(name).data
    return found[0] if found.size == 1 else data.site("ankle").xmat.reshape(3, 3) @ found


def read_by_mujoco(model, data):
    """cfrc_ext, cfrc_int and sensors where the wrenches of `rftsim.wrenches` are applied forces, without sand."""
    found, twin = wrenches(model, data), mujoco.MjData(model)
    twin.qpos[:], twin.qvel[:] = data.qpos, data.qvel
    twin.xfrc_applied[:, :3] = found.force
    twin.xfrc_applied[:, 3:] = found.moment + np.cross(data.xpos - data.xipos, found.force)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER
    mujoco.mj_forward(model, twin)
    model.opt.disableflags = 0
    return twin.cfrc_ext.copy(), twin.cfrc_int.copy(), twin.sensordata.copy()


@pytest.mark.parametrize("load", [0.0, 0.03])
def test_the_ankle_carries_the_leg(load):
    """At rest, on sand as on a plane: force and torque of the leg on the foot are its weight's, wherever that is."""
    for model in (on_plane(standing(load)), on_sand(standing(load))):
        data = after(model)
        weight = np.array([0.0, 0.0, -LEG * G])
        torque = np.cross(data.body("leg").xipos - data.site("ankle").xpos, weight)
        np.testing.assert_allclose(reading(data, "force"), weight, atol=0.01 * LEG * G)
        np.testing.assert_allclose(reading(data, "torque"), torque, atol=0.01 * np.linalg.norm(torque))


def test_a_flat_box_is_touched_by_its_weight():
    """A box that rests flat: `touch` reads its weight, of half of it half, of a zone below all, of one above none."""
    for model in (on_plane(standing()), on_sand(standing())):
        data = after(model)
        assert reading(data, "touch") == pytest.approx(WEIGHT, rel=0.01)
        assert reading(data, "toe") == pytest.approx(WEIGHT / 2, rel=0.01)
        assert reading(data, "heel") == pytest.approx(WEIGHT / 2, rel=0.01)
        assert reading(data, "below") == pytest.approx(WEIGHT, rel=0.01)
        assert reading(data, "above") == 0.0


def test_the_loaded_half_is_touched_more():
    """Under an eccentric load the toe's and the heel's pressures balance its moment, by an arm of half a sole."""
    data = after(on_sand(standing(0.03)))
    toe, heel = reading(data, "toe"), reading(data, "heel")
    assert toe + heel == pytest.approx(WEIGHT, rel=0.05)  # it lies askew, and the sole's friction bears a part
    arm = 0.03 * LEG / (LEG + FOOT)
    assert 0.03 < arm * WEIGHT / (toe - heel) < 0.1


def test_a_ball_is_touched_by_more_than_its_weight():
    """Pressures on a ball point in many directions: they add up to more than the force, and not to twice of it."""
    ball = '<body name="ball" pos="0 0 .05"><freejoint/><geom size=".05" mass="2"/><site name="s" size=".06"/></body>'
    data = after(on_sand(ball, '<sensor><touch name="touch" site="s"/></sensor>'))
    assert 2.0 * G < reading(data, "touch") < 4.0 * G


@pytest.mark.parametrize("law", ["rft2d", "drft2d", "rft3d", "drft3d", "rft3d:c4"])
def test_touch_is_the_sum_of_tractions(law):
    """Of a body in motion, all of it in the zone: the sum of max(0, -t.n) A of `rftsim.tractions`, under every law."""
    planar = get_law(law).planar
    bodies = tree(np.random.default_rng(3), ["planar" if planar else "free"], planar=planar)
    bodies = bodies.replace("<geom", '<site name="s" size="1"/><geom')
    options = {"force": "explicit", "law": law, "max_edge": 0.02, "terrain": 0.1}
    model = on_sand(bodies, '<sensor><touch name="touch" site="s"/></sensor>', **options)
    data = shaken(model, 4)
    faces = tractions(model, data, 1)
    pressing = np.maximum(-np.einsum("ij,ij->i", faces.stress, faces.normal), 0.0) * faces.area
    assert 0 < np.count_nonzero(pressing) < len(pressing)
    assert reading(data, "touch") == pytest.approx(pressing.sum(), rel=1e-9)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "ellipsoid", "cylinder", "box"])
def test_zones_of_every_shape(kind):
    """A zone that holds the whole of a ball reads all, one beside it none, one around its upper half nothing."""
    site = '<site name="{0}" type="{1}" size=".07 .07 .07" pos="{2}"/>'
    places = {"all": "0 0 0", "beside": "1 0 0", "upper": "0 0 .13"}
    sites = "".join(site.format(name, kind, pos) for name, pos in places.items())
    ball = f'<body name="ball" pos="0 0 .05"><freejoint/><geom size=".05" mass="2"/>{sites}</body>'
    sensors = "".join(f'<touch name="{name}" site="{name}"/>' for name in places)
    data = after(on_sand(ball, f"<sensor>{sensors}</sensor>"), 200)
    assert reading(data, "all") > 2.0 * G
    assert reading(data, "beside") == reading(data, "upper") == 0.0


def test_at_first_touch_the_pressure_is_that_of_a_translation():
    """At zero velocity no triangle leads, yet the implicit force is that at the end of the step: `touch` reads it."""
    model = on_sand(standing().replace("0 .04", "0 .03"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    force = wrenches(model, data).force[model.body("foot").id]
    assert force[2] > 10.0
    assert reading(data, "touch") == pytest.approx(force[2], rel=0.02)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("force", ["implicit", "explicit"])
def test_force_and_acceleration_agree_in_motion(integrator, force):
    """While the foot sinks in, the leg's mass times its acceleration is what the ankle bears, under each integrator."""
    option = f'<option timestep="0.0005" integrator="{integrator}"/>'
    more = '<framelinacc name="a" objtype="body" objname="leg"/>'
    data = after(on_sand(standing(), sensing(more), option, force), 100)
    assert reading(data, "force")[2] < -20.0
    expected = -LEG * data.sensor("a").data  # with gravity, as an accelerometer's
    np.testing.assert_allclose(reading(data, "force"), expected, atol=1e-6 * WEIGHT)


@pytest.mark.parametrize("seed", range(4))
def test_all_is_as_if_the_wrenches_were_applied_forces(seed):
    """cfrc_ext, cfrc_int, force and torque of random trees: MuJoCo's own, had the sand's wrenches been xfrc_applied."""
    rng = np.random.default_rng(seed)
    bodies = tree(rng, ["free", *rng.choice(["ball", "slide", "hinge", "two", "none"], size=5)])
    bodies = re.sub(r'(<body name="(b\d)"[^>]*>)', r'\1<site name="\2" pos=".01 .02 .03" euler="20 30 40"/>', bodies)
    sensors = "".join(f'<force site="b{i}"/><torque site="b{i}" cutoff="2"/>' for i in range(6))
    model = on_sand(bodies, f"<sensor>{sensors}</sensor>", force="explicit", terrain=0.1, sensors=False)
    data = shaken(model, seed, 0.3)
    for found, expected in zip(
        (data.cfrc_ext, data.cfrc_int, data.sensordata), read_by_mujoco(model, data), strict=True
    ):
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(data.cfrc_ext).max())


def test_after_rne_post_constraint_the_account_is_whole():
    """Called after a step, as Gymnasium does: MuJoCo's own forgets the sand, ours carries the weight, twice, too."""
    model = on_sand(standing())
    data = after(model)
    foot, leg = model.body("foot").id, model.body("leg").id
    mujoco.mj_rnePostConstraint(model, data)
    assert not data.cfrc_ext.any()
    for _ in range(2):
        rne_post_constraint(model, data)
        np.testing.assert_allclose(data.cfrc_ext[foot, 3:], [0.0, 0.0, WEIGHT], atol=0.01 * WEIGHT)
        np.testing.assert_allclose(data.cfrc_int[foot, 3:], [0.0, 0.0, -LEG * G], atol=0.01 * WEIGHT)
        np.testing.assert_allclose(data.cfrc_int[[0, leg]], 0.0, atol=1e-4 * WEIGHT)


def test_cutoffs_are_kept():
    """What is mended is cut again: force and torque on both sides, touch above."""
    cut = (
        sensing().replace('site="ankle"', 'site="ankle" cutoff="0.3"').replace('site="sole"', 'site="sole" cutoff="60"')
    )
    plain, found = after(on_sand(standing(0.03))), after(on_sand(standing(0.03), cut))
    for name in ("force", "torque"):
        np.testing.assert_allclose(found.sensor(name).data, np.clip(plain.sensor(name).data, -0.3, 0.3))
    assert found.sensor("touch").data[0] == 60.0


def test_two_beds_in_one_tree():
    """Two feet of one body, each in sand of its own: each ankle bears half, and the body is free."""
    shin = '<body name="{p}shin" pos="{x} 0 0"><joint axis="0 1 0" damping="1"/>{rest}</body>'
    feet = "".join(
        shin.format(p=p, x=x, rest=standing(p=p).replace("<freejoint/>", "").replace(' 0 .04"', ' 0 0"'))
        for p, x in (("l", -0.5), ("r", 0.5))
    )
    body = f'<body name="hip" pos="0 0 .04"><freejoint/><geom size=".02" mass="4" contype="0"/>{feet}</body>'
    spec = spec_of(body, '<option timestep="0.001"/>', sensing(p="l") + sensing(p="r"))
    add_sand(spec, SAND, bodies=["lfoot"])
    add_sand(spec, SAND.replace(xi_n=2 * SAND.xi_n), bodies=["rfoot"], name="second")
    data = after(spec.compile(), 4000)
    for p in ("l", "r"):
        turn = data.site(f"{p}ankle").xmat.reshape(3, 3)
        carried = turn @ data.sensor(f"{p}force").data
        np.testing.assert_allclose(carried[2], -(LEG + 2.0) * G, rtol=0.02)
        assert data.sensor(f"{p}touch").data[0] == pytest.approx((LEG + FOOT + 2.0) * G, rel=0.03)
    np.testing.assert_allclose(data.cfrc_int[data.model.body("hip").id], 0.0, atol=1e-3 * WEIGHT)


@pytest.mark.parametrize("force", ["implicit", "explicit"])
def test_in_the_air_nothing_is_changed(force):
    """Above the sand every reading is the one without sand."""
    high = standing().replace("0 .04", "0 4")
    wet, dry = (after(model, 20) for model in (on_sand(high, force=force), on_plane(high)))
    np.testing.assert_array_equal(wet.sensordata[: dry.sensordata.size], dry.sensordata)
    np.testing.assert_array_equal(wet.cfrc_int, dry.cfrc_int)
    assert not wet.cfrc_ext.any()


@pytest.mark.parametrize("force", ["implicit", "explicit"])
def test_nothing_is_added_twice(force):
    """mj_forward again, mj_sensorAcc alone, copies, and rne_post_constraint: all leave the same."""
    model = on_sand(standing(0.03), force=force)
    data = after(model, 100)
    whole = [data.cfrc_ext.copy(), data.cfrc_int.copy(), data.sensordata.copy()]
    assert np.abs(whole[0]).max() > 1.0
    for call in (mujoco.mj_forward, mujoco.mj_sensorAcc, rne_post_constraint, mujoco.mj_sensorAcc):
        twin = copy.copy(data)
        for one in (twin, data, data):
            call(model, one)
            for found, expected in zip((one.cfrc_ext, one.cfrc_int, one.sensordata), whole, strict=True):
                np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("force", ["implicit", "explicit"])
def test_stepped_in_halves(force):
    """mj_step1 and mj_step2 read as mj_step does; between them, the wrench's sensor is that of this step already."""
    model = on_sand(standing(0.03), force=force)
    one, two = mujoco.MjData(model), mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, one)
        mujoco.mj_step1(model, two)
        np.testing.assert_array_equal(one.sensor("foot_sand").data, two.sensor("foot_sand").data)
        mujoco.mj_step2(model, two)
        np.testing.assert_array_equal(one.sensordata, two.sensordata)
    assert one.sensor("touch").data[0] > 10.0


@pytest.mark.parametrize("force", ["implicit", "explicit"])
def test_rollouts_and_batches_read_the_same(force):
    """Bit for bit, at two threads."""
    model = on_sand(standing(0.03), force=force)
    data, rows = mujoco.MjData(model), []
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    for _ in range(60):
        mujoco.mj_step(model, data)
        rows.append(data.sensordata.copy())
    assert data.sensor("touch").data[0] > 10.0
    others = [mujoco.MjData(model) for _ in range(2)]
    _, found = rollout.rollout(model, others, np.tile(state, (4, 1)), nstep=60)
    np.testing.assert_array_equal(found, [rows] * 4)
    batch = pytest.importorskip("mujoco.batch").Batch(model, nsim=4, nthread=2)
    sensors, account = batch.bind("sensordata"), batch.bind("cfrc_ext")
    batch.reset(range(4), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
    for row in rows:
        batch.step()
        np.testing.assert_array_equal(sensors, [row] * 4)
    np.testing.assert_array_equal(account.reshape(4, -1), [data.cfrc_ext.ravel()] * 4)


def test_delays_and_intervals():
    """A sensor that MuJoCo keeps back reads what the plain one read then; one with an interval, what it read last."""
    late = "".join(
        f'<{kind} name="late {kind}" site="ankle" nsample="5" delay=".004"/>' for kind in ("force", "torque")
    )
    rare = '<force name="rare" site="ankle" {0}/><touch name="rt" site="sole" {0}/>'.format(
        'nsample="2" interval=".01"'
    )
    model = on_sand(standing(0.03), sensing(late + rare))
    data, seen = mujoco.MjData(model), []
    for _ in range(80):
        mujoco.mj_step(model, data)
        seen.append({name: data.sensor(name).data.copy() for name in ("force", "torque", "touch")})
        if len(seen) < 20:
            continue
        for kind in ("force", "torque"):
            np.testing.assert_allclose(data.sensor(f"late {kind}").data, seen[-3][kind], rtol=1e-9, atol=1e-12)
        tick = (len(seen) - 1) // 5 * 5
        np.testing.assert_array_equal(data.sensor("rare").data, seen[tick]["force"])
        np.testing.assert_array_equal(data.sensor("rt").data, seen[tick]["touch"])
    assert seen[-1]["touch"][0] > 10.0


@pytest.mark.filterwarnings("ignore::rftsim.RftsimWarning")  # add_sand says it too
def test_doubts_name_what_cannot_read_sand():
    """One line a kind: contact sensors that watch the foot, late touch, meshes as zones, user sensors; else none."""
    mesh = '<asset><mesh name="tip" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>'
    bodies = standing().replace('<site name="ankle"', '<site name="tip" type="mesh" mesh="tip"/><site name="ankle"')
    blind = {
        '<contact name="c" body1="foot"/><contact subtree1="leg"/><contact site="sole"/><contact/>': "'c' .and 3 more",
        '<touch name="late" site="sole" nsample="2" delay=".002"/>': "'late' .*delay",
        '<touch name="zone" site="tip"/>': "'zone' .*mesh",
        '<user name="own" dim="1" needstage="acc"/>': "'own' .*user",
    }
    for more, says in blind.items():
        model = on_sand(bodies, mesh + sensing(more))
        (doubt,) = reading_doubts(model, [model.body("foot").id])
        assert re.search(says, doubt)
    quiet = on_sand(bodies, mesh + sensing('<contact body1="leg"/><rangefinder site="sole"/>'))
    assert reading_doubts(quiet, [quiet.body("foot").id]) == []
    quiet.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    (doubt,) = reading_doubts(quiet, [quiet.body("foot").id])
    assert "rne_post_constraint" in doubt
