"""The floor becomes sand: what a model stands on is found, gives way to the sand at its height, and walls stay."""

import math
import warnings

import mujoco
import numpy as np
import pytest
from trees import BALL, SAND, spec_of

from rftsim import FreeSurface, RftsimNote, RftsimWarning, add_sand, instances, wrenches

FLOOR = '<geom name="floor" type="plane" size="5 5 .1"/>'
FOOT = '<body name="foot" pos="0 0 .3"><freejoint/><geom name="sole" type="box" size=".1 .1 .05" mass="2"/></body>'
WALL = '<geom name="wall" type="plane" size="5 5 .1" pos="2 0 0" zaxis="-1 0 0"/>'
CORNERS = "1 1 1 1 1 -1 1 -1 1 1 -1 -1 -1 1 1 -1 1 -1 -1 -1 1 -1 -1 -1"
MESH = f'<asset><mesh name="slab" scale="2 2 .1" vertex="{CORNERS}"/></asset>'


def bed_of(mjcf, option="", extra="", **options):
    return add_sand(spec_of(mjcf, option, extra), SAND, **{"reduction": 0.0} | options)


def settled(mjcf, option="", extra="", **options):
    """A model after two seconds on sand, and the share of the weight that the sand carries."""
    spec = spec_of(mjcf, option, extra)
    bed = add_sand(spec, SAND, **options)
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    weight = 9.81 * model.body_subtreemass[0] - 9.81 * model.body_mass[model.body_weldid == 0].sum()
    return bed, data, wrenches(model, data).force[:, 2].sum() / weight


@pytest.mark.parametrize("height", [-0.99, -0.3, 0.0, 0.1])
@pytest.mark.parametrize(
    ("floor", "top"),
    [
        pytest.param('<geom name="floor" type="plane" size="5 5 .1" pos="0 0 {}"/>', 0.0, id="plane"),
        pytest.param('<geom name="floor" type="plane" size="5 5 .1" pos="0 0 {}" contype="0"/>', 0.0, id="one bit"),
        pytest.param('<geom name="floor" type="box" size="5 5 .2" pos="0 0 {}"/>', 0.2, id="box"),
        pytest.param('<geom name="floor" type="cylinder" size="5 .2" pos="0 0 {}"/>', 0.2, id="cylinder"),
        pytest.param('<geom name="floor" type="mesh" mesh="slab" pos="0 0 {}"/>', 0.1, id="mesh"),
        pytest.param('<body pos="0 0 {}"><geom name="floor" type="plane" size="5 5 .1"/></body>', 0.0, id="body"),
    ],
)
def test_the_sand_lies_where_the_floor_was(floor, top, height):
    """A model is found to stand on planes, boxes, cylinders and meshes at any height; the sand carries it there."""
    foot = FOOT.replace("0 0 .3", f"0 0 {height + top + 0.06}")
    bed, data, carried = settled(floor.format(height) + foot, MESH)
    assert bed.terrain.height == pytest.approx(height + top, abs=1e-7)  # a mesh has single precision
    assert carried == pytest.approx(1.0, abs=0.01)
    assert data.ncon == 0
    (choice,) = bed.choices
    assert f"z = {height + top:g} m, in the place of geom floor" in choice


def test_height_fields_are_floors():
    """A height field gives way to sand with its relief, and the heights are said."""
    asset = '<asset><hfield name="h" nrow="5" ncol="5" size="3 3 .2 .1" elevation="' + "0 0 1 0 0 " * 5 + '"/></asset>'
    bed, data, carried = settled('<geom name="floor" type="hfield" hfield="h" pos="0 0 .5"/>' + FOOT, asset)
    assert bed.terrain.height_at([-3.0, 0.0, 1.5], 1.0) == pytest.approx([0.5, 0.7, 0.5])  # the ridge
    assert (
        "z = 0.5 to 0.7 m, in the place and with the relief of geom floor, which no longer collides" in bed.choices[0]
    )
    assert carried == pytest.approx(1.0, abs=0.01)
    assert data.ncon == 0


def test_sloped_floors_give_sloped_sand():
    """A plane that is tilted by 10 degrees becomes sand that is, through the same points."""
    normal = np.array([math.sin(math.radians(10.0)), 0.0, math.cos(math.radians(10.0))])
    floor = f'<geom name="floor" type="plane" size="5 5 .1" pos="0 0 .2" zaxis="{normal[0]} 0 {normal[2]}"/>'
    bed = bed_of(floor + FOOT)
    np.testing.assert_allclose(bed.terrain.normal, normal, atol=1e-9)
    assert bed.terrain.height == pytest.approx(0.2)
    assert "tilted by 10 degrees" in bed.choices[0]


def test_contact_pairs_go_too():
    """A pair of a foot with the floor carries it whatever their bits say: it is removed, and other pairs are not."""
    free = FOOT.replace("<geom", '<geom contype="0" conaffinity="0"')
    other = free.replace('"foot" pos="0 0', '"other" pos="1 0').replace("sole", "heel")
    floor = FLOOR.replace("<geom", '<geom contype="0" conaffinity="0"')
    pairs = "".join(
        f'<pair geom1="{a}" geom2="{b}"/>' for a, b in (("floor", "sole"), ("heel", "floor"), ("sole", "heel"))
    )
    bed, data, carried = settled(floor + free + other, extra=f"<contact>{pairs}</contact>")
    assert carried == pytest.approx(1.0, abs=0.01)
    assert data.ncon == 0
    assert "nor do 2 contact pairs" in bed.choices[0]


def test_steep_walls_are_no_floors():
    """A funnel of planes at 45 degrees over a floor, as dm_control's stacker has: the floor becomes sand, they stay."""
    slope = '<geom name="slope" type="plane" size="5 5 .1" pos=".4 0 0" zaxis="-1 0 1"/>'
    bed, _, carried = settled(FLOOR + slope + FOOT)
    assert bed.terrain == FreeSurface()
    assert "slope" not in bed.choices[0]
    assert carried == pytest.approx(1.0, abs=0.01)


def test_walls_stay():
    """A plane that stands upright holds a box that flies at it at 20 m/s, and is no floor."""
    spec = spec_of(FLOOR + WALL + FOOT.replace("0 0 .3", "1 0 2"))
    bed = add_sand(spec, SAND)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[0] = 20.0
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        assert data.qpos[0] < 2.1
    assert data.qpos[0] < 1.9
    assert "wall" not in bed.choices[0]


def test_floors_are_hidden_and_others_are_not():
    """The floor and a carpet drawn on it are invisible and touch nothing; a table and a wall are as they were."""
    carpet = '<geom name="carpet" type="plane" size="1 1 .1" pos="0 0 .001" contype="0" conaffinity="0"/>'
    table = '<geom name="table" type="box" size=".2 .2 .2" pos="1 1 .2"/>'
    spec = spec_of(FLOOR + carpet + table + WALL + FOOT)
    add_sand(spec, SAND)
    model = spec.compile()
    assert {model.geom(i).name for i in range(model.ngeom) if model.geom_rgba[i, 3] == 0.0} == {"floor", "carpet"}
    still = {"table", "wall", "sole"}
    assert {model.geom(i).name for i in range(model.ngeom) if model.geom_contype[i]} == still


def test_tiles_at_one_height_are_all_floor():
    """Terrains made of boxes: tiles whose tops are level with the sand go, and a step above stays."""
    tiles = "".join(
        f'<geom name="tile{i}" type="box" size=".5 .5 .1" pos="{i} 0 {-0.1 + (0.15 if i == 2 else 0.0)}"/>'
        for i in range(5)
    )
    spec = spec_of(tiles + FOOT)
    (choice,) = add_sand(spec, SAND).choices
    model = spec.compile()
    collides = {model.geom(i).name for i in range(model.ngeom) if model.geom_contype[i]}
    assert collides == {"tile2", "sole"}
    assert "geom tile0, geom tile1, geom tile3 and 1 more" in choice


def test_a_mark_on_the_floor_is_no_floor():
    """A disc of 4 mm, narrower than the robot above it: the sand lies at the floor's height, and the disc goes too."""
    wide = FOOT.replace("</body>", '<geom size=".05" pos=".2 0 0"/><geom size=".05" pos="-.2 0 0"/></body>')
    spec = spec_of(FLOOR + '<geom name="mark" type="cylinder" size=".05 .002" pos="0 0 .002"/>' + wide)
    bed = add_sand(spec, SAND)
    assert bed.terrain.height == 0.0
    assert "geom floor, geom mark, which no longer collide and are hidden" in bed.choices[0]


def test_keeping_the_floor_is_warned_of():
    """keep_floor=True leaves it, and says that it supports the bodies a second time."""
    spec = spec_of(FLOOR + FOOT)
    with pytest.warns(RftsimWarning, match="floor lies 0 m below the sand's surface and collides.* second time"):
        bed = add_sand(spec, SAND, keep_floor=True)
    assert bed.choices == ()
    assert spec.geom("floor").contype == 1


def test_a_floor_beside_the_sand_is_said():
    """What still carries a foot at the sand's level, as a box that stands out of it, is said once."""
    with pytest.warns(RftsimWarning, match="geom rock still carries body foot at the sand's level"):
        bed_of('<geom name="rock" type="sphere" size=".05" pos="0 0 -.051"/>' + FLOOR + FOOT.replace(".3", ".04"))


def test_floors_far_below_are_let_be():
    """With sand at a height of its own, a floor deeper than the bodies are large is the container's."""
    spec = spec_of(FLOOR.replace("size", 'pos="0 0 -1" size') + BALL)
    bed = add_sand(spec, SAND, terrain=0.0)
    assert bed.choices == bed.notes == ()
    assert spec.geom("floor").contype == 1


def test_discarded_visuals_do_not_mislead():
    """The floor is found although <compiler discardvisual> deletes a geom before it."""
    shade = '<geom name="shade" type="box" size="1 1 1" contype="0" conaffinity="0"/>'
    spec = spec_of(shade + FLOOR + BALL, '<compiler discardvisual="true"/>')
    add_sand(spec, SAND)
    model = spec.compile()  # what collides with nothing is a visual now, and goes too
    assert not (model.geom_contype | model.geom_conaffinity)[model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)].any()


def test_the_keyframe_says_where_a_model_stands():
    """Of two floors a model stands on the one below it at its first keyframe."""
    floors = FLOOR + '<geom name="loft" type="box" size="1 1 .05" pos="8 0 .95"/>'
    key = '<keyframe><key qpos="8 0 1.1 1 0 0 0"/></keyframe>'
    assert bed_of(floors + FOOT, extra=key).terrain.height == pytest.approx(1.0)
    assert bed_of(floors + FOOT).terrain.height == 0.0


def test_a_second_bed_lies_where_the_first_does():
    """When the floor is gone the first bed tells the height."""
    other = FOOT.replace('"foot" pos="0 0', '"other" pos="1 0').replace("sole", "heel")
    spec = spec_of(FLOOR.replace("size", 'pos="0 0 .1" size') + FOOT + other)
    add_sand(spec, SAND, bodies=["foot"])
    assert add_sand(spec, SAND, bodies=["other"], name="second").terrain == FreeSurface(0.1)
    assert len(instances(spec.compile())) == 2


def test_a_model_that_raised_is_unchanged():
    """Where add_sand raises, floors, pairs and colours are as they were."""
    spec = spec_of(FLOOR + FOOT, extra='<contact><pair geom1="floor" geom2="sole"/></contact>')
    before = spec.to_xml()
    with pytest.raises(ValueError, match="no such sand"):
        add_sand(spec, "no such sand")
    assert spec.to_xml() == before


# Integrators, units, feet ---------------------------------------------------------------------------------------------


def test_rk4_gives_way():
    """RK4 would take the force at the velocity of the moment: a box of 2 kg then shows 53.9 N for 19.6 N of weight."""
    rk4 = '<option integrator="RK4" timestep=".01"/>'
    spec = spec_of(FLOOR + FOOT, rk4)
    with pytest.warns(RftsimNote, match="implicitfast now"):
        add_sand(spec, SAND)
    assert spec.option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert settled(FLOOR + FOOT, rk4)[2] == pytest.approx(1.0, abs=0.01)
    spec = spec_of(FLOOR + FOOT, rk4)
    add_sand(spec, SAND, force="explicit")  # the explicit choice
    assert spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4


def test_centimetres_are_recognised():
    """Under a gravity of 981 lengths are in centimetres, and sand scaled to g = 981 would be a wrong remedy."""
    light = BALL.replace('size=".1"', 'size=".1" mass=".01"')
    with pytest.warns(RftsimWarning, match="lengths are in centimetres") as told:
        bed_of(light, '<option gravity="0 0 -981"/>')
    assert len(told) == 1
    assert "replace(g=" not in str(told[0].message)


def test_small_footprints_are_said():
    """Four tiny spheres under a sole of 141 cm^2: what collides is a few per cent of what is seen, and sinks deep."""
    ball = '<geom size=".005" pos="{} {} -.03" mass=".01"/>'
    balls = "".join(ball.format(x, y) for x in (-0.05, 0.12) for y in (-0.03, 0.03))
    sole = '<geom type="box" size=".1 .035 .03" pos=".035 0 0" contype="0" conaffinity="0"/>'
    heavy = '<freejoint/><inertial pos="0 0 .1" mass="35" diaginertia="1 1 1"/>'
    body = f'<body name="foot" pos="0 0 .04">{heavy}{balls}{sole}</body>'
    with pytest.warns(RftsimWarning) as told:
        bed_of(FLOOR + body)
    sentences = [str(one.message) for one in told]
    assert sum("of the sole of foot" in sentence and "140 cm^2 collide" in sentence for sentence in sentences) == 1
    assert sum("does not carry" in s or "will sink" in s for s in sentences) == 1


def test_a_good_foot_is_quiet():
    """A model that stands well raises no warning, and one note a kind."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RftsimWarning)
        assert len(bed_of(FLOOR + FOOT).choices) == 1
