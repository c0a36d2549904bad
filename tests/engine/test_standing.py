"""Where a model stands in sand: the sand's force, pushed straight down, is the weight."""

import math

import mujoco
import numpy as np
import pytest
from trees import spec_of, xml

import rftsim
from rftsim.law import layout
from rftsim.model.standing import PackedBed, sinkage, stand, standing

XI_N = 2e5
SAND = rftsim.Sand(xi_n=XI_N, rho_c=1500.0, mu_surf=0.4)
FLAT = 0.87574 * XI_N
"""Resistance of a flat plate to being pushed straight down, over its area and depth [N/m^3]."""
G = 9.81


def box(name="box", pos="0 0 1", joint="<freejoint/>", more=""):
    return f'<body name="{name}" pos="{pos}">{joint}<geom type="box" size=".1 .05 .04" mass="12"/>{more}</body>'


def compiled(bodies, extra="", **options):
    spec = spec_of(bodies, extra=extra)
    rftsim.add_sand(spec, SAND, "rft3d", **options)
    return spec.compile()


def stood(model, qpos=None):
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    return standing(model, data)


def lifts(model, found):
    """The force along z of a push straight down at the places found, by the engine itself [N], (nbody,)."""
    data = mujoco.MjData(model)
    data.qpos[:] = found.qpos
    for tree in found.trees:
        data.qvel[model.body_dofadr[tree.root] + 2] = -1e-6
    mujoco.mj_forward(model, data)
    return rftsim.wrenches(model, data).force[:, 2]


def test_a_box_sinks_until_a_plate_would_carry_it():
    """0.87574 xi_n z A = m g, for the bottom; the sides of an upright box carry 0.1 % of that."""
    model = compiled(box())
    found = stood(model)
    (tree,) = found.trees
    (foot,) = tree.feet
    depth = 12 * G / (FLAT * 0.2 * 0.1)
    assert foot.sinkage == pytest.approx(depth, rel=3e-3)
    assert found.qpos[2] == pytest.approx(0.04 - foot.sinkage, abs=1e-9)
    assert tree.lowered == pytest.approx(1.0 - found.qpos[2])
    assert foot.share == pytest.approx(1.0, abs=1e-9)
    assert tree.weight == pytest.approx(12 * G)


def test_a_sphere_is_carried_by_the_engines_own_force():
    model = compiled('<body name="ball" pos="3 2 1"><freejoint/><geom size=".1" mass="4"/></body>', force="explicit")
    found = stood(model)
    assert lifts(model, found)[1] == pytest.approx(4 * G, rel=1e-6)
    assert found.trees[0].feet[0].sinkage == pytest.approx(0.1 - found.qpos[2], abs=2e-3)
    assert found.qpos[[0, 1, 3, 4, 5, 6]] == pytest.approx([3, 2, 1, 0, 0, 0])


def test_two_robots_stand_each_for_itself_and_one_that_is_too_deep_is_raised():
    model = compiled(box("one", "0 0 .3") + box("other", "1 0 -.5"), force="explicit")
    found = stood(model)
    one, other = found.trees
    assert found.qpos[2] == pytest.approx(found.qpos[9], abs=1e-9)
    assert one.lowered > 0.0 > other.lowered
    assert lifts(model, found)[1:] == pytest.approx([12 * G] * 2, rel=1e-6)


def test_what_lies_on_another_sinks_with_it():
    """Two boxes that touch are one weight on the lower one; the upper one keeps its place on it."""
    model = compiled(box("lower", "0 0 1") + box("upper", "0 0 1.0799"))
    found = stood(model)
    (tree,) = found.trees
    assert tree.weight == pytest.approx(24 * G)
    assert [model.body(foot.body).name for foot in tree.feet] == ["lower"]
    assert found.qpos[9] - found.qpos[2] == pytest.approx(0.0799)
    assert tree.feet[0].sinkage == pytest.approx(24 * G / (FLAT * 0.2 * 0.1), rel=3e-3)


ARM = """<body name="arm" pos="0 0 .1"><joint type="hinge" axis="0 1 0"/><geom type="capsule" size=".02 .2"/>
<body name="finger" pos="0 0 .2"><joint type="slide" axis="0 0 1"/><geom size=".02"/></body></body>"""


def test_an_arm_on_a_fixed_base_stays():
    model = compiled(ARM)
    found = stood(model)
    assert found.trees == ()
    assert (found.qpos == model.qpos0).all()


def test_a_carriage_on_slides_stands_unless_it_is_driven():
    slides = '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
    (tree,) = stood(compiled(box(joint=slides))).trees
    assert tree.feet[0].sinkage == pytest.approx(12 * G / (FLAT * 0.2 * 0.1), rel=3e-3)
    assert stood(compiled(box(joint=slides), '<actuator><position joint="z" kp="1"/></actuator>')).trees == ()


def test_the_pose_counts():
    """On its side a box stands on its smallest face: deeper, by the ratio of the faces."""
    flat, side = (
        stood(compiled(box()), (0, 0, 1, *quat)).trees[0].feet[0].sinkage
        for quat in ((1, 0, 0, 0), (math.sqrt(0.5), 0, math.sqrt(0.5), 0))
    )
    assert side / flat == pytest.approx(0.1 / 0.04, rel=3e-3)


@pytest.mark.parametrize("x", [0.0, 0.7])
def test_on_a_slope_it_stays_over_its_place(x):
    """Its weight along the normal is carried by a push along the normal; where on the plane it is changes nothing."""
    terrain = rftsim.FreeSurface(0.1, (-0.2, 0.0, 1.0))
    up = np.array(terrain.normal)
    model = compiled(box("box", f"{x} 0 1"), terrain=terrain, force="explicit")
    found = stood(model)
    assert found.qpos[:3] - [x, 0, 1] == pytest.approx([0.0, 0.0, -found.trees[0].lowered])
    assert found.qpos[2] - terrain.height_at(x, 0.0) == pytest.approx(stood(model, (0, 0, 0, 1, 0, 0, 0)).qpos[2] - 0.1)
    assert found.trees[0].up == pytest.approx(up)
    assert found.trees[0].weight == pytest.approx(12 * G * up[2])
    data = mujoco.MjData(model)
    data.qpos[:] = found.qpos
    data.qvel[:3] = -1e-6 * up
    mujoco.mj_forward(model, data)
    assert rftsim.wrenches(model, data).force[1] @ up == pytest.approx(12 * G * up[2], rel=1e-6)
    assert sum(foot.share for foot in found.trees[0].feet) == pytest.approx(1.0, abs=1e-9)


def test_before_the_sand_is_in_the_model():
    """`stand` takes packed sand and surfaces of a model without sand, and finds the same."""
    plain, model = mujoco.MjModel.from_xml_string(xml(box())), compiled(box())
    (bed,) = rftsim.instances(model)
    found = stand(plain, mujoco.MjData(plain), PackedBed(bed.packed, bed.bodies, rftsim.FreeSurface()))
    assert found.qpos == pytest.approx(stood(model).qpos, abs=1e-12)


def test_sand_without_strength_carries_nothing():
    model = compiled(box())
    bed = rftsim.instances(model)[0].bed
    bed.xi_n = 0.0
    found = stood(model)
    assert found.trees[0].lowered == math.inf
    assert (found.qpos == model.qpos0).all()


@pytest.mark.parametrize("quat", [(1, 0, 0, 0), (0.9, 0.3, 0.1, -0.2), (0.2, 0.8, -0.5, 0.1)])
def test_sinkage_is_the_lowest_corners_depth(quat):
    """Exact where the box of the body touches; within a fraction of a triangle's edge elsewhere."""
    model = compiled(box(more='<geom type="sphere" size=".03" pos=".2 0 -.1" mass="0"/>'))
    data = mujoco.MjData(model)
    data.qpos[:] = (0, 0, 0, *quat)
    mujoco.mj_forward(model, data)
    turn = data.xmat[1].reshape(3, 3)[2]
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.05, 0.05) for z in (-0.04, 0.04)])
    lowest = max(-(corners @ turn).min(), 0.03 - turn @ [0.2, 0, -0.1])
    (bed,) = rftsim.instances(model)
    assert layout.extent(bed.bodies[1]) == pytest.approx(0.33, rel=0.01)
    assert sinkage(rftsim.FreeSurface(), bed.bodies[1], data.xpos[1], data.xmat[1]) == pytest.approx(lowest, abs=0.01)
