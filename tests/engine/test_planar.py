"""Planar laws take bodies that their joints and equalities keep in the plane of motion, and no others."""

import mujoco
import numpy as np
import pytest
import trimesh
from rftsim_models import hexapod, hopper, wheels
from shapes import about
from trees import JOINTS, SAND, spec_of

import rftsim
from rftsim import SceneError, add_sand
from rftsim.run.scenes import stage

BOX = '<geom type="box" size=".1 .05 .03"/>'
PLANAR = JOINTS["planar"]
ACROSS = (-np.sin(0.5), np.cos(0.5), 0.0)
WELD = '<equality><weld body1="box"/></equality>'


def body(joints, inside=BOX, place=""):
    return f'<body name="box" pos="0 0 .02" {place}>{joints}{inside}</body>'


def refusal(mjcf, extra="", law="rft2d", **options):
    """The words by which a model is refused, which stays as it is."""
    spec = spec_of(mjcf, extra=extra)
    with pytest.raises(SceneError) as caught:
        add_sand(spec, SAND, law, reduction=0.0, **options)
    assert not list(spec.numerics)
    assert not list(spec.plugins)
    return str(caught.value)


def passes(mjcf, extra="", law="rft2d", option="", **options):
    spec = spec_of(mjcf, option, extra)
    bed = add_sand(spec, SAND, law, reduction=0.0, **options)
    spec.compile()
    return bed


def test_a_free_box_is_refused():
    """The message says who leaves which plane by what, and what would do."""
    assert refusal(body("<freejoint/>")) == (
        "rft2d acts in the plane across (0, 1, 0), and box can leave it by its free joint: "
        "give it slides along x and z and a hinge about y, or take rft3d"
    )
    assert refusal(body('<freejoint name="root"/>'), law="drft2d", plane=(2, 0, 0)) == (
        "drft2d acts in the plane across (1, 0, 0), and box can leave it by its free joint 'root': "
        "give it slides along y and z and a hinge about x, or take drft3d"
    )
    assert "two slides along that plane and a hinge about its normal" in refusal(body("<freejoint/>"), plane=ACROSS)


@pytest.mark.parametrize(
    ("joints", "by"),
    [
        ('<joint type="ball"/>', "its ball joint"),
        ('<joint name="yaw" axis="0 0 1"/>', "its hinge 'yaw'"),
        ('<joint type="slide" axis="1 .1 0"/>', "its slide"),
        (PLANAR + '<joint name="roll" axis="1 0 0"/>', "its hinge 'roll'"),
    ],
)
def test_joints_that_leave_the_plane(joints, by):
    assert f"box can leave it by {by}: give it" in refusal(body(joints))


def test_slides_and_a_hinge_pass():
    """About the plane's normal, whatever plane that is."""
    bed = passes(body(PLANAR))
    assert "parallel to it and left out" in bed.reasons["box"]
    assert "box can leave it by its slide and its hinge" in refusal(body(PLANAR), plane=(1, 0, 0))
    along = " ".join(map(str, np.cross(ACROSS, (0, 0, 1))))
    turned = f'<joint type="slide" axis="{along}"/><joint type="slide" axis="0 0 1"/>'
    passes(body(f'{turned}<joint axis="{" ".join(map(str, ACROSS))}" pos=".3 .1 0"/>'), plane=ACROSS)
    assert "box can leave it by its hinge" in refusal(body(turned + '<joint axis="0 1 0"/>'), plane=ACROSS)


@pytest.mark.parametrize(
    "quat", ["0.965926 0 0.258819 0", "0.707107 0 0 0.707107", "0.5 0.5 0.5 0.5", "0.8 0.36 0 0.48"]
)
def test_frames_may_be_turned(quat):
    """What counts is how the axes lie in the world, and the faces that are parallel to the plane there."""
    inverse, r = np.empty(9), np.empty(4)
    mujoco.mju_negQuat(r, np.array(quat.split(), dtype=float))
    mujoco.mju_normalize4(r)
    mujoco.mju_quat2Mat(inverse, r)
    x, y, z = (" ".join(f"{number:.6f}" for number in column) for column in inverse.reshape(3, 3).T)
    joints = f'<joint type="slide" axis="{x}"/><joint type="slide" axis="{z}"/><joint axis="{y}"/>'
    level = f'<geom type="box" size=".1 .05 .03" quat="{" ".join(map(str, r))}"/>'
    bed = passes(body(joints, level, f'quat="{quat}"'))
    assert "parallel to it and left out" in bed.reasons["box"]
    assert "by its slide and its hinge" in refusal(body(joints, level, f'quat="{quat}"'), plane=(1, 0, 0))


def test_the_start_counts():
    """A hinge about y at the start's pose may lie across it at the pose in which the model is written."""
    mass = '<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>'
    hand = body('<joint axis="1 0 0"/>')
    arm = f'<body name="arm"><joint name="turn" axis="0 0 1"/>{mass}{hand}</body>'
    assert "the hinge 'turn' of arm and the hinge of box" in refusal(arm)
    held = '<equality><joint joint1="turn" polycoef="{} 0 0 0 0"/></equality><keyframe><key qpos="{} 0"/></keyframe>'
    passes(arm, held.format(np.pi / 2, np.pi / 2))
    assert "box can leave it by its hinge" in refusal(arm, held.format(0, 0))


def test_equalities_may_keep_a_body_in_the_plane():
    """A weld to the world, a joint that is held, gears that cancel; not when they are off."""
    passes(body("<freejoint/>"), WELD)
    assert "its free joint" in refusal(body("<freejoint/>"), WELD.replace("<weld", '<weld active="false"'))
    held = '<equality><joint joint1="yaw"/></equality>'
    yawing = body(PLANAR + '<joint name="yaw" axis="0 0 1"/>')
    assert "its hinge 'yaw'" in refusal(yawing)
    passes(yawing, held)
    geared = '<joint name="a" type="slide" axis="1 1 0"/><joint name="b" type="slide" axis="1 -1 0"/>'
    passes(body(geared), '<equality><joint joint1="a" joint2="b" polycoef="0 1 0 0 0"/></equality>')
    opposed = '<equality><joint joint1="a" joint2="b" polycoef="0 -1 0 0 0"/></equality>'
    assert "its slide 'a' and its slide 'b'" in refusal(body(geared), opposed)


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_equalities_of_either_jacobian(jacobian):
    option = f'<option jacobian="{jacobian}"/>'
    other = '<body name="other" pos="0 0 3"><freejoint/><geom size=".1"/></body>'
    tied = WELD.replace("</equality>", '<connect body1="other" anchor="0 0 1"/></equality>')
    passes(body("<freejoint/>") + other, tied, option=option, bodies=["box"])


def test_trees_are_told_in_short():
    """The joint that lets all leave is named once, with its body; what many do is counted."""
    spec = hexapod.build_hexapod()
    with pytest.raises(SceneError, match=r"can leave it by the free joint.*give them slides along x and z") as caught:
        add_sand(spec, SAND, "rft2d", reduction=0.0)
    assert "more can leave it" in str(caught.value)
    assert len(str(caught.value)) < 300


def test_meshes_and_shipped_models():
    """A mesh wheel on a planar carriage, and what ships that moves in a plane; the intruder is free."""
    mesh = trimesh.creation.cylinder(
        0.1, 0.08, sections=24, transform=trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))
    )
    vertices, faces = (" ".join(map(str, numbers.ravel())) for numbers in (mesh.vertices, mesh.faces))
    asset = f'<asset><mesh name="wheel" vertex="{vertices}" face="{faces}"/></asset>'
    passes(body(PLANAR, '<geom type="mesh" mesh="wheel"/>'), asset)
    add_sand(wheels.build_wheel(wheels.FOUR_FLAP_RUNNER, 60.0), SAND, "rft2d")
    add_sand(hopper.build_hopper(), SAND, "rft2d")
    with pytest.raises(SceneError, match="intruder can leave it by its free joint"):
        stage("intruder", law="drft2d", sand=SAND.replace(lambda_=1.0))


def test_a_law_alone_needs_no_joints():
    """A force evaluation has no model that could leave the plane; a 3D law none that it has to stay in."""
    box = trimesh.creation.box((0.2, 0.1, 0.1))
    surface = rftsim.make_surface(box.vertices, box.faces)
    assert rftsim.surface_force(surface, SAND, "rft2d", velocity=(1, 1, -1)).force[2] > 0.0
    passes(body("<freejoint/>"), law="rft3d", plane=about((0, 0, 1), 0.3) @ [0, 1, 0])
