"""Symmetries and proportionalities that the laws have by construction, [Agarwal] sections 3.1, 5.5 and 5.6.1."""

import numpy as np
import oracle
import printed
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shapes import ONE, about, alpha, blob, plate, rotation, unit

from rftsim import FreeSurface, RftsimError, Sand, surface_force
from rftsim.law import evaluate, layout
from rftsim.law.laws import get_law

LAWS_3D = ("rft3d", "rft3d:c4")
QUASI_STATIC = ("rft2d", *LAWS_3D)
EXACT = {"rtol": 0, "atol": 1e-12}

angle = st.floats(-np.pi, np.pi)
tilt = st.floats(-np.pi / 2, np.pi / 2)
directions = st.builds(
    lambda z, a: np.array([np.sqrt(1 - z * z) * np.cos(a), np.sqrt(1 - z * z) * np.sin(a), z]), st.floats(-1, 1), angle
)
laws = st.sampled_from(QUASI_STATIC)
laws_3d = st.sampled_from(LAWS_3D)
sands = st.builds(lambda mu: Sand(xi_n=1.0, zeta=1.0, mu_surf=mu), st.floats(0, 1.5))


def leading(n, v):
    """n turned so that it leads, clear of edge-on."""
    assume(abs(n @ v) > 1e-6)
    return n if n @ v > 0.0 else -n


def clear_of_level(n):
    """At n_z = 0 the fit jumps between a face's two representatives: kept for `test_vertical_faces`."""
    assume(abs(n[2]) > 1e-6)
    return n


@given(directions, directions, angle, sands, laws)
def test_rotation_about_the_vertical(n, v, turn, sand, law):
    """Eq. (5.8) with R about gravity: alpha(R n, R v) = R alpha(n, v), the plane of the 2D law turning too."""
    n, r = clear_of_level(leading(n, v)), about((0, 0, 1), turn)
    turned = alpha(r @ n, r @ v, law, sand, plane=r @ [0, 1, 0])
    assume(law != "rft2d" or abs(n[0] * v[0] + n[2] * v[2]) > 1e-6)
    np.testing.assert_allclose(turned, r @ alpha(n, v, law, sand), **EXACT)


@given(directions, directions, directions, sands, laws)
def test_tilted_free_surface_is_the_rotated_problem(n, v, up, sand, law):
    """Eq. (5.8) with any R, gravity turning too: alpha(R n, R v, R g) = R alpha(n, v, g)."""
    n = clear_of_level(leading(n, v))
    assume(abs(up[2]) > 1e-3)
    up = up * np.sign(up[2])
    axis = np.cross([0, 0, 1], up)
    r = about(axis, np.arctan2(np.linalg.norm(axis), up[2])) if axis.any() else np.eye(3)
    tilted = surface_force(
        plate(r @ n, centre=r @ [0, 0, -1]),
        sand,
        law,
        velocity=r @ v,
        plane=r @ [0, 1, 0],
        terrain=FreeSurface(normal=tuple(up)),
    )
    assume(law != "rft2d" or abs(n[0] * v[0] + n[2] * v[2]) > 1e-6)
    np.testing.assert_allclose(tilted.force, r @ alpha(n, v, law, sand), **EXACT)


@given(directions, directions, sands, laws)
def test_mirror(n, v, sand, law):
    """A mirrored plate feels the mirrored force; for the 2D law that mirrors its axis too, eq. (3.1)."""
    n = clear_of_level(leading(n, v))
    for mirror in (np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0])):
        mirrored = alpha(mirror @ n, mirror @ v, law, sand)
        np.testing.assert_allclose(mirrored, mirror @ alpha(n, v, law, sand), **EXACT)


def twisted(beta, gamma, psi):
    """The leading face, eq. (5.14), and the direction of motion."""
    m = np.array([np.sin(beta) * np.cos(psi), np.sin(beta) * np.sin(psi), -np.cos(beta)])
    v = np.array([np.cos(gamma), 0.0, -np.sin(gamma)])
    return clear_of_level(leading(m, v)), v


@given(tilt, tilt, tilt, sands, laws_3d)
def test_plate_twist(beta, gamma, psi, sand, law):
    """Plate twist symmetry, Fig. 5-5B: F_r and F_z are even in psi, F_theta is odd, and so zero at psi = 0."""
    force = alpha(*twisted(beta, gamma, psi), law, sand)
    np.testing.assert_allclose(alpha(*twisted(beta, gamma, -psi), law, sand), force * [1, -1, 1], **EXACT)
    assert abs(alpha(*twisted(beta, gamma, 0.0), law, sand)[1]) < 1e-12


@given(tilt, tilt, sands, laws_3d)
def test_horizontal_plate(gamma, psi, sand, law):
    """Plate tilt symmetry, Fig. 5-5C: at beta = 0 F_theta vanishes, and the twist changes nothing."""
    assume(abs(np.sin(gamma)) > 1e-6)
    force = alpha(*twisted(0.0, gamma, 0.0), law, sand)
    assert abs(force[1]) < 1e-12
    v = np.array([np.cos(gamma) * np.cos(psi), np.cos(gamma) * np.sin(psi), -np.sin(gamma)])
    turned = alpha((0, 0, -np.sign(np.sin(gamma))), v, law, sand)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(force), abs=1e-12)


@given(tilt, angle, st.sampled_from((-1.0, 1.0)), sands, laws_3d)
def test_vertical_motion(beta, delta, sense, sand, law):
    """Vertical motion symmetry, Fig. 5-5D: turning the plate by delta turns (F_r, 0, F_z) by delta."""
    force = alpha(*twisted(beta, sense * np.pi / 2, 0.0), law, sand)
    assert abs(force[1]) < 1e-12
    turned = alpha(about((0, 0, 1), delta) @ twisted(beta, sense * np.pi / 2, 0.0)[0], (0, 0, -sense), law, sand)
    np.testing.assert_allclose(turned, [force[0] * np.cos(delta), force[0] * np.sin(delta), force[2]], **EXACT)


@given(directions, directions, st.sampled_from([printed.TABLE_C3, oracle.TABLE_C4]))
def test_both_sides_have_one_generic_stress(n, v, table):
    """The fit sees m = +-n, section 5.6.2: by the angles, the two sides of a plate have the same alpha_gen."""
    assume(1e-3 < abs(n[2]) < 0.999)
    assume(np.hypot(*v[:2]) > 1e-3)
    sides = oracle.generic_3d(table, np.array([n, -n]), np.array([v, v]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(*sides, rtol=0, atol=1e-10)


@pytest.mark.parametrize("law", LAWS_3D)
def test_slicing_plate_feels_both_sides(law):
    """Appendix C.5: faces along the motion feel equal tangential and opposite normal forces."""
    sides = [alpha((s, 0, 0), (0, 0, -1), law, Sand(xi_n=1.0, mu_surf=0.4)) for s in (1, -1)]
    np.testing.assert_allclose(sides[0] * [-1, 1, 1], sides[1], **EXACT)
    assert sides[0][2] > 0.0


@pytest.mark.parametrize("law", QUASI_STATIC)
def test_edge_on_tolerance(law):
    """n.v_hat down to -1e-9 counts as leading, so that rounding does not flicker; less does not."""
    sunk = [alpha(unit((1, 0, lean)), (0, 0, -1), law) for lean in (1e-10, -1e-10, 1e-8, -1e-8)]
    assert [bool(force.any()) for force in sunk] == [True, True, False, True]


@pytest.mark.parametrize("law", LAWS_3D)
def test_vertical_faces(law):
    """At beta = +-pi/2 the fit jumps by up to 0.05 xi_n (20 %): rounding of n_z must not choose the side."""
    for v in ((1, 0, 0), (1, 0.3, -0.4), (0.2, 0.1, 1)):
        for noise in (1e-17, -1e-17, 1e-13, -1e-13):
            np.testing.assert_allclose(alpha((1, 0, noise), v, law), alpha((1, 0, 0), v, law), rtol=0, atol=1e-9)


@given(directions, directions, sands, laws, st.floats(1e-6, 1e3), st.floats(0.01, 100), st.floats(0.01, 100))
def test_proportional_to_depth_area_and_strength_whatever_the_speed(n, v, sand, law, speed, depth, area):
    """Eqs. (3.1), (5.5): F = xi d A alpha(n, v_hat)."""
    n = clear_of_level(leading(n, v))
    stronger = Sand(xi_n=3.0 * depth, zeta=3.0 * depth, mu_surf=sand.mu_surf)
    result = surface_force(plate(n, area, (0, 0, -depth)), stronger, law, velocity=speed * v)
    expected = 3.0 * depth**2 * area * alpha(n, v, law, sand)
    np.testing.assert_allclose(result.force, expected, rtol=1e-12, atol=1e-12 * 3.0 * depth**2 * area)


@given(directions, directions, sands, laws_3d)
def test_friction_is_bounded(n, v, sand, law):
    """Eq. (5.6): |alpha_t| <= mu_surf |alpha_n|, and the normal part pushes inward."""
    n = leading(n, v)
    force = alpha(n, v, law, sand)
    tangential = np.linalg.norm(force - (force @ n) * n)
    assert force @ n <= 0.0
    assert tangential <= sand.mu_surf * abs(force @ n) + 1e-12


@given(directions, directions, laws)
def test_nothing_above_at_rest_or_trailing(n, v, law):
    """Leading-edge rule and Heaviside function of eq. (3.1), section 5.8 step 3."""
    n = leading(n, v)
    assert not surface_force(plate(n, centre=(0, 0, 1.0)), ONE, law, velocity=v).force.any()
    assert not surface_force(plate(n, centre=(0, 0, 1e-12)), ONE, law, velocity=v).force.any()
    assert not alpha(n, (0, 0, 0), law).any()
    if law != "rft2d" or n[0] * v[0] + n[2] * v[2] > 1e-6:
        assert not alpha(-n, v, law).any()


@pytest.mark.parametrize("law", QUASI_STATIC)
def test_superposition(law):
    """Eq. (5.2): the force on a body is the sum over its triangles, and moments are r x dF about its origin."""
    rng = np.random.default_rng(3)
    surface, turn = blob(rng), rotation(rng)
    where = {
        "position": (0.1, 0.2, -0.05),
        "rotation": turn,
        "velocity": (0.3, -0.2, -1),
        "angular_velocity": (1, 2, 3),
    }
    whole = surface_force(surface, ONE, law, **where)
    forces = whole.stress * surface.areas[:, None]
    arms = surface.centres @ turn.T
    np.testing.assert_allclose(whole.force, forces.sum(axis=0), **EXACT)
    np.testing.assert_allclose(whole.moment, np.cross(arms, forces).sum(axis=0), **EXACT)
    np.testing.assert_array_equal(whole.active, (forces != 0).any(axis=1))


@pytest.mark.parametrize("law", QUASI_STATIC)
def test_refining_flat_faces_converges_at_second_order(law):
    """Centroid depths sum exactly over a flat face in translation, so refinement changes nothing there."""
    cube = plate((1, 0.2, -2), area=0.01)
    where = {"velocity": (1, 0.3, -0.5)}
    coarse, fine = (surface_force(s, ONE, law, **where) for s in (cube, cube.refined(0.02)))
    assert cube.refined(0.02).ntri > 30
    np.testing.assert_allclose(fine.force, coarse.force, rtol=1e-12)


@pytest.mark.parametrize("law", QUASI_STATIC)
def test_nan_stays_nan(law):
    """A motion that is not a number gives a stress that is not a number, instead of none; as input it is refused."""
    bed = layout.pack_bed(ONE, get_law(law), FreeSurface(), (0.0, 1.0, 0.0))
    surface, still = layout.pack_surface(plate(unit((1, 0, -1)), centre=(0, 0, -1))), np.zeros(3)
    for place, v in (((0, 0, 0), (np.nan, 0, -1)), ((0, 0, np.nan), (1, 0, -1))):
        stress, _ = evaluate.triangle_stresses(
            bed, surface, np.array(place, float), np.eye(3), np.array(v, float), still
        )
        assert np.isnan(stress).any()
        with pytest.raises(RftsimError, match="must be finite"):
            alpha((1, 0, -1), v, law, position=place)
