"""The two terms that the dynamic laws add, [Agarwal] chapter 4, eq. (4.2)."""

import dataclasses

import numpy as np
import pytest
from shapes import about, alpha, plate, rim, rotation, unit

from rftsim import Sand, make_surface, surface_force
from rftsim.surface.triangles import Surface, Wheel

PAIRS = [("rft2d", "drft2d"), ("rft3d", "drft3d"), ("rft3d:c4", "drft3d:c4")]
SAND = Sand(xi_n=1e6, rho_c=638.0, lambda_=1.1, g=9.8)
R = 0.106
RPM = 2 * np.pi / 60
ROLLING = Wheel((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), R)


def wheel(**options):
    return dataclasses.replace(rim(R, **options), wheel=ROLLING)


def drops(surface, law="drft2d", sand=SAND, **motion):
    """Fall of the free surface at each triangle, from the depths with and without it."""
    dynamic, static = (surface_force(surface, sand, name, **motion).depth for name in (law, law[1:]))
    return static - dynamic


@pytest.mark.parametrize(("static", "dynamic"), PAIRS[1:])
@pytest.mark.parametrize("seed", range(5))
def test_inertial_term(static, dynamic, seed):
    """Eq. (4.2): -n lambda rho v_n^2 on leading triangles, whatever the depth."""
    rng = np.random.default_rng(seed)
    v, n = rng.normal(size=3) * 3, unit(rng.normal(size=3))
    n = n * np.sign(n @ v)
    for depth in (0.01, 1.0):
        face = plate(n, area=0.02, centre=(0, 0, -depth))
        extra = (
            surface_force(face, SAND, dynamic, velocity=v).force - surface_force(face, SAND, static, velocity=v).force
        )
        np.testing.assert_allclose(extra, -1.1 * 638.0 * 0.02 * (n @ v) ** 2 * n, rtol=1e-9)
    assert not alpha(-n, v, dynamic, SAND).any()


@pytest.mark.parametrize("lean", [0.0, 0.4])
def test_inertial_term_in_the_plane(lean):
    """Eq. (4.2) in plane strain: the projected width, normal and velocity."""
    v, n = np.array([2.0, 0.7, -1.0]), unit((1.0, lean, -0.5))
    extra = alpha(n, v, "drft2d", SAND) - alpha(n, v, "rft2d", SAND)
    flat = np.array([n[0], 0.0, n[2]])
    v_n = flat @ v / np.linalg.norm(flat)
    np.testing.assert_allclose(extra, -1.1 * 638.0 * v_n**2 * flat, rtol=1e-9)


def test_published_plate_drag():
    """Section 4.7: F = K z + 1.1 . 900 . 0.016 v^2 N per metre adds 6.5 N at 0.64 m/s, and nothing at rest."""
    sand = Sand(xi_n=1.0, rho_c=900.0, lambda_=1.1)
    force = [alpha((1, 0, 0), (v, 0, 0), "drft3d", sand)[0] * 0.016 for v in (1e-9, 0.64)]
    assert force[0] - force[1] == pytest.approx(6.5, abs=0.05)


@pytest.mark.parametrize(("rpm", "fall"), [(10, 1.26e-3), (30, 11.3e-3), (60, 45.3e-3), (90, 101.8e-3)])
def test_fall_behind_a_wheel(rpm, fall):
    """Section 4.6.2, delta h = r (r omega^2 / g) at r = 106 mm and g = 9.8 m/s^2, over part of the wheel only."""
    motion = {"position": (0, 0, 0.05), "velocity": (0.01, 0, 0), "angular_velocity": (0, rpm * RPM, 0)}
    found = drops(wheel(), **motion)
    assert found.max() == pytest.approx(fall, rel=5e-3)
    assert set(np.round(found / found.max(), 9)) == {0.0, 1.0}


@pytest.mark.parametrize("law", ["drft2d", "drft3d", "drft3d:c4"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_only_the_rear_half_of_the_contact_arc_falls(law, sense, heading):
    """Section 4.6.2: the contact region is halved by the angle that it subtends at the wheel's centre.

    A wheel of radius r that turns at its place, its centre at r / 2 above the sand, touches it 60 deg before and
    behind. Turning alone makes no triangle of a round rim lead, but for rounding; a sinking speed makes all lead.
    """
    turn = about((0, 0, 1), heading)
    plane = turn @ [0, 1, 0]
    motion = {
        "position": (0, 0, R / 2),
        "rotation": turn,
        "velocity": (0, 0, -0.1),
        "angular_velocity": sense * 60 * RPM * plane,
        "plane": plane,
    }
    body = wheel(sections=360)
    behind = drops(body, law, **motion) > 0.0
    strip = np.abs(body.normals[:, 1]) < 0.5
    along = sense * body.centres[:, 0]
    np.testing.assert_array_equal(behind[strip], along[strip] < 0.0)


def test_halving_follows_the_arc():
    """A wheel that drives forward has its leading arc in front, so that the halving angle moves forward too."""
    motion = {"position": (0, 0, R / 2), "velocity": (1.0, 0, -0.001), "angular_velocity": (0, 60 * RPM, 0)}
    body = wheel(sections=360)
    fallen = drops(body, **motion) > 0.0
    strip = (np.abs(body.normals[:, 1]) < 0.5) & (body.centres[:, 2] < -R / 2)
    angles = np.degrees(np.arctan2(body.centres[strip, 0], -body.centres[strip, 2]))
    assert angles[fallen[strip]].max() == pytest.approx(30.0, abs=1.0)
    assert angles[~fallen[strip]].min() == pytest.approx(30.0, abs=1.0)


def test_a_fall_below_the_wheel_leaves_no_force_there():
    """The effective depth is never below 0: where the sand has gone, nothing pushes, nor pulls."""
    motion = {"position": (0, 0, R / 2), "velocity": (0, 0, -0.1), "angular_velocity": (0, 90 * RPM, 0)}
    body = wheel(sections=90)
    result = surface_force(body, SAND, "drft2d", **motion)
    gone = (body.centres[:, 0] < -1e-9) & (body.centres[:, 2] < -R / 2)
    assert gone.any()
    assert not result.stress[gone].any()
    assert result.stress[body.centres[:, 2] < -R / 2].any()


@pytest.mark.parametrize(
    "change",
    [
        {"angular_velocity": (0, 0, 0)},
        {"angular_velocity": (5, 0, 5)},
        {"rotation": about((1, 0, 0), np.pi / 2), "angular_velocity": (0, 0, 5)},
        {"position": (0, 0, 1)},
    ],
    ids=["not spinning", "spinning across", "lying on its side", "in the air"],
)
def test_no_fall_without_a_driven_wheel(change):
    """The structural term belongs to driven wheels, section 4.7: none for plates, runners or wheels at rest."""
    motion = {"position": (0, 0, R / 2), "velocity": (1, 0, -0.1), "angular_velocity": (0, 5, 0)} | change
    assert not drops(wheel(), "drft3d", **motion).any()


def test_no_fall_where_no_wheel_was_named():
    """The same body without its Wheel has no structural term."""
    motion = {"position": (0, 0, R / 2), "velocity": (1, 0, -0.1), "angular_velocity": (0, 5, 0)}
    assert drops(wheel(), **motion).any()
    assert not drops(rim(R), **motion).any()


def test_rounding_does_not_choose_the_rear():
    """On a regular rim a triangle lies exactly on the middle of the arc: it must not fall or stay by chance.

    The same wheel, described in eight body frames, must drop the same triangles; one of 192 here is 14 % of the force.
    """
    where = {"position": np.array([0, 0, R / 2]), "velocity": np.array([0.3, 0, -0.1]), "angular_velocity": (0, 6.0, 0)}
    expected = drops(wheel(sections=48), "drft3d", **where) > 1e-9
    assert expected.any()
    for seed in range(8):
        turn, shift = rotation(np.random.default_rng(seed)), np.array([0.1, 0.2, 0.3])
        body = rim(R, sections=48).moved(turn, shift)
        body = dataclasses.replace(body, wheel=Wheel(tuple(turn @ [0, 1, 0]), tuple(shift), R))
        arm = turn.T @ shift
        velocity = where["velocity"] - np.cross(where["angular_velocity"], arm)
        moved = where | {"position": where["position"] - arm, "velocity": velocity, "rotation": turn.T}
        np.testing.assert_array_equal(drops(body, "drft3d", **moved) > 1e-9, expected)


# Dimensional scaling --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["rft2d", "drft2d", "rft3d", "drft3d", "rft3d:c4", "drft3d:c4"])
@pytest.mark.parametrize(("q", "r", "s"), [(4.0, 1.0, 1.0), (1.0, 2.0, 8.0), (0.38, 3.0, 5.0)])
def test_dimensional_scaling(law, q, r, s):
    """Slonaker's scaling of a wheel: force by q s, moment by q s r, power by q^3/2 r^1/2 s.

    With g -> q g, lengths -> r, width -> s r^-2 of itself, omega -> (q / r)^1/2; in 3D, where the sides count, s = r^3.
    """
    s = s if "2d" in law else r**3
    motion = {"position": np.array([0, 0, R / 3]), "velocity": np.array([0.2, 0, -0.05])}
    omega = np.array([0, 8.0, 0])
    small = surface_force(wheel(), SAND, law, **motion, angular_velocity=omega)
    stretched = make_surface(
        (rim(R).triangles * [r, s / r**2, r]).reshape(-1, 3), np.arange(3 * rim(R).ntri).reshape(-1, 3)
    )
    large = surface_force(
        dataclasses.replace(stretched, wheel=Wheel((0, 1, 0), (0, 0, 0), r * R)),
        SAND.replace(g=q * SAND.g),
        law,
        position=r * motion["position"],
        velocity=np.sqrt(q * r) * motion["velocity"],
        angular_velocity=np.sqrt(q / r) * omega,
    )
    np.testing.assert_allclose(large.force, q * s * small.force, atol=1e-9 * q * s * np.abs(small.force).max())
    assert large.moment[1] == pytest.approx(q * s * r * small.moment[1], rel=1e-9)
    assert large.power == pytest.approx(q**1.5 * r**0.5 * s * small.power, rel=1e-9)


def test_dynamic_laws_do_depend_on_speed():
    """Appendix B.2: without the dynamic terms only v / (r omega) matters; with them it does not suffice."""
    motion = {
        "position": (0, 0, R / 2),
        "velocity": np.array([0.3, 0, -0.1]),
        "angular_velocity": np.array([0, 6.0, 0]),
    }
    faster = motion | {name: 2 * motion[name] for name in ("velocity", "angular_velocity")}
    for static, dynamic in PAIRS:
        one, two = (surface_force(wheel(), SAND, static, **m).force for m in (motion, faster))
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-9)
        one, two = (surface_force(wheel(), SAND, dynamic, **m).force for m in (motion, faster))
        assert np.abs(one - two).max() > 0.1 * np.abs(one).max()


def test_surface_keeps_its_wheel_under_refinement():
    """A refined wheel is still a wheel."""
    assert isinstance(wheel().refined(0.02), Surface)
    assert wheel().refined(0.02).wheel == ROLLING
