"""The drawn ground lies on the ground, stays in place while cameras and robots move, and hides no mark in it."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rftsim
from rftsim.law import layout
from rftsim.model import drawing, relief
from rftsim.model.draft import make_draft
from rftsim.view import cameras, fields, look, render
from rftsim.view.drawing import Shown

EXTENT = 0.5
GRAIN = 0.2


def dunes(repeat=True):
    """Terrain of 9.6 m with waves of some metres and 0.2 m height."""
    rng, places = np.random.default_rng(3), 2.0 * np.pi * np.arange(48) / 48
    x, y = np.meshgrid(places, places)
    waves = [(1, 0), (2, 1), (1, 3), (4, 2), (3, 5)]
    return rftsim.Terrain(0.05 * sum(np.cos(a * x + b * y + rng.uniform(0, 7)) for a, b in waves), 0.2, repeat=repeat)


@dataclasses.dataclass
class Rutted:
    """Ground with a rut along x, 6 cm wide and 3 cm deep, in another one."""

    under: rftsim.FreeSurface | rftsim.Terrain
    place: float = 0.0
    window: None = None

    def undisturbed_at(self, x, y):
        return self.under.height_at(x, y)

    def height_at(self, x, y):
        return self.under.height_at(x, y) - 0.03 * np.exp(-(((y - self.place) / 0.03) ** 2))


RUTS = rftsim.Ruts(0.0125, (1.6, 0.8))
MARKS = relief.Fineness(0.0125, 1.6)
GROUNDS = {
    "dunes": (dunes(), None),
    "dunes that end": (dunes(False), None),
    "ruts in a slope": (rftsim.FreeSurface(0.1, (0.1, 0.2, 1.0)), MARKS),
    "ruts in dunes": (dunes(), MARKS),
}


def sampled(name, focus):
    under, marks = GROUNDS[name]
    levels = relief.make_levels(under, marks, GRAIN, EXTENT)
    surface = under if marks is None else Rutted(under)
    return levels, relief.sample_fields(levels, np.array(focus), surface.height_at, GRAIN), surface


def vertices(level, field):
    """x, y, z of a field's vertices, (n, n, 3)."""
    along = level.cell * (np.arange(level.cells + 1) - level.cells / 2)
    x, y = np.meshgrid(field.centre[0] + along, field.centre[1] + along)
    return np.stack([x, y, field.heights], axis=-1)


def within(points, level, field, margin=0.0):
    return (np.abs(points[..., :2] - field.centre) < 0.5 * level.width - margin).all(axis=-1)


@pytest.mark.parametrize("name", GROUNDS)
def test_what_is_seen_lies_on_the_ground(name):
    """Vertices lie on it exactly where no finer field is above them, except on rims, just below the coarser field."""
    levels, found, surface = sampled(name, (1.3, -0.7))
    for k, (level, field) in enumerate(zip(levels, found, strict=True)):
        points = vertices(level, field)
        inner = (
            within(points, level, field, 0.5 * level.cell) if k + 1 < len(levels) else np.ones(points.shape[:2], bool)
        )
        if k:
            inner &= ~within(points, levels[k - 1], found[k - 1], 0.5 * level.cell)
        assert points[inner][:, 2] == pytest.approx(surface.height_at(*points[inner][:, :2].T), abs=1e-9)
    assert levels[-1].width >= 2.0 * relief.REACH * EXTENT


@pytest.mark.parametrize("name", GROUNDS)
def test_a_finer_field_is_not_hidden_by_the_coarser_one_and_joins_it(name):
    levels, found, _ = sampled(name, (0.4, 2.2))
    for fine, inner, coarse, outer in zip(levels, found, levels[1:], found[1:], strict=False):
        points, edge = vertices(fine, inner), 1e-9 + coarse.cell
        drawn = heights_of(coarse, outer, points)
        middle = within(points, fine, inner, edge)
        assert (drawn[middle] < points[middle][:, 2]).all()
        rim = ~within(points, fine, inner, 0.5 * fine.cell)
        assert points[rim][:, 2] == pytest.approx(drawn[rim] - relief.SKIRT * fine.cell, abs=1e-9)


def heights_of(level, field, points):
    """The height of a field's triangles, by the higher of both diagonals, at points (..., 3) [m]."""
    place = (points[..., :2] - field.centre) / level.cell + level.cells / 2
    first = np.clip(np.floor(place + 1e-9).astype(int), 0, level.cells - 1)
    (s, t), (i, j) = np.moveaxis(place - first, -1, 0), np.moveaxis(first, -1, 0)
    a, b = field.heights[j, i], field.heights[j, i + 1]
    c, d = field.heights[j + 1, i], field.heights[j + 1, i + 1]
    one = np.where(s + t < 1.0, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d))
    other = np.where(s > t, a + s * (b - a) + t * (d - b), a + t * (c - a) + s * (d - c))
    return np.maximum(one, other)


@settings(max_examples=30, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50), st.sampled_from(sorted(GROUNDS)))
def test_fields_move_by_whole_periods_of_the_grain_and_stay_over_one_another(x, y, name):
    """So that grain and vertices stay in place, whatever is followed; and no field leaves the coarser one."""
    under, marks = GROUNDS[name]
    levels = relief.make_levels(under, marks, GRAIN, EXTENT)
    centres = relief.centres(levels, np.array([x, y]), GRAIN)
    assert centres / GRAIN == pytest.approx(np.rint(centres / GRAIN), abs=1e-6)
    for fine, inner, coarse, outer in zip(levels, centres, levels[1:], centres[1:], strict=False):
        corner = (inner - 0.5 * fine.width) / coarse.cell
        assert corner == pytest.approx(np.rint(corner), abs=1e-6)
        assert (np.abs(inner - outer) + 0.5 * fine.width < 0.5 * coarse.width).all()
    assert np.abs(centres[0] - [x, y]).max() <= 0.5 * max(GRAIN, levels[1].cell) + 1e-9


def test_a_field_that_has_moved_shows_the_same_heights():
    levels, before, _ = sampled("ruts in dunes", (0.0, 0.0))
    _, after, _ = sampled("ruts in dunes", (0.45, -0.31))
    for level, one, other in zip(levels[:1], before, after, strict=False):
        shift = np.rint((other.centre - one.centre) / level.cell).astype(int)
        assert shift.any()
        first, second = (_part(field.heights, own) for field, own in ((one, shift), (other, -shift)))
        assert first[1:-1, 1:-1] == pytest.approx(second[1:-1, 1:-1], abs=1e-12)


def _part(heights, shift):
    """The part of a field that one shifted by some cells along x and y covers, without rims."""
    inner = heights[1:-1, 1:-1]
    n = len(inner)
    x, y = (slice(max(s, 0), n + min(s, 0)) for s in shift)
    return inner[y, x]


BALL = """
<mujoco><worldbody><light dir=".6 .4 -.7" type="directional"/>
  <body name="ball" pos="0 0 .5"><freejoint/><geom size=".05" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""
BARE = Shown(False, False, False)


@pytest.fixture
def laid(monkeypatch):
    """Lays a surface under a ball and draws it as it is; the model, and data with the ball at some places."""

    def lay(surface, ruts=None, places=((0.0, 0.0, 0.5),)):
        spec = mujoco.MjSpec.from_string(BALL)
        draft = make_draft(spec)
        rftsim.add_sand(spec, draw=False, terrain=-10.0, ruts=ruts or False)
        drawing.write_drawing(spec, "sand", getattr(surface, "under", surface), draft, ruts)
        for module in (fields, cameras):
            monkeypatch.setattr(module, "ground", lambda model, data, bed: surface)
        model = spec.compile()
        return model, [at(model, place) for place in places]

    return lay


def at(model, place):
    data = mujoco.MjData(model)
    data.qpos[:3] = place
    mujoco.mj_forward(model, data)
    return data


def drawn_vertices(model, geom):
    """Places of the vertices of a geom's height field, (n, n, 3)."""
    one = model.geom_dataid[geom]
    n, start = model.hfield_ncol[one], model.hfield_adr[one]
    x = np.linspace(-1.0, 1.0, n) * model.hfield_size[one, 0]
    heights = model.hfield_data[start : start + n * n].reshape(n, n) * model.hfield_size[one, 2]
    return np.stack([*np.meshgrid(x, x), heights], axis=-1) + model.geom_pos[geom]


def test_a_model_is_compiled_with_its_terrain_drawn_and_keeps_its_statistics(laid):
    """Also after it was written as XML, to the six digits that MuJoCo prints."""
    terrain = dunes()
    spec = mujoco.MjSpec.from_string(BALL)
    bare = spec.compile()
    drawing.write_drawing(spec, "sand", terrain, make_draft(spec))
    model = spec.compile()
    assert model.stat.extent == bare.stat.extent
    assert (model.stat.center == bare.stat.center).all()
    for one in (model, mujoco.MjModel.from_xml_string(spec.to_xml())):
        points = drawn_vertices(one, one.geom("sand_surface").id)[1:-1, 1:-1]
        assert points[..., 2] == pytest.approx(terrain.height_at(points[..., 0], points[..., 1]), abs=1e-5)


def test_following_draws_the_sand_and_changes_nothing_else(laid):
    surface = Rutted(dunes())
    model, (near, far) = laid(surface, RUTS, ((0.0, 0.0, 0.5), (3.0, -2.0, 0.5)))
    before, own = copy.copy(model), fields.Fields(model)
    own.follow(near)
    assert own.follow(near) == []
    changed = own.follow(far)
    (finest, *_) = look.sand_geoms(model)
    assert model.geom_dataid[finest] in changed
    points = drawn_vertices(model, finest)[1:-1, 1:-1]
    assert points[..., 2] == pytest.approx(surface.height_at(points[..., 0], points[..., 1]), abs=1e-6)
    assert np.abs(model.geom_pos[finest, :2] - [3.0, -2.0]).max() <= 0.25
    assert (far.geom_xpos[finest] == model.geom_pos[finest]).all()
    for name in ("hfield_data", "geom_pos", "geom_sameframe"):
        getattr(before, name)[:] = getattr(model, name)
    assert same(model, before)


def same(one, other):
    """Whether all numbers of two models are equal."""
    sizes = [np.empty(mujoco.mj_sizeModel(model), np.uint8) for model in (one, other)]
    for model, buffer in zip((one, other), sizes, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    return (sizes[0] == sizes[1]).all()


def test_a_mark_changes_the_finest_field_alone(laid):
    surface = Rutted(rftsim.FreeSurface(), place=0.3)
    model, (data,) = laid(surface, RUTS)
    own = fields.Fields(model)
    own.follow(data)
    surface.place = 0.32
    assert own.follow(data) == [int(model.geom("sand_surface").dataid[0])]


def above(x=0.0, y=0.0, distance=1.6):
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (x, y, 0.0), distance, 60.0, -35.0
    return camera


def seen(model, data, camera, shown=BARE):
    return render.render(model, data, camera=camera, width=320, height=240, shown=shown).astype(int)


@pytest.mark.parametrize(("surface", "ruts"), [(rftsim.FreeSurface(), None), (Rutted(rftsim.FreeSurface()), RUTS)])
def test_the_ground_stays_in_place_while_what_is_followed_moves(laid, surface, ruts):
    """Two pictures by one camera, with the ball, and with it the fields, at two places outside of the pictures."""
    model, states = laid(surface, ruts, ((0.9, -1.2, 0.3), (1.3, -1.1, 0.3)))
    one, other = (seen(model, data, above()) for data in states)
    grey = np.abs(one - other).max(axis=2)
    assert np.quantile(grey, 0.98) <= 3
    assert one.std() > 3.0, "there is grain"


def test_the_grain_goes_with_the_ground(laid):
    """A camera that moves by the grain's period sees the same plane, and by half of it another picture."""
    model, (data,) = laid(rftsim.FreeSurface(), None, ((0.0, 0.0, 9.0),))
    (sand,) = look.sand_geoms(model)
    period = look.period(model, sand)
    whole, half, first = (seen(model, data, above(x, distance=0.3)) for x in (7.0 * period, 7.5 * period, 0.0))
    assert np.abs(whole - first).max(axis=2).mean() < 0.1
    assert np.abs(half - first).max(axis=2).mean() > 1.5


def test_what_lies_in_a_rut_is_seen_and_what_is_buried_is_not(laid):
    """A ball 2 cm below the undisturbed surface, in a rut of 3 cm and beside it."""
    surface = Rutted(dunes())
    places = [(0.0, y, surface.under.height_at(0.0, y) - 0.062) for y in (0.0, 0.2)]
    model, states = laid(surface, RUTS, places)
    red = [(picture[..., 0] - picture[..., 2]).max() for picture in (seen(model, data, above()) for data in states)]
    assert red[0] > 120 > red[1]


def test_far_away_the_ground_is_even_and_goes_over_into_the_sky(laid):
    """Grain neither smears nor glitters before the horizon; it is there in the foreground."""
    model, (data,) = laid(rftsim.FreeSurface(), None, ((0.0, 0.0, 30.0),))
    camera = above(distance=0.3)
    camera.elevation = -8.0
    picture = seen(model, data, camera)
    towards_sky = np.abs(picture.mean(axis=1) - 255.0 * np.array(look.BACKGROUND)).max(axis=1)
    rough = picture.std(axis=1).max(axis=1)
    edge = int(np.argmax(towards_sky > 2.0))
    assert 60 < edge < 100
    assert (np.diff(towards_sky[edge : edge + 40]) > -0.5).all()
    assert rough[edge + 2 : edge + 20].max() < 0.5
    assert rough[-20:].min() > 2.0


def test_what_the_sand_remembers_is_drawn_and_forgotten_with_it():
    """A ball that falls into sand with ruts leaves a print in the drawing, which a reset takes away."""
    model = rftsim.load(BALL, terrain=0.1, ruts=RUTS)
    data, own = mujoco.MjData(model), fields.Fields(model)
    own.follow(data)
    mujoco.mj_step(model, data, nstep=500)
    assert own.follow(data)
    now = rftsim.ground(model, data)
    print_ = drawn_vertices(model, model.geom("sand_surface").id)[1:-1, 1:-1]
    assert print_[..., 2] == pytest.approx(now.height_at(print_[..., 0], print_[..., 1]), abs=1e-6)
    assert print_[..., 2].min() < 0.1 - 0.005 < 0.1 < print_[..., 2].max()
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    assert own.follow(data)
    points = drawn_vertices(model, model.geom("sand_surface").id)[1:-1, 1:-1]
    assert points[..., 2] == pytest.approx(0.1, abs=1e-6)


def test_terrain_that_is_moved_in_place_is_drawn_where_it_is():
    """As environments move it from episode to episode."""
    model = rftsim.load(BALL, terrain=dunes())
    data, own = mujoco.MjData(model), fields.Fields(model)
    mujoco.mj_forward(model, data)
    own.follow(data)
    assert own.follow(data) == []
    relief_ = layout.record(rftsim.instances(model)[0].relief, layout.TERRAIN)
    relief_.x += 0.7
    assert len(own.follow(data)) == len(look.sand_geoms(model))
    points = drawn_vertices(model, model.geom("sand_surface").id)[1:-1, 1:-1]
    assert points[..., 2] == pytest.approx(dunes().height_at(points[..., 0] - 0.7, points[..., 1]), abs=1e-6)


@pytest.mark.parametrize(("bright", "is_dimmed"), [(0.1, False), (0.9, True)])
def test_lights_that_would_wash_the_sand_out_are_dimmed_and_others_are_not(bright, is_dimmed):
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><visual><headlight ambient="{bright} {bright} {bright}" diffuse="0 0 0"/></visual>
        <worldbody><light type="directional" dir="0 0 -1" diffuse="{bright} {bright} {bright}"/></worldbody>
        </mujoco>""")
    data, scene, camera = mujoco.MjData(model), mujoco.MjvScene(model, 100), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    before = [(light.ambient.copy(), light.diffuse.copy()) for light in scene.lights[: scene.nlight]]
    look.shine(scene)
    after = [(light.ambient, light.diffuse) for light in scene.lights[: len(before)]]
    share = look.EXPOSED / (2.0 * bright) if is_dimmed else 1.0
    for now, then in zip(after, before, strict=True):
        np.testing.assert_allclose(now, share * np.array(then), rtol=1e-5)
