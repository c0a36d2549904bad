"""A surface packed once, evaluated at many poses in one call; and the shapes to start from."""

import time

import mujoco
import numpy as np
import oracle
import pytest
from shapes import about, blob, rotation, unit

from rftsim import FreeSurface, Intruder, RftsimError, Sand, SurfaceError, add_sand, shapes, surface_force
from rftsim.surface import solids

SAND = Sand(xi_n=1e6, mu_surf=0.4, rho_c=1500.0, lambda_=1.4)


def motions(n, seed=0):
    """Random poses and motions near the sand's surface, as arguments of `wrench`."""
    rng = np.random.default_rng(seed)
    turns = np.array([rotation(rng) for _ in range(n)])
    return 0.03 * rng.normal(size=(n, 3)), turns, rng.normal(size=(n, 3)), 5 * rng.normal(size=(n, 3))


@pytest.mark.parametrize("law", ["rft2d", "rft3d", "drft3d:c4"])
def test_many_poses_are_as_many_single_ones(law):
    """Force and moment at each of 20 poses are those that the triangles sum to, pose by pose, on a slope too."""
    surface = blob(np.random.default_rng(1))
    terrain = FreeSurface(0.01, tuple(unit([0.0, 0.2, 1.0])))
    options = {"terrain": terrain, "plane": (1, 0, 0)}
    given = motions(20)
    found = Intruder(surface, SAND, law, **options).wrench(*given)
    assert found.force.shape == found.moment.shape == (20, 3)
    for k, (position, turn, velocity, omega) in enumerate(zip(*given, strict=True)):
        one = surface_force(
            surface,
            SAND,
            law,
            position=position,
            rotation=turn,
            velocity=velocity,
            angular_velocity=omega,
            **options,
        )
        np.testing.assert_allclose(found.force[k], one.force, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.moment[k], one.moment, rtol=1e-9, atol=1e-9)


def test_single_arguments_go_with_many():
    """Depths against one velocity are a sweep; without any n, force and moment are of shape (3,)."""
    ball = Intruder(shapes.sphere(0.02), SAND)
    depths = np.linspace(0.03, 0.3, 10)
    positions = np.column_stack([0 * depths, 0 * depths, -depths])
    sweep = ball.wrench(positions, velocity=(0, 0, -1))
    single = ball.wrench((0, 0, -0.3), velocity=(0, 0, -1))
    assert single.force.shape == (3,)
    np.testing.assert_allclose(sweep.force[-1], single.force, rtol=1e-12)
    np.testing.assert_allclose(np.diff(sweep.force[:, 2]), np.diff(sweep.force[:, 2])[0], rtol=1e-9)  # linear in depth
    assert ball.wrench(positions[:0]).force.shape == (0, 3)
    assert ball.wrench(positions[:1]).force.shape == (1, 3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"position": (0, 0, np.nan)}, "position must be finite, and one number is nan"),
        ({"velocity": [(0, 0, 1), (0, np.inf, 1)]}, "velocity must be finite, and one number is inf"),
        ({"position": (0, 0)}, r"position must have the shape \(3,\), or \(n, ...\) for n poses, not \(2,\)"),
        ({"rotation": np.ones((4, 3))}, r"rotation must have the shape \(3, 3\)"),
        ({"rotation": 2 * np.eye(3)}, "rotation must be orthogonal"),
        ({"rotation": [np.eye(3), np.diag([1, 1, -1])]}, "rotation must be orthogonal and right-handed"),
        ({"position": np.zeros((2, 3)), "velocity": np.zeros((3, 3))}, "as many each, or one, not 2 of position, 3 of"),
    ],
)
def test_what_is_no_pose_is_refused(arguments, words):
    """Numbers that are not finite, shapes that do not fit and rotations that are none: each in a sentence."""
    ball = shapes.sphere(0.02)
    with pytest.raises(RftsimError, match=words):
        Intruder(ball, SAND).wrench(**arguments)
    with pytest.raises(RftsimError):
        surface_force(ball, SAND, **arguments)


def test_a_call_costs_little():
    """On 23,520 triangles a call takes a thirtieth of the laws in NumPy, and 30 poses in one call no more each."""
    profile = np.array([(0.0, -0.07), *((0.025, z) for z in np.linspace(-0.07, 0.07, 141)), (0.0, 0.07)])
    surface = shapes.Surface(solids.revolved(profile, 84)[..., [1, 2, 0]])
    cylinder = Intruder(surface, SAND)
    position, velocity, omega = np.array([0, 0, -0.1]), np.array([0, 0, -0.1]), np.array([0, 0, -np.pi])
    body = oracle.Body(surface.centres + position, surface.normals, surface.areas, position, velocity, omega)
    positions = np.tile(position, (30, 1))

    def least(work, rounds):
        spent = []
        for _ in range(rounds):
            start = time.process_time()
            work()
            spent.append(time.process_time() - start)
        return min(spent)

    literal = least(lambda: oracle.rft3d(body, SAND.xi_n, SAND.mu_surf), 3)
    single = least(lambda: cylinder.wrench(position, velocity=velocity, angular_velocity=omega), 50)
    many = least(lambda: cylinder.wrench(positions, velocity=velocity, angular_velocity=omega), 5) / 30
    assert single < literal / 30
    assert many < literal / 30


@pytest.mark.parametrize("law", ["rft2d", "drft2d"])
def test_side_faces_are_not_active(law):
    """Of a box in the plane of a 2D law the two sides along it carry nothing, and are not active, however turned."""
    box = shapes.box((0.1, 0.06, 0.04), max_edge=0.2)
    for turn in (np.eye(3), about((0, 1, 0), 0.3)):
        found = surface_force(box, SAND, law, position=(0, 0, -1), rotation=turn, velocity=(1, 0, -1))
        sides = np.abs(box.normals[:, 1]) > 0.5
        assert not found.active[sides].any()
        assert found.active.sum() == 4


# Shapes ---------------------------------------------------------------------------------------------------------------

R, L = 0.03, 0.1
SHAPES = {
    "box": (lambda **k: shapes.box((0.1, 0.2, 0.3), **k), 0.006, 0.22, "0.05 0.1 0.15"),
    "sphere": (lambda **k: shapes.sphere(R, **k), 4 / 3 * np.pi * R**3, 4 * np.pi * R**2, f"{R}"),
    "cylinder": (
        lambda **k: shapes.cylinder(R, L, **k),
        np.pi * R**2 * L,
        2 * np.pi * R * (R + L),
        f"{R} {L / 2}",
    ),
    "capsule": (
        lambda **k: shapes.capsule(R, L, **k),
        np.pi * R**2 * (L + 4 / 3 * R),
        2 * np.pi * R * (L + 2 * R),
        f"{R} {L / 2}",
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_have_their_volume_and_area(name):
    """Volumes are true, areas too as the edges get shorter, and no edge is longer than asked."""
    make, volume, area, _ = SHAPES[name]
    for edge, error in ((None, 0.02), (0.005, 5e-3)):
        surface = make(max_edge=edge)
        assert solids.volume(surface.triangles) == pytest.approx(volume, rel=1e-9)
        assert surface.areas.sum() == pytest.approx(area, rel=error)
        assert np.abs(surface.normals.T @ surface.areas).max() < 1e-12
    edges = np.linalg.norm(surface.triangles - np.roll(surface.triangles, 1, axis=1), axis=2)
    assert edges.max() <= 0.005


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_those_of_a_model(name):
    """The same geom of a MuJoCo model is felt with the same triangles, to its single precision."""
    make, *_, size = SHAPES[name]
    geom = f'<geom type="{name}" size="{size}"/>'
    text = f'<mujoco><worldbody><body name="b"><freejoint/>{geom}</body></worldbody></mujoco>'
    spec = mujoco.MjSpec.from_string(text)
    felt = add_sand(spec, SAND, reduction=0.0).surfaces["b"]
    own = make()
    assert own.ntri == felt.ntri
    places = [one.centres[np.lexsort(one.centres.round(7).T)] for one in (own, felt)]
    np.testing.assert_allclose(*places, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: shapes.box((1, 1, 0)), "height must be positive and finite, not 0"),
        (lambda: shapes.box((1, 1)), "three lengths"),
        (lambda: shapes.sphere(float("nan")), "radius must be positive and finite, not nan"),
        (lambda: shapes.cylinder(1, -1), "length must be positive"),
        (lambda: shapes.capsule(1, 1, max_edge=0.0), "max_edge must be positive"),
    ],
)
def test_shapes_that_are_none(make, words):
    with pytest.raises(SurfaceError, match=words):
        make()
