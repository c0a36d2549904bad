"""Terrain: its surface passes through its heights, and the laws feel it at each triangle as the printed laws do."""

import numpy as np
import oracle
import pytest
from scipy.interpolate import BSpline

import rftsim
from rftsim import FreeSurface, Intruder, Sand, Terrain, shapes, surface_force

SAND = Sand(rho_c=1500.0, mu_int=0.4, mu_surf=0.4, xi_n=3e5, zeta=2.6e5, lambda_=1.1)
BALL = shapes.sphere(0.1)
X, Y = np.meshgrid(np.arange(41) * 0.1 - 2.0, np.arange(41) * 0.1 - 2.0)
BUMP = Terrain(0.1 * np.exp(-((X - 0.1) ** 2 + Y**2) / 0.1), 0.1, (-2.0, -2.0))


def pose(rng, low=0.5):
    """A pose and motion of a body near the middle of the terrain."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return {
        "position": np.append(rng.uniform(-low, low, 2), rng.uniform(-0.05, 0.1)),
        "rotation": turn * np.linalg.det(turn),
        "velocity": rng.normal(size=3),
        "angular_velocity": rng.normal(size=3),
    }


@pytest.mark.parametrize("repeat", [False, True])
def test_the_surface_passes_through_its_heights_with_continuous_slope(repeat):
    rng = np.random.default_rng(1)
    terrain = Terrain(rng.normal(size=(7, 9)), (0.1, 0.3), (1.0, -2.0), repeat)
    x, y = np.meshgrid(1.0 + 0.1 * np.arange(9), -2.0 + 0.3 * np.arange(7))
    np.testing.assert_allclose(terrain.height_at(x, y), terrain.heights, atol=1e-14)
    x, y, d = rng.uniform(0.0, 3.0, 500), rng.uniform(-4.0, 2.0, 500), 1e-6
    slope_x = (terrain.height_at(x + d, y) - terrain.height_at(x - d, y)) / (2 * d)
    slope_y = (terrain.height_at(x, y + d) - terrain.height_at(x, y - d)) / (2 * d)
    normal = terrain.normal_at(x, y)
    np.testing.assert_allclose(-normal[:, 0] / normal[:, 2], slope_x, atol=2e-3 * np.abs(slope_x).max())
    np.testing.assert_allclose(-normal[:, 1] / normal[:, 2], slope_y, atol=2e-3 * np.abs(slope_y).max())
    at = 1.0 + 0.1 * np.arange(0.5, 8.0)  # between the values, where the pieces meet
    for side in (-1e-9, 1e-9):
        np.testing.assert_allclose(
            terrain.normal_at(at + side, np.zeros(8)), terrain.normal_at(at, np.zeros(8)), atol=1e-6
        )


def test_the_surface_is_that_of_quadratic_b_splines():
    heights = np.random.default_rng(2).normal(size=(12, 12))
    terrain, step = Terrain(heights, 1.0, repeat=True), BSpline.basis_element([0.0, 1.0, 2.0, 3.0], extrapolate=False)
    place = np.random.default_rng(3).uniform(0.0, 12.0, (40, 2))

    def weights(t):
        distance = (t[:, None] - np.arange(12) + 6.0) % 12.0 - 6.0
        return np.nan_to_num(step(distance + 1.5))

    nodes = weights(np.arange(12.0))
    coefficients = np.linalg.solve(nodes, np.linalg.solve(nodes, heights).T).T
    expected = np.einsum("ni,ij,nj->n", weights(place[:, 1]), coefficients, weights(place[:, 0]))
    np.testing.assert_allclose(terrain.height_at(*place.T), expected, atol=1e-12)


def test_it_converges_to_a_smooth_surface_with_the_third_power_of_its_spacing():
    def error(n):
        x, y = np.meshgrid(np.arange(n) / n, np.arange(n) / n)
        terrain = Terrain(np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y), 1.0 / n, repeat=True)
        at = np.random.default_rng(4).uniform(size=(2, 2000))
        return np.abs(terrain.height_at(*at) - np.sin(2 * np.pi * at[0]) * np.cos(2 * np.pi * at[1])).max()

    assert np.log2(error(16) / error(32)) == pytest.approx(3.0, abs=0.3)


def test_beyond_its_edge_it_levels_off_or_repeats():
    heights = np.random.default_rng(5).normal(size=(6, 8))
    level, again = Terrain(heights, 0.5), Terrain(heights, 0.5, repeat=True)
    far = level.height_at([20.0, 30.0, 20.0], [1.0, 1.0, 1.0])
    assert far.tolist() == [far[0]] * 3
    assert level.normal_at(20.0, 1.0).tolist() == pytest.approx([0.0, *level.normal_at(20.0, 1.0)[1:]])
    place = np.random.default_rng(6).uniform(-5.0, 5.0, (2, 50))
    np.testing.assert_allclose(again.height_at(*place), again.height_at(place[0] + 4.0, place[1] - 3.0 * 2), atol=1e-12)


@pytest.mark.parametrize("law", rftsim.LAWS)
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.3, 0.0, 1.0)])
def test_a_terrain_that_is_a_plane_gives_the_planes_wrench(law, normal):
    plane = FreeSurface(0.02, normal)
    terrain, rng = Terrain(plane.height_at(X, Y), 0.1, (-2.0, -2.0)), np.random.default_rng(7)
    for _ in range(20):
        how = pose(rng)
        expected = surface_force(BALL, SAND, law, terrain=plane, **how)
        found = surface_force(BALL, SAND, law, terrain=terrain, **how)
        scale = SAND.xi_n * BALL.areas.sum() * BALL.size
        np.testing.assert_allclose(found.force, expected.force, atol=1e-12 * scale)
        np.testing.assert_allclose(found.moment, expected.moment, atol=1e-12 * scale)
        wrench = Intruder(BALL, SAND, law, terrain=terrain).wrench(*how.values())
        np.testing.assert_allclose(wrench.force, expected.force, atol=1e-12 * scale)


LITERAL = {
    "rft3d": lambda body, **up: oracle.rft3d(body, SAND.xi_n, SAND.mu_surf, **up),
    "rft3d:c4": lambda body, **up: oracle.rft3d_c4(body, SAND.xi_n, SAND.mu_surf, **up),
    "drft3d": lambda body, **up: oracle.drft3d(body, SAND.xi_n, SAND.mu_surf, SAND.lambda_ * SAND.rho_c, **up),
    "rft2d": lambda body, **up: oracle.rft2d(body, SAND.zeta, **up),
    "drft2d": lambda body, **up: oracle.drft2d(body, SAND.zeta, SAND.lambda_ * SAND.rho_c, **up),
}


@pytest.mark.parametrize("law", LITERAL)
def test_on_a_bump_each_triangle_feels_the_depth_and_the_normal_above_it(law):
    bump, rng = BUMP, np.random.default_rng(8)
    if law.endswith("2d"):  # a ridge along the axis across the plane of motion
        bump = Terrain(0.1 * np.exp(-((X - 0.1) ** 2) / 0.1), 0.1, (-2.0, -2.0))
    for _ in range(10):
        how = pose(rng, 0.2)
        found = surface_force(BALL, SAND, law, terrain=bump, **how)
        turn, at = how["rotation"], how["position"]
        centres, normals, force = BALL.centres @ turn.T + at, BALL.normals @ turn.T, np.zeros(3)
        for c, n, area in zip(centres, normals, BALL.areas, strict=True):
            up = bump.normal_at(c[0], c[1])
            offset = up @ [c[0], c[1], float(bump.height_at(c[0], c[1]))]
            body = oracle.Body(c[None], n[None], np.array([area]), at, how["velocity"], how["angular_velocity"])
            force += LITERAL[law](body, up=up, offset=offset).force
        np.testing.assert_allclose(found.force, force, atol=1e-10 * np.abs(force).max())


def test_a_ball_over_a_bump_sinks_by_the_height_of_the_bump():
    still = {"velocity": (0.0, 0.0, -1.0)}
    over = surface_force(BALL, SAND, position=(1.5, 0.0, 0.0), terrain=BUMP, **still)
    on = surface_force(BALL, SAND, position=(0.1, 0.0, 0.0), terrain=BUMP, **still)
    assert on.force[2] > 1.5 * over.force[2]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((np.zeros(5), 0.1), r"at least 2 x 2 of them, not an array of shape \(5,\)"),
        (([[0.0, np.nan], [0.0, 0.0]], 0.1), "finite heights"),
        ((np.zeros((3, 3)), 0.0), "spacing must be positive"),
        ((np.zeros((3, 3)), 0.1, (0.0, np.inf)), "origin must be the x and y"),
        ((np.broadcast_to(0.0, (4000, 4000)), 0.1), "take a larger spacing"),
    ],
)
def test_what_is_no_terrain_is_refused(arguments, says):
    with pytest.raises(ValueError, match=says):
        Terrain(*arguments)
