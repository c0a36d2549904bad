"""What is drawn of the sand's forces, and pictures of any size in which what is buried shows."""

import copy

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim.model.bounds import bounds, corners
from rftsim.model.standing import standing
from rftsim.view import drawing, look, render, tractions
from rftsim.view.cameras import framing
from rftsim.view.forces import resultants

SCENE = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1" rgba="0 0 0 0"/>
  <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .05 .04" mass="12" rgba="1 0 0 1"/></body>
  <body name="ball" pos=".4 0 .1"><freejoint/><geom size=".05" mass="2" rgba="0 0 1 1"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def rest():
    """A box and a ball that have come to rest in sand."""
    model = rftsim.load(SCENE)
    data = mujoco.MjData(model)
    data.qpos[:] = standing(model, data).qpos
    mujoco.mj_step(model, data, nstep=200)
    return model, data


def drawn(model, data, **shown):
    scene = mujoco.MjvScene(model, maxgeom=5000)
    drawing.Drawing(model).draw(scene, data, drawing.Shown(**shown))
    return [scene.geoms[i] for i in range(scene.ngeom)]


def of_type(geoms, kind):
    return [geom for geom in geoms if geom.type == kind]


def test_a_force_is_an_arrow_from_the_surface_as_long_as_its_share_of_the_weight(rest):
    model, data = rest
    geoms = drawn(model, data, tractions=False)
    found = of_type(geoms, mujoco.mjtGeom.mjGEOM_ARROW)
    extent = bounds(model, data)[1]
    assert len(found) == 2
    for arrow, place, mass in zip(found, ((0, 0), (0.4, 0)), (12, 2), strict=True):
        assert arrow.pos == pytest.approx((*place, 0), abs=2e-3)
        assert arrow.mat[:, 2] == pytest.approx((0, 0, 1), abs=0.02)
        assert arrow.size[2] / 2 == pytest.approx(drawing.WEIGHT_LENGTH * extent * mass / 14, rel=0.02)
    assert [geom.label for geom in geoms if geom.label] == ["118 N", "19.6 N"]


def pressed(model, data, names=("box", "ball")):
    """Centres [m], stresses [Pa] and areas [m^2] of the triangles that the sand presses on."""
    found = [rftsim.tractions(model, data, name) for name in names]
    return (np.concatenate([getattr(one, part)[one.active] for one in found]) for part in ("centre", "stress", "area"))


def test_tractions_end_on_the_triangles_that_they_press(rest, monkeypatch):
    """Where there are few; the largest is as long as its share of the scale, which the legend says."""
    model, data = rest
    monkeypatch.setattr(tractions, "MOST", 10_000)
    monkeypatch.setattr(drawing, "FAINTEST_TRACTION", 0.0)
    scene, own = mujoco.MjvScene(model, maxgeom=5000), drawing.Drawing(model)
    own.draw(scene, data, drawing.Shown(False, True))
    centres, stresses, _ = pressed(model, data)
    arrows = [scene.geoms[i] for i in range(scene.ngeom)]
    tips = np.array([arrow.pos + arrow.mat[:, 2] * arrow.size[2] / 2 for arrow in arrows])
    nearest = np.linalg.norm(tips[:, None] - centres, axis=2)
    assert sorted(nearest.argmin(axis=1)) == list(range(len(centres)))
    assert nearest.min(axis=1).max() < 1e-6
    longest, strongest = max(arrow.size[2] / 2 for arrow in arrows), np.linalg.norm(stresses, axis=1).max()
    assert own.largest / 1.5 <= strongest <= own.largest
    assert longest == pytest.approx(drawing.TRACTION_LENGTH * own.extent * strongest / own.largest, rel=1e-5)


def test_few_arrows_carry_the_force_of_many_triangles(rest, monkeypatch):
    """The patches' mean tractions times their areas sum to the force, and each lies amid its triangles."""
    model, data = rest
    monkeypatch.setattr(tractions, "MOST", 20)
    found = tractions.patches(model, data, bounds(model, data)[1])
    assert 5 < len(found.centre) <= 2 * 20
    centres, stresses, area = pressed(model, data)
    assert found.area @ found.stress == pytest.approx(area @ stresses, rel=1e-9)
    assert found.area @ found.centre == pytest.approx(area @ centres, rel=1e-9)
    assert len(of_type(drawn(model, data, forces=False, tractions=True), mujoco.mjtGeom.mjGEOM_ARROW)) <= 2 * 20


def test_sides_of_a_thin_plate_have_arrows_of_their_own():
    plate = '<body name="plate" pos="0 0 -.1"><freejoint/><geom type="box" size=".1 .1 .001" mass="1"/></body>'
    model = rftsim.load(f"<mujoco><worldbody>{plate}</worldbody></mujoco>", "poppy-seeds", "drft3d", force="explicit")
    data = mujoco.MjData(model)
    data.qvel[:3] = 0.1, 0.0, -0.1
    mujoco.mj_forward(model, data)
    _, _, area = pressed(model, data, ["plate"])
    found = tractions.patches(model, data, 10.0)
    assert len(found.centre) > 1
    assert found.area.sum() == pytest.approx(area.sum())


@pytest.mark.parametrize(("value", "rounded"), [(1.0, 1.0), (1.01, 1.5), (4.1, 5.0), (8100.0, 1e4), (0.02, 0.02)])
def test_scales_are_round(value, rounded):
    assert tractions.round_up(value) == pytest.approx(rounded)


def test_pressures_in_words():
    assert [tractions.said(x) for x in (200.0, 5e3, 2e6)] == ["200 Pa", "5 kPa", "2 MPa"]


def test_a_full_scene_takes_no_more(rest):
    scene = mujoco.MjvScene(rest[0], maxgeom=3)
    drawing.Drawing(rest[0]).draw(scene, rest[1])
    assert scene.ngeom == 3


def test_nothing_is_drawn_in_the_air():
    model = rftsim.load(SCENE.replace('pos="0 0 .1"', 'pos="0 0 1"'))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert drawn(model, data) == []
    assert all((one.force == 0.0).all() for one in resultants(model, data))


def test_a_force_at_an_offset_starts_above_where_it_acts():
    """A body with its foot far from its origin: the arrow starts above the foot."""
    foot = '<body name="leg" pos="0 0 0"><freejoint/><geom size=".05" pos=".3 .2 -.03" mass="3"/></body>'
    model = rftsim.load(f"<mujoco><worldbody>{foot}</worldbody></mujoco>", force="explicit")
    data = mujoco.MjData(model)
    data.qvel[2] = -1e-3
    mujoco.mj_forward(model, data)
    (one,) = resultants(model, data)
    assert one.force[2] > 0.0
    assert one.start == pytest.approx((0.3, 0.2, 0.0), abs=2e-3)


def test_a_picture_larger_than_the_models_buffer_with_the_buried_showing(rest):
    """The lower face of the box is mixed with sand; the model's own buffer stays as it was."""
    model, data = rest
    assert model.vis.global_.offwidth < 960
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0, 0, 0), 0.5, 90, -30
    kept = copy.copy(model)
    shown = drawing.Shown(False, False, buried=True)
    picture = render.render(model, data, camera=camera, width=960, height=700, shown=shown)
    assert picture.shape == (700, 960, 3)
    assert model.vis.global_.offwidth < 960
    assert (model.tex_data == kept.tex_data).all()
    red = picture[..., 0].astype(float) - picture[..., 2]
    below = red[350:, 480]  # from the surface in front of the box down
    sand = np.median(red[600:, :100])
    assert below.max() > sand + 20.0, "something red shows through the sand"


@pytest.mark.parametrize("buried", [False, True])
def test_what_is_buried_is_seen_only_where_that_is_asked_for(rest, buried):
    """Pictures with bodies at two depths below the sand are the same picture, or not."""
    model, shown = rest[0], drawing.Shown(False, False, buried)
    camera, pictures = framing(*rest), []
    for height in (-0.06, -0.1):
        data = mujoco.MjData(model)
        data.qpos[[2, 9]] = height
        mujoco.mj_forward(model, data)
        pictures.append(render.render(model, data, camera=camera, width=320, height=200, shown=shown).astype(int))
    differ = np.abs(pictures[0] - pictures[1]).max(axis=2) > 20
    assert differ.any() == buried


def test_the_camera_shows_all_that_moves(rest):
    model, data = rest
    camera = framing(model, data)
    with render.Pictures(model, 480, 270) as pictures:
        picture = pictures.take(data, camera)
    assert picture.std() > 5.0
    assert camera.distance > 0.3
    assert camera.lookat == pytest.approx(bounds(model, data)[0])
    assert corners(model, data).shape == (16, 3)


def test_the_sand_is_found_under_a_prefix():
    """Of a model that was attached under another's prefix, too."""
    part = mujoco.MjSpec.from_string(SCENE)
    rftsim.add_sand(part)
    whole = mujoco.MjSpec()
    whole.attach(part, prefix="mine/", frame=whole.worldbody.add_frame())
    model = whole.compile()
    assert {model.geom(geom).name: bed for geom, bed in look.sand_geoms(model).items()} == {
        "mine/sand_surface": "mine/sand"
    }


def test_the_block_of_sand_has_its_upper_face_on_the_surface():
    """On a slope and far away, moved by whole periods of the texture along the surface."""
    terrain = rftsim.FreeSurface(0.3, (-0.2, 0.1, 1.0))
    model = rftsim.load(SCENE, terrain=terrain)
    data, scene = mujoco.MjData(model), mujoco.MjvScene(model, maxgeom=100)
    mujoco.mj_forward(model, data)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    mujoco.mjv_updateScene(model, data, option, mujoco.MjvPerturb(), camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    (sand,) = look.sand_geoms(model)
    geom = next(scene.geoms[i] for i in range(scene.ngeom) if scene.geoms[i].objid == sand)
    before, eye, period = geom.pos.copy(), np.array([30.0, -50.0, 2.0]), 0.5
    look.make_solid(geom, period, 0.5, eye)
    face = geom.pos + geom.size[2] * np.array(terrain.normal)
    assert terrain.depth(face) == pytest.approx(0.0, abs=1e-5)
    along = np.asarray(geom.mat).reshape(3, 3).T[:2]
    moved = along @ (face - before) / period
    assert moved == pytest.approx(moved.round(), abs=1e-4)
    assert np.abs(along @ (face - eye)).max() <= 0.5 * period + 1e-4
    assert geom.type == mujoco.mjtGeom.mjGEOM_BOX
