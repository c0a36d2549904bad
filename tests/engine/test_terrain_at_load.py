"""Terrain when a model is loaded: height fields that become sand, floors, reach, standing, and what is said."""

import math
import re
import warnings

import mujoco
import numpy as np
import pytest
from trees import SAND, spec_of

import rftsim
from rftsim import FreeSurface, RftsimWarning, SceneError, Terrain, add_sand, dunes
from rftsim.law import layout
from rftsim.law.evaluate import body_wrenches
from rftsim.model.ground import ground
from rftsim.model.reach import Slopes, clearance, sampled_reach
from rftsim.model.standing import standing
from rftsim.reduction.samples import turned_any_way

FLOOR = '<geom name="floor" type="plane" size="5 5 .1"/>'
FOOT = '<body name="foot" pos="0 0 .8"><freejoint/><geom name="sole" type="box" size=".1 .1 .05" mass="2"/></body>'
ROWS, COLUMNS = 9, 13
SIZE = (3.0, 2.0, 0.25, 0.1)


def hills(x, y):
    return 0.05 * np.sin(2.0 * x + 0.3) * np.cos(1.5 * y)


def scene(bodies=FOOT, place='pos="0 0 .5"', heights=None, option=""):
    """A spec with a height field, by default of random heights."""
    heights = np.random.default_rng(5).uniform(size=(ROWS, COLUMNS)) if heights is None else heights
    words = " ".join(f"{h:.9g}" for h in heights[::-1].ravel())  # MuJoCo's XML has the row of the greatest y first
    size = " ".join(map(str, SIZE))
    field = f'<hfield name="h" nrow="{ROWS}" ncol="{COLUMNS}" size="{size}" elevation="{words}"/>'
    geom = f'<geom name="hill" type="hfield" hfield="h" {place}/>'
    return spec_of(f"{geom}{bodies}", f"{option}<asset>{field}</asset>")


def points(model):
    """The points of a compiled model's height field, world frame, (n, 3)."""
    heights = model.hfield_data.reshape(ROWS, COLUMNS) * model.hfield_size[0, 2]
    x, y = np.meshgrid(np.linspace(-SIZE[0], SIZE[0], COLUMNS), np.linspace(-SIZE[1], SIZE[1], ROWS))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = model.geom("hill").id
    return np.stack([x, y, heights], -1).reshape(-1, 3) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def loaded(spec, **options):
    """The bed, and the compiled model, of sand that is put under a spec."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RftsimWarning)
        bed = add_sand(spec, SAND, **{"reduction": 0.0} | options)
    return bed, spec.compile()


# Height fields --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("terrain", [None, "hill"])
@pytest.mark.parametrize("turn", [0, 90, 180, -90])
def test_a_height_field_is_sand_of_its_own_heights(terrain, turn):
    """At its points to float32, wherever it lies and whichever quarter it is turned by; and it no longer collides."""
    spec = scene(place=f'pos=".2 -.1 .5" euler="0 0 {turn}"')
    at = points(spec.copy().compile())
    bed, model = loaded(spec, terrain=terrain)
    np.testing.assert_allclose(bed.terrain.height_at(at[:, 0], at[:, 1]), at[:, 2], atol=2e-7)
    assert model.geom("hill").contype[0] == model.geom("hill").conaffinity[0] == 0
    assert model.geom("hill").rgba[3] == 0.0
    (choice,) = bed.choices
    low, high = at[:, 2].min(), at[:, 2].max()
    assert choice.startswith(
        f"the sand lies at z = {low:.4g} to {high:.4g} m, in the place and with the relief of geom hill"
    )


def test_a_height_field_may_be_turned_about_z():
    """By 30 degrees its smooth relief is met to the order of the spline, and beyond its edge it levels off."""
    x, y = np.meshgrid(np.linspace(-SIZE[0], SIZE[0], COLUMNS), np.linspace(-SIZE[1], SIZE[1], ROWS))
    smooth = hills(x, y)
    spec = scene(place='pos=".2 -.1 .5" euler="0 0 30"', heights=smooth)
    at = points(spec.copy().compile())
    made = loaded(spec, terrain="hill")[0].terrain
    assert np.abs(made.height_at(at[:, 0], at[:, 1]) - at[:, 2]).max() < 0.03 * np.ptp(at[:, 2])
    assert made.height_at(30.0, 0.0) == made.height_at(40.0, 0.0)


def test_a_tilted_height_field_is_refused():
    for terrain in ("hill", None):
        with pytest.raises(SceneError, match=r"geom hill is a height field tilted by 5 degrees: .*\(terrain=\)"):
            add_sand(scene(place='euler="5 0 20"'), SAND, terrain=terrain)


def test_a_height_field_that_moves_is_refused():
    spec = scene(place='contype="0"')
    spec.worldbody.add_body(name="cart").add_freejoint()
    spec.body("cart").add_geom(name="load", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="h", mass=1.0)
    with pytest.raises(SceneError, match=r"geom load is a height field that moves with body cart: .*\(terrain=\)"):
        add_sand(spec, SAND, terrain="load")


def test_a_level_height_field_is_a_plane():
    """Which costs what a plane costs, at its height."""
    assert loaded(scene(heights=np.zeros((ROWS, COLUMNS))))[0].terrain == FreeSurface(0.5)


def test_a_height_field_that_is_not_named_stays():
    """Sand at a height of its own, far above it: the field is the container's."""
    bed, model = loaded(scene(FOOT.replace(".8", "3.8")), terrain=3.5)
    assert bed.terrain == FreeSurface(3.5)
    assert model.geom("hill").contype[0] == 1


@pytest.mark.parametrize(
    ("terrain", "words"),
    [
        ("h", "no terrain 'h': it must be a height [m], slope=DEGREES, dunes, or a file that ends in .png, .npy, .npz, "
         ".csv, or the name of a height field geom of the model, which has 'hill'"),
        ("sole", "no terrain 'sole'"),
        ("dunes,amplitude=2", "as steep as"),
        (True, "terrain must be a height, a FreeSurface, a Terrain or a text, not a bool"),
    ],
)  # fmt: skip
def test_what_names_no_terrain(terrain, words):
    """One line that says what would have been right, and the spec as it was."""
    spec = scene()
    before = spec.to_xml()
    with pytest.raises(ValueError, match=re.escape(words)) as told:
        add_sand(spec, SAND, terrain=terrain)
    assert "\n" not in str(told.value)
    assert spec.to_xml() == before


# Terrain that is a plane ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05)])
def test_terrain_that_is_a_plane_is_a_plane(slope):
    """Floors, reasons, what is said and where the model stands are those of the `FreeSurface`."""
    plane = FreeSurface(0.02, (-slope[0], -slope[1], 1.0))
    same = Terrain.from_function(lambda x, y: 0.02 + slope[0] * x + slope[1] * y, 12.0, 0.5)
    box = '<geom name="box" type="box" size=".2 .2 .01" pos=".3 0 0"/>'
    arm = '<body name="arm" pos="0 0 .4"><joint axis="0 0 1"/><geom size=".02"/></body>'
    found = [loaded(spec_of(FLOOR + box + arm + FOOT), terrain=one) for one in (plane, same)]
    (one, first), (other, second) = found
    assert one.reasons == other.reasons
    assert one.notes == other.notes
    for name in ("floor", "box", "sole"):
        assert first.geom(name).contype == second.geom(name).contype
    stands = [standing(model, mujoco.MjData(model)) for _, model in found]
    assert stands[0].qpos == pytest.approx(stands[1].qpos, abs=1e-9)
    assert stands[0].trees[0].weight == pytest.approx(stands[1].trees[0].weight)


# Floors, reach, reduction ---------------------------------------------------------------------------------------------


def test_floors_near_dunes_are_sand_and_rocks_stay():
    """A plane through the dunes and a box that lies under them go; a box that stands out of them is a rock."""
    made = dunes(0.05, 2.0, seed=4)
    low = float(made.height_at(1.0, 1.0)) - 0.2
    slab = f'<geom name="slab" type="box" size=".1 .1 .1" pos="1 1 {low}"/>'
    rock = f'<geom name="rock" type="box" size=".1 .1 .1" pos="-1 1 {float(made.height_at(-1.0, 1.0))}"/>'
    _, model = loaded(spec_of(FLOOR + slab + rock + FOOT), terrain=made)
    collides = {model.geom(i).name for i in range(model.ngeom) if model.geom_contype[i]}
    assert collides == {"rock", "sole"}


def test_a_drawn_copy_of_a_height_field_is_hidden_too():
    spec = scene()
    spec.worldbody.add_geom(
        name="copy", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="h", pos=[0, 0, 0.5], contype=0, conaffinity=0
    )
    _, model = loaded(spec)
    assert model.geom("copy").rgba[3] == 0.0


def test_a_body_is_out_of_reach_of_the_highest_dune_or_not_at_all():
    """On an arm over dunes: no height is promised that a dune, moved in place, would not leave."""
    made = dunes(0.1, 6.0)
    arm = '<body name="arm" pos="0 0 {}"><joint axis="0 0 1"/><geom size=".02"/></body>'
    for height, felt in ((made.ceiling.height + 0.1, False), (made.ceiling.height + 0.01, True)):
        bed, model = loaded(spec_of(arm.format(height) + FOOT), terrain=made, reduction=0.5)
        assert ("arm" in bed.surfaces) == felt
    above = clearance(model, 1, bed.surfaces["arm"], made)
    assert above == pytest.approx(height - 0.02 - made.ceiling.height, abs=1e-3)


@pytest.mark.parametrize("across", [None, np.array([0.0, 1.0, 0.0])])
def test_a_body_is_seen_from_every_slope_that_a_terrain_has(across):
    """The frames in which a body on a slide is tried lean up to the steepest slope, and its motion leans with them."""
    model = spec_of('<body><joint type="slide" axis="0 0 1"/><geom type="box" size=".1 .1 .1"/></body>').compile()
    surface = rftsim.shapes.box((0.2, 0.2, 0.2))
    reach = sampled_reach(model, 1, surface, 0, Slopes(0.3, across))
    up = reach.rotations[:, :, 2]  # where the world's z points in the frame in which the sand is level
    lean = np.arccos(up[:, 2])
    assert lean.max() <= 0.3
    assert lean.max() > 0.25
    assert lean.min() < 0.05
    np.testing.assert_allclose(reach.motions[:, :3, :3], up[:, :, None] * up[:, None, :], atol=1e-12)
    if across is not None:
        np.testing.assert_allclose(up @ across, 0.0, atol=1e-12)


LEG = """<body name="leg" pos="0 0 .1"><freejoint/><geom type="capsule" size=".04 .1"/>
<geom type="sphere" size=".06" pos="0 0 .1"/></body>"""


def test_elements_keep_the_wrench_on_dunes():
    """Within twice the tolerance, as in the poses that a reduction is held back against; it was searched on a plane."""
    made = dunes(0.04, 2.0, seed=1)
    (whole, _), (lean, model) = (loaded(spec_of(LEG), terrain=made, reduction=share) for share in (0.0, 0.01))
    bed, surfaces = rftsim.instances(model)[0].whole, [one.surfaces["leg"] for one in (whole, lean)]
    assert surfaces[1].ntri < 0.3 * surfaces[0].ntri
    rng = np.random.default_rng(0)
    turn, motion = turned_any_way(60, rng), rng.normal(size=(60, 6))
    place = np.zeros((60, 3))
    place[:, :2] = rng.uniform(-9.0, 9.0, size=(60, 2))
    place[:, 2] = made.height_at(place[:, 0], place[:, 1]) - 0.05
    one, other = (
        body_wrenches(bed, layout.pack_surface(surface), place, turn, motion[:, :3], 9.0 * motion[:, 3:])[:, :3]
        for surface in surfaces
    )
    assert np.linalg.norm(one - other, axis=1).max() < 0.02 * np.linalg.norm(one, axis=1).max()


CART = """<body name="cart" pos="0 0 .1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<geom type="box" size=".1 .05 .05" mass="2"/></body>"""


def test_planar_laws_take_what_is_the_same_all_across():
    """Ripples across the way of a cart serve; dunes, which rise across its plane too, are refused, with a way out."""
    ripples = Terrain.from_function(lambda x, y: 0.02 * np.sin(2.0 * x) + 0.0 * y, math.pi, 0.1, repeat=True)
    assert loaded(spec_of(CART), law="rft2d", terrain=ripples)[0].terrain is ripples
    with pytest.raises(
        SceneError, match=r"rises by up to [\d.]+ degrees across it: take one .* all across, or .*rft3d"
    ):
        loaded(spec_of(CART), law="rft2d", terrain="dunes")


# Standing -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [0.0, 0.6, 1.3])
def test_a_robot_starts_above_the_ground_under_it(x):
    """From deep in a dune or high above it a box comes to stand over its place, in the sand and not under it."""
    made = Terrain.from_function(lambda x, y: 0.15 * np.cos(2.0 * x) + 0.0 * y, 2 * math.pi, 0.1, repeat=True)
    _, model = loaded(spec_of(FOOT), terrain=made)
    rest = []
    for start in (-1.0, 2.0):
        data = mujoco.MjData(model)
        data.qpos[:2], data.qpos[2] = (x, 0.2), start
        found = standing(model, data)
        assert found.qpos[:2] == pytest.approx((x, 0.2))
        assert found.trees[0].up == pytest.approx(made.normal_at(x, 0.2), abs=0.05)
        rest.append(found.qpos[2])
    assert rest[0] == pytest.approx(rest[1], abs=1e-9)
    assert made.height_at(x, 0.2) - 0.05 < rest[0] < made.height_at(x, 0.2) + 0.1


def test_the_ground_is_the_terrain():
    made = dunes(0.03, 2.0, seed=2)
    _, model = loaded(spec_of(FOOT), terrain=made)
    x, y = np.random.default_rng(0).uniform(-9.0, 9.0, size=(2, 50))
    found = ground(model, mujoco.MjData(model))
    np.testing.assert_allclose(found.height_at(x, y), made.height_at(x, y), atol=1e-12)
    np.testing.assert_allclose(found.normal_at(x, y), made.normal_at(x, y), atol=1e-12)


@pytest.mark.parametrize("terrain", ["0.1", "slope=5", "dunes,amplitude=0.03"])
def test_a_second_bed_lies_where_the_first_does(terrain):
    spec = spec_of(FOOT + FOOT.replace('"foot" pos="0 0', '"other" pos="1 0').replace("sole", "heel"))
    first = add_sand(spec, SAND, bodies=["foot"], terrain=terrain)
    second = add_sand(spec, SAND, bodies=["other"], name="second")
    x, y = np.random.default_rng(0).uniform(-9.0, 9.0, size=(2, 50))
    np.testing.assert_allclose(second.terrain.height_at(x, y), first.terrain.height_at(x, y), atol=1e-12)
    assert len(rftsim.instances(spec.compile())) == 2


# Slopes ---------------------------------------------------------------------------------------------------------------


def test_slopes_beyond_repose_are_said_once_with_the_numbers():
    """The steepest slope, the part of the area that is steeper, the angle of repose and what would help."""
    made = Terrain.from_function(lambda x, y: 0.2 * np.cos(4.0 * x) + 0.0 * y, math.pi, 0.02, repeat=True)
    with pytest.warns(RftsimWarning) as told:
        add_sand(spec_of(FOOT), "poppy-seeds", terrain=made, reduction=0.0)
    (said,) = [str(one.message) for one in told if "repose" in str(one.message)]
    share = 100.0 * (1.0 - 2.0 / math.pi * math.asin(0.56 / 0.8))  # 0.8 |sin 4x| > mu_int
    steepest, part = re.search(r"up to ([\d.]+) degrees against gravity, on (\d+) % of its area", said).groups()
    assert float(steepest) == pytest.approx(math.degrees(math.atan(0.8)), rel=0.01)
    assert float(part) == pytest.approx(share, abs=2.0)
    assert "angle of repose of 29.2 (mu_int 0.56)" in said


def test_gentle_dunes_are_quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RftsimWarning)
        add_sand(spec_of(FOOT), "poppy-seeds", terrain="dunes", reduction=0.0)
