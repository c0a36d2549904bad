"""The surfaces that a scene's bodies get, its wheels, its plane of motion and its free surface."""

import mujoco
import numpy as np
import pytest
from shapes import about
from trees import BALL, JOINTS, SAND, sandy, shaken, spec_of

from rftsim import FreeSurface, SceneError, add_sand, instances, surface_force, tractions, wrenches
from rftsim.surface.triangles import Wheel

WHEEL = """
  <body name="car" pos="0 0 .05"><freejoint/><geom type="box" size=".2 .1 .02" pos="0 0 .1"/>
    <body name="wheel" pos=".2 .1 0">
      <joint type="hinge" axis="0 1 0" pos="0 .02 0"/>
      <geom type="cylinder" size=".1 .03" quat=".70710678 .70710678 0 0" pos="0 .02 0"/>
    </body>
  </body>"""


BOX = '<body name="b" pos="0 0 -.2">{}<geom type="box" size=".1 .05 .03"/></body>'


def bed_of(mjcf, option="", sand=SAND, law="rft3d", **options):
    return add_sand(spec_of(mjcf, option), sand, law, **{"reduction": 0.0} | options)


# Surfaces -------------------------------------------------------------------------------------------------------------


def test_surface_is_that_of_the_geoms():
    """Volume and centroid of each primitive's triangles are those that MuJoCo's mass and inertial frame say."""
    place = 'pos=".1 .2 -.3" quat=".3 .5 -.2 .7" density="1000"'
    sizes = {"sphere": ".1", "box": ".1 .2 .05", "ellipsoid": ".1 .2 .05", "cylinder": ".1 .2", "capsule": ".1 .2"}
    for kind, size in sizes.items():
        spec = spec_of(f'<body name="b"><freejoint/><geom type="{kind}" size="{size}" {place}/></body>')
        surface, model = add_sand(spec, SAND, reduction=0.0).surfaces["b"], spec.compile()
        vector = surface.normals * surface.areas[:, None]
        np.testing.assert_allclose(vector.sum(axis=0), 0.0, atol=1e-12)
        volume = np.einsum("ij,ij->", surface.centres, vector) / 3.0
        assert volume == pytest.approx(model.body("b").mass[0] / 1000.0, rel=1e-9)
        tetrahedra = (surface.centres * vector).sum(axis=1) / 3.0  # to the origin
        centroid = tetrahedra @ (0.75 * surface.centres) / volume
        np.testing.assert_allclose(centroid, model.body("b").ipos, atol=1e-9)


def test_mesh_geoms_keep_their_place(tmp_path):
    """MuJoCo re-centres and turns meshes; their triangles end where the file and the geom put them."""
    vertices = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]]) + 0.5
    faces = "0 2 1 0 1 3 1 2 3 2 0 3"
    mesh = f'<asset><mesh name="m" vertex="{" ".join(map(str, vertices.ravel()))}" face="{faces}"/></asset>'
    body = '<body name="b"><freejoint/><geom type="mesh" mesh="m" pos="1 2 3" euler="0 0 90"/></body>'
    surface = bed_of(body, mesh).surfaces["b"]
    expected = vertices @ about((0, 0, 1), np.pi / 2)[:3, :3].T + [1, 2, 3]
    points = surface.triangles.reshape(-1, 3)
    np.testing.assert_allclose(points.min(axis=0), expected.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), expected.max(axis=0), atol=1e-6)


@pytest.mark.parametrize("edge", [0.02, 0.05])
def test_max_edge(edge):
    """No triangle's edge exceeds max_edge."""
    triangles = bed_of(BALL, max_edge=edge).surfaces["ball"].triangles
    assert np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max() <= edge


# Wheels and planes ----------------------------------------------------------------------------------------------------


def test_wheel_from_its_hinge():
    """A named wheel turns about its hinge, and its radius is that of its surface."""
    bed = bed_of(WHEEL, law="drft3d", wheels=["wheel"])
    wheel = bed.surfaces["wheel"].wheel
    np.testing.assert_allclose(wheel.axis, (0, 1, 0))
    np.testing.assert_allclose(wheel.centre, (0, 0.02, 0))
    assert wheel.radius == pytest.approx(0.1, rel=0.01)
    assert bed.surfaces["car"].wheel is None


def test_wheel_by_its_measures():
    """A Wheel may be given; in the compiled model the sand falls behind it, section 4.6.2."""
    spec = spec_of(WHEEL)
    add_sand(spec, SAND, "drft3d", wheels={"wheel": Wheel((0, 1, 0), (0, 0.02, 0), 0.1)}, force="explicit")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[6] = 6.0
    mujoco.mj_forward(model, data)
    faces = tractions(model, data, "wheel")
    fall = -faces.centre[:, 2] - faces.depth
    assert fall.max() == pytest.approx(0.1**2 * 6.0**2 / 9.81, rel=1e-9)
    assert 0.2 < (fall > 1e-9).mean() < 0.8


def test_wheels_that_cannot():
    """A wheel must feel the sand, and without a hinge its measures must be given."""
    with pytest.raises(SceneError, match="'tyre' does not feel the sand; bodies that do are car, wheel"):
        bed_of(WHEEL, law="drft3d", wheels=["tyre"])
    with pytest.raises(SceneError, match="'car' has no hinge"):
        bed_of(WHEEL, law="drft3d", wheels=["car"])


@pytest.mark.parametrize("law", ["rft2d", "drft2d"])
def test_sides_carry_nothing_in_the_plane(law):
    """2D laws press on area vectors projected onto the plane of motion: a box's sides feel nothing."""
    box = bed_of(BOX.format("<freejoint/>")).surfaces["b"]
    found = surface_force(box, SAND, law, position=(0, 0, -0.2), velocity=(1.0, 5.0, -0.5))
    sides = np.abs(box.normals[:, 1]) > 0.5
    assert not found.stress[sides].any()
    assert found.stress[~sides].any()
    assert found.force[1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found.moment[[0, 2]], 0.0, atol=1e-9)


def test_faces_that_a_planar_law_never_feels_are_left_out():
    """A body that stays in the plane of motion has no sides, and the force is that of all faces."""
    box = BOX.format(JOINTS["planar"])
    kept, whole = bed_of(box, law="rft2d"), bed_of(box).surfaces["b"]
    assert "are parallel to it and left out" in kept.reasons["b"]
    assert np.abs(kept.surfaces["b"].normals[:, 1]).max() < 0.5 < np.abs(whole.normals[:, 1]).max()
    model = sandy(box, law="rft2d")
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0, -0.5, 2.0
    mujoco.mj_forward(model, data)
    motion = {"velocity": (1.0, 0.0, -0.5), "angular_velocity": (0.0, 2.0, 0.0)}
    found = surface_force(whole, SAND, "rft2d", position=(0, 0, -0.2), **motion)
    np.testing.assert_allclose(data.qfrc_passive, [found.force[0], found.force[2], found.moment[1]], rtol=1e-9)


def test_slopes_across_the_default_plane():
    """A 3D law needs no plane of motion, so the surface may tilt any way; a planar law needs one along the slope."""
    slope = FreeSurface(normal=(0.0, 0.2, 1.0))
    bed_of(BALL, terrain=slope)
    planar = BOX.format('<joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/><joint axis="1 0 0"/>')
    bed_of(planar, law="rft2d", terrain=slope, plane=(1, 0, 0))
    with pytest.raises(ValueError, match="plane of motion"):
        bed_of(planar, law="rft2d", terrain=slope)


def test_planes_may_be_turned():
    """A scene and its plane turned about the vertical feel the turned force."""
    turn = about((0, 0, 1), 0.7)
    forces = []
    for angle, r in ((0.0, np.eye(3)), (0.7, turn)):
        box = BOX.replace("<body ", f'<body euler="0 0 {np.degrees(angle)}" ').format(JOINTS["planar"])
        model = sandy(box, law="rft2d", plane=r @ [0, 1, 0])
        data = mujoco.MjData(model)
        data.qvel[:] = 1.0, -0.5, 0.3
        mujoco.mj_forward(model, data)
        forces.append(wrenches(model, data).force[1])
    np.testing.assert_allclose(forces[1], turn @ forces[0], rtol=1e-9, atol=1e-9)


def test_surface_may_be_raised_and_tilted():
    """The scene under a tilted surface is the tilted scene under a level one; the sand is drawn there."""
    normal = np.array([0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    turn = about((0, 1, 0), np.arctan(0.2))
    tilted = sandy(terrain=FreeSurface(0.3, tuple(normal)))
    level = sandy()
    forces = []
    for model, r, origin in ((level, np.eye(3), 0.0), (tilted, turn, 0.3)):
        data = mujoco.MjData(model)
        data.qpos[:3] = r @ [0.1, 0.2, -0.05] + [0, 0, origin]
        mujoco.mju_mat2Quat(data.qpos[3:7], r.ravel())
        data.qvel[:3] = r @ [1, 0.3, -0.5]
        mujoco.mj_forward(model, data)
        forces.append(wrenches(model, data).force[1])
    np.testing.assert_allclose(forces[1], turn @ forces[0], rtol=1e-9, atol=1e-9)
    drawn = np.zeros(9)
    mujoco.mju_quat2Mat(drawn, tilted.geom("sand_surface").quat)
    np.testing.assert_allclose(drawn[2::3], normal, atol=1e-12)
    assert tilted.geom("sand_surface").pos[2] == 0.3


def test_nothing_is_drawn_or_sensed_on_request():
    """draw=False and sensors=False leave the model's geoms and sensors as they were; the force stays."""
    model = sandy(draw=False, sensors=False)
    assert (model.ngeom, model.nsensor) == (1, 0)
    assert wrenches(model, shaken(model)).force.any()
    assert len(instances(model)) == 1
