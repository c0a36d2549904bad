"""What of a scene can touch sand, how far its joints let it go, and what is modelled of it under a tolerance."""

import functools
import itertools
import json
import os
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rftsim_models import hexapod, wheels
from trees import SAND, spec_of, xml

import rftsim
from rftsim import FreeSurface, RftsimWarning, SceneError, add_sand
from rftsim.law.laws import get_law
from rftsim.law.layout import pack_bed
from rftsim.model.add_sand import read_spec
from rftsim.model.reach import clearance, sampled_reach
from rftsim.model.shaping import Fineness, body_surface
from rftsim.reduction import memory, reduce
from rftsim.run.advice import advise
from rftsim.run.scenes import stage
from rftsim.sand.presets import make_sand

CRANE = """
<body name="crane" pos="1 0 1">
  <joint axis="0 0 1" range="-90 90"/> <geom type="box" size=".1 .1 .1"/>
  <body name="jib" pos="0 0 .1">
    <joint axis="0 1 0" range="-60 60"/> <geom type="capsule" fromto="0 0 0 .6 0 0" size=".03"/>
    <body name="hook" pos=".6 0 0"> <joint type="slide" axis="0 0 -1" range="0 1.2"/> <geom size=".05"/> </body>
    <body name="lamp" pos=".3 0 .1"> <geom size=".03"/> </body>
  </body>
</body>
<body name="lift" pos="-1 0 1"> <joint type="slide" axis="0 0 1" range="-.3 .3"/> <geom type="box" size=".1 .1 .1"/>
</body>
<body name="rope" pos="-1 0 1"> <joint type="slide" axis="0 0 1"/> <geom type="box" size=".1 .1 .1"/> </body>
<body name="cart" pos="-1 0 1"> <joint type="slide" axis="1 1 0"/> <geom type="box" size=".1 .1 .1"/> </body>
<body name="block" pos="0 1 .2"> <freejoint/> <geom type="box" size=".1 .05 .05"/> </body>
<body name="pillar" pos="0 0 .5"> <geom type="box" size=".05 .05 .5"/> </body>
"""
LEVEL = FreeSurface()


def surface_of(model, name):
    return body_surface(model, model.body(name).id, Fineness())


@pytest.mark.parametrize(
    ("body", "height"),
    [
        ("crane", 0.9),  # turns about the vertical
        ("jib", 1.1 - 0.63),  # may hang straight down from its hinge
        ("lamp", 1.1 - np.hypot(0.3, 0.1) - 0.03),
        ("lift", 1.0 - 0.33 - 0.1),  # at the end of its range, and a twentieth of that beyond
        ("cart", 0.9),  # slides on the level
        ("rope", -np.inf),
        ("block", -np.inf),
    ],
)
def test_how_near_a_body_can_come(body, height):
    """The bound is what the tree and the joints' ranges say."""
    model = spec_of(CRANE).compile()
    found = clearance(model, model.body(body).id, surface_of(model, body), LEVEL)
    assert found == pytest.approx(height, abs=1e-2)


def test_no_pose_within_the_ranges_comes_nearer():
    """The lowest corner of a thousand random poses stays above the bound, on level and on tilted sand."""
    model = spec_of(CRANE).compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for sand in (LEVEL, FreeSurface(height=-0.3, normal=(0.3, -0.2, 1.0))):
        bounds, surfaces = {}, {}
        for name in ("crane", "jib", "hook", "lamp", "lift"):
            surfaces[name] = surface_of(model, name)
            bounds[name] = clearance(model, model.body(name).id, surfaces[name], sand)
            assert np.isfinite(bounds[name])
        for _ in range(1000):
            free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
            at = model.jnt_qposadr[~free & (model.jnt_limited == 1)]
            low, high = model.jnt_range[~free & (model.jnt_limited == 1)].T
            data.qpos[at] = rng.uniform(low, high)
            mujoco.mj_kinematics(model, data)
            for name, surface in surfaces.items():
                body = data.body(name)
                world = surface.corners @ body.xmat.reshape(3, 3).T + body.xpos
                assert (world @ sand.normal).min() - sand.offset >= bounds[name] - 1e-9


def test_reduction_leaves_out_what_cannot_reach_the_sand():
    """At zero every moving body is modelled; otherwise those out of reach are not, unless they are named."""
    moving = {"crane", "jib", "hook", "lamp", "lift", "rope", "cart", "block"}
    assert set(add_sand(spec_of(CRANE), SAND, reduction=0.0).surfaces) == moving
    bed = add_sand(spec_of(CRANE), SAND, reduction=0.2)
    assert set(bed.surfaces) == {"hook", "rope", "block"}
    assert bed.reasons["lift"] == "stays 0.57 m or more above the sand, by its tree and its joints' ranges"
    assert bed.reasons["pillar"] == "cannot move"
    assert set(add_sand(spec_of(CRANE), SAND, reduction=0.2, bodies=["lift"]).surfaces) == {"lift"}


def test_nothing_within_reach_is_said():
    """A model of which nothing can come down to the sand loads all the same, and says so."""
    with pytest.warns(RftsimWarning, match="no body can come down to the sand"):
        bed = add_sand(spec_of('<body name="b" pos="0 0 2"><joint axis="0 0 1"/><geom size=".1"/></body>'), SAND)
    assert list(bed.surfaces) == ["b"]


@pytest.mark.parametrize("share", [-0.1, 1.0, np.nan])
def test_reductions_that_cannot_be(share):
    """It is a share."""
    with pytest.raises(SceneError, match="reduction must be zero, or below 1"):
        add_sand(spec_of(), SAND, reduction=share)


def test_a_wheel_on_its_carriage_turns_in_its_plane():
    """Its orientations keep the axle level; its motions are two velocities and one rate."""
    model = wheels.build_wheel(wheels.GROUSER_WHEEL, 30.0).compile()
    reach = sampled_reach(model, model.body("wheel").id, surface_of(model, "wheel"), 0)
    np.testing.assert_allclose(reach.rotations[:, :, 1], np.tile([0, 1, 0], (len(reach.rotations), 1)), atol=1e-12)
    assert np.ptp(reach.rotations[:, 0, 0]) > 1.0
    np.testing.assert_allclose(
        reach.motions, np.tile(np.diag([1, 0, 1, 0, 1, 0]), (len(reach.motions), 1, 1)), atol=1e-9
    )


def test_a_free_body_goes_everywhere():
    """A free joint allows every motion in every orientation."""
    model = spec_of().compile()
    reach = sampled_reach(model, 1, surface_of(model, "ball"), 0)
    np.testing.assert_allclose(reach.motions, np.tile(np.eye(6), (len(reach.motions), 1, 1)), atol=1e-9)


def test_a_reduced_model_is_a_model():
    """Fewer elements, near the same force; readouts and the bounding box follow."""
    drop = xml('<body name="b" pos="0 0 .03"><freejoint/><geom type="ellipsoid" size=".1 .06 .05"/></body>')
    models = [rftsim.load(drop, SAND, max_edge=0.004, reduction=share) for share in (0.0, 0.05)]
    counts, rest = [], []
    for model in models:
        data = mujoco.MjData(model)
        while data.time < 0.5:
            mujoco.mj_step(model, data)
        counts.append(len(rftsim.tractions(model, data, "b").area))
        rest.append(data.qpos[2])
    assert counts[1] < counts[0] / 10
    assert rest[1] == pytest.approx(rest[0], abs=2e-4)


# Its cost -------------------------------------------------------------------------------------------------------------

ROBOTS = Path(os.environ.get("MENAGERIE_ROOT", Path(__file__).parents[3] / "shared" / "robots"))
FOUR = "".join(
    f'<body name="leg{i}" pos="{x} {y} 0"><joint axis="0 1 0"/><geom type="ellipsoid" size=".1 .06 .05"/></body>'
    for i, (x, y) in enumerate(itertools.product((-0.2, 0.2), repeat=2))
)
TABLE = f'<body name="table" pos="0 0 1"><freejoint/><geom type="box" size=".3 .3 .02"/>{FOUR}</body>'


@pytest.fixture
def searches(monkeypatch, tmp_path):
    """Counts the searches for facets; nothing is known from before."""
    made = []

    def counted(*arguments):
        made.append(arguments)
        return reduce.partition(*arguments)

    monkeypatch.setattr(memory, "partition", counted)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return made


def test_equal_legs_are_reduced_once(searches):
    """Bodies of one shape, whose tree is free, share a search; the next load needs none."""
    first, again = (add_sand(spec_of(TABLE), SAND, reduction=0.05) for _ in range(2))
    assert len(searches) == 2
    for i in range(4):
        assert first.economies[f"leg{i}"].elements < first.economies[f"leg{i}"].triangles
        for bed in (first, again):
            np.testing.assert_array_equal(bed.surfaces["leg0"].triangles, bed.surfaces[f"leg{i}"].triangles)


def test_the_same_facets_every_time(searches):
    """With no memory of it, too."""
    spec = spec_of(CRANE)
    model = spec.compile()
    surface = surface_of(model, "jib")
    numbers = pack_bed(make_sand(SAND), get_law("rft3d"), FreeSurface(), (0, 1, 0))
    reach = functools.partial(sampled_reach, model, model.body("jib").id, surface)
    pair = [reduce.reduced(surface, numbers, 0.05, reach)[0] for _ in range(2)]
    np.testing.assert_array_equal(pair[0].triangles, pair[1].triangles)


def test_a_robot_is_reduced_within_a_few_loads(searches):
    """Unitree Go1, searched in the time of at most ten loads, and at once where it is known."""
    path = ROBOTS / "unitree_go1" / "go1.xml"
    if not path.is_file():
        pytest.skip(f"no {path}")
    times = []
    for share in (0.0, 0.01, 0.01):
        spec = read_spec(path)
        start = time.process_time()
        add_sand(spec, reduction=share)
        times.append(time.process_time() - start)
    plain, first, again = times
    print(f"{len(searches)} searches; {plain:.2f} s without reduction, {first:.2f} s with it, {again:.2f} s once known")
    assert first - plain < 10.0 * again
    assert again - plain < 0.2 * (first - plain)


# Laws -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "law", "rpm", "advised"),
    [
        ("grouser-wheel", "drft2d", 60, ["drft2d", "drft2d"]),
        ("grouser-wheel", "drft2d", 20, ["drft2d", "rft2d"]),
        ("grouser-wheel", "rft3d", 20, ["rft2d", "rft3d"]),
        ("grouser-wheel", "rft3d", 60, ["rft2d", "drft3d"]),
        ("four-flap-runner", "drft2d", 100, ["drft2d", "drft2d"]),
    ],
)
def test_laws_for_a_wheel(scene, law, rpm, advised):
    """A planar scene needs no 3D law; below a Froude number of 0.4 no dynamic one."""
    staged = stage(scene, law=law, settings={"rpm": str(rpm)})
    assert [one.law for one in advise(staged.model, staged.bed)] == advised


@pytest.mark.parametrize(("speed", "law", "number"), [(0.3, "rft3d", "0.36 < 0.4"), (0.6, "drft3d", "0.71, and from")])
def test_laws_for_a_robot(speed, law, number):
    """A free robot needs a 3D law; its speed, v / sqrt(g L) of its smallest body, decides on the dynamic terms."""
    spec = hexapod.build_hexapod()
    bed = add_sand(spec, reduction=0.0)
    dimensions, dynamics = advise(spec.compile(), bed, speed)
    assert dimensions.law == "rft3d"
    assert dynamics.law == law
    assert number in dynamics.reason


@pytest.mark.parametrize(("plane", "named"), [((0, -1, 0), "x-z plane"), ((3, 4, 0), "plane of motion")])
def test_a_flat_law_serves_in_its_own_plane(plane, named):
    """Whatever it is: nothing that feels a 2D law can leave it."""
    along, about = np.cross(plane, (0, 0, 1)), np.array(plane)
    axes = [" ".join(map(str, axis)) for axis in (along, about)]
    spec = spec_of(f'<body><joint type="slide" axis="{axes[0]}"/><joint axis="{axes[1]}"/><geom size=".1"/></body>')
    bed = add_sand(spec, SAND, "rft2d", plane=plane)
    dimensions, dynamics = advise(spec.compile(), bed)
    assert (dimensions.law, dynamics.law) == ("rft2d", "rft2d")
    assert f"in the {named}: a 2D law serves" in dimensions.reason


def test_advice_is_written_as_json():
    """It holds nothing but text."""
    staged = stage("intruder")
    assert "nothing moves at the start" in json.dumps([one._asdict() for one in advise(staged.model, staged.bed)])
