"""From data to law: what was put into data comes out of a fit, and a fit says what it is worth."""

import dataclasses

import numpy as np
import pytest
from shapes import about, alpha, unit

from rftsim.errors import RftsimError
from rftsim.fit.dissipation import MARGIN, dissipative, largest_power, power_rows
from rftsim.fit.estimate import estimate
from rftsim.fit.generic import Settings, coefficients, design, fit, law_and_slope, on_plates, reference_grid
from rftsim.fit.plates import Plates, directions, leading_faces
from rftsim.fit.report import predict, report
from rftsim.law.laws import fitted_law
from rftsim.law.tables import TABLE_C3, TABLE_C4
from rftsim.sand.medium import ALPHA_Z_PLATE

ROUGH = 1e9
XI_N = 0.92e6


def measured(table, plates, mu_surf=ROUGH):
    """The plates with the stress that the law with a table has on them."""
    return plates._replace(alpha=predict(table, XI_N, mu_surf, plates))


def where_linear(table, plates):
    """The plates on which the law is alpha_gen: it pushes on the leading face, so that |a_n| = -a_n."""
    degree = 3 if table is TABLE_C3 else 4
    linear = (on_plates(leading_faces(plates), plates.n, degree) @ coefficients(table)).reshape(-1, 3)
    return plates.take(np.abs(measured(table, plates).alpha - XI_N * linear).max(axis=1) < 1e-9 * XI_N)


@pytest.fixture(scope="module")
def grid():
    """A fifth of the source's plates, (237, ...), without thickness."""
    return reference_grid().take(slice(None, None, 5))


@pytest.mark.parametrize(("degree", "table"), [(3, TABLE_C3), (4, TABLE_C4)])
def test_the_sources_tables_are_recovered(grid, degree, table):
    """Stresses of the compiled law with Table C.3 (C.4) on plates give back its coefficients and xi_n to 1e-10."""
    plates = measured(table, where_linear(table, grid))
    assert plates.n > 150
    generic = fit(plates, Settings(degree))
    down = design(np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, -1.0]]), degree)[0, 2] @ coefficients(table)
    np.testing.assert_allclose(coefficients(generic.table) * down / ALPHA_Z_PLATE, coefficients(table), atol=1e-10)
    assert generic.xi_n == pytest.approx(XI_N * down / ALPHA_Z_PLATE, rel=1e-10)
    assert report(plates, Settings(degree), ROUGH).held_back.relative < 1e-10


def test_flat_plate_is_the_scale(grid):
    """Whatever the data, the fitted law has alpha_z = 0.87574 xi_n on the flat plate, as `Sand.zeta` supposes."""
    noise = np.random.default_rng(1).normal(size=(grid.n, 3))
    plates = measured(TABLE_C4, grid)
    generic = fit(plates._replace(alpha=plates.alpha + 0.1 * XI_N * noise), Settings())
    assert alpha((0, 0, -1), (0, 0, -1), fitted_law(generic.table))[2] == pytest.approx(ALPHA_Z_PLATE, rel=1e-12)


def test_a_fit_to_noise_has_the_symmetries(grid):
    """Fig. 5-5: isotropic by construction, so that even a fit to noise turns and mirrors with its plates."""
    rng = np.random.default_rng(2)
    noise = grid._replace(
        alpha=rng.normal(size=(grid.n, 3)) - [0, 0, np.sign(-directions(grid.angles)[1])[:, 2].mean()]
    )
    noise.alpha[(grid.angles[:, 0] == 0) & (grid.angles[:, 1] == 90)] = 0.0, 0.0, 50.0
    law = fitted_law(fit(noise, Settings()).table)
    for _ in range(20):
        n, v = unit(rng.normal(size=3)), unit(rng.normal(size=3))
        n = n if n @ v > 0 else -n
        turn, mirror = about((0, 0, 1), rng.uniform(0, 6)), np.diag([1.0, -1.0, 1.0])
        force = alpha(n, v, law)
        for r in (turn, mirror):
            np.testing.assert_allclose(alpha(r @ n, r @ v, law), r @ force, rtol=0, atol=1e-12 * np.abs(force).max())


@pytest.mark.parametrize("thick", [0.0, 0.2])
def test_a_plates_force_is_that_of_its_faces(thick):
    """A box of 1 x 1 x t slices down at depth 1: two sides, two ends, and a lower edge half a length deeper."""
    knife = Plates(np.array([[90.0, 90.0, 0.0]]), np.zeros((1, 3)), np.array([thick]), np.ones(1))
    side, below = alpha((1, 0, 0), (0, 0, -1)), alpha((0, 0, -1), (0, 0, -1))
    ends = 2 * thick * alpha((0, 1, 0), (0, 0, -1))[2]
    felt = predict(TABLE_C3, 1.0, ROUGH, knife)[0]
    np.testing.assert_allclose(felt, [0.0, 0.0, 2 * side[2] + thick * 1.5 * below[2] + ends], atol=1e-12)


def test_held_back_error_is_that_of_the_noise(grid):
    """With noise of sigma per component and p coefficients from n plates, the fit's rms is sigma sqrt(1 - p / 3n), and
    the held-back one, from 9/10 of the plates, sigma sqrt(1 + p / 2.7n), each to 10 %."""
    plates = measured(TABLE_C3, where_linear(TABLE_C3, grid.take(~on_edge(grid))))
    sigma, n = 0.01, plates.n
    noise = np.random.default_rng(3).normal(scale=sigma * XI_N, size=(n, 3))
    found = report(plates._replace(alpha=plates.alpha + noise), Settings(), ROUGH)
    assert np.sqrt(np.mean(np.square(found.fitted.rms))) == pytest.approx(sigma * np.sqrt(1 - 60 / (3 * n)), rel=0.1)
    assert np.sqrt(np.mean(np.square(found.held_back.rms))) == pytest.approx(
        sigma * np.sqrt(1 + 60 / (2.7 * n)), rel=0.1
    )
    scale = np.sqrt((plates.alpha**2).sum(axis=1).mean() / 3) / XI_N
    assert found.held_back.relative == pytest.approx(np.sqrt(np.mean(np.square(found.held_back.rms))) / scale, rel=0.02)


def on_edge(plates):
    m, v = directions(plates.angles)
    return np.abs((m * v).sum(axis=1)) < 1e-9


# Dissipation ----------------------------------------------------------------------------------------------------------


def test_power_rows_are_alpha_gen_times_v():
    """alpha_gen . v = x3 f1 + f2 + x1 f3, with alpha_gen = f1 m + f2 v - f3 z."""
    angles = np.random.default_rng(4).uniform([0, -90, 0], [90, 90, 180], size=(50, 3))
    m, v = directions(angles)
    for degree, table in ((3, TABLE_C3), (4, TABLE_C4)):
        generic = np.einsum("kij,j->ki", design(m, v, degree), coefficients(table))
        power = power_rows(np.radians(angles), degree) @ coefficients(table)
        np.testing.assert_allclose(power, (generic * v).sum(axis=1), atol=1e-12)


def test_largest_power_of_the_sources_tables():
    """Table C.3 breaks alpha . v <= 0 by 0.0054 xi_n, Table C.4 stays 0.058 below."""
    assert largest_power(coefficients(TABLE_C3), 3, 5.0)[0] == pytest.approx(0.0054, abs=5e-5)
    assert largest_power(coefficients(TABLE_C4), 4, 5.0)[0] == pytest.approx(-0.058, abs=5e-4)


@pytest.mark.parametrize("degree", [3, 4])
def test_a_dissipative_fit_never_adds_energy(grid, degree):
    """Data that add energy (rising plates pushed on) give a law that does; under the constraint, one that never does:
    alpha_gen . v <= 0 on a grid of 1 degree, whatever mu_surf, and the compiled law's own power too."""
    plates = measured(TABLE_C3, grid.take(~on_edge(grid)))
    v = directions(plates.angles)[1]
    helped = plates._replace(alpha=plates.alpha + 0.1 * XI_N * v * (v[:, 2:] > 0.3))
    free, held = (fit(helped, Settings(degree, dissipative=one)) for one in (False, True))
    assert largest_power(coefficients(free.table), degree, 3.0)[0] > 0.03
    assert -10 * MARGIN < largest_power(coefficients(held.table), degree, 3.0)[0] <= 0.0
    for psi in range(0, 181, 15):
        fine = np.radians([(b, g, psi) for b in range(91) for g in range(-90, 91)])
        assert (power_rows(fine, degree) @ coefficients(held.table)).max() <= 0.0
    angles = np.random.default_rng(5).uniform([-90, -90, 0], [90, 90, 180], size=(500, 3))
    some = Plates(angles, np.zeros((500, 3)), np.zeros(500), np.ones(500))
    for mu_surf in (0.0, 0.2, 0.6, ROUGH):
        force = predict(held.table, 1.0, mu_surf, some)
        assert (force * directions(angles)[1]).sum(axis=1).max() <= 0.0


def test_the_constrained_solution_is_the_best_one(grid):
    """The feasible set is convex, so the gradient of the squares points away from every other feasible table."""
    plates = measured(TABLE_C3, grid.take(~on_edge(grid)))
    v = directions(plates.angles)[1]
    rhs = (plates.alpha / XI_N + 0.1 * v * (v[:, 2:] > 0.3)).ravel()
    a = on_plates(leading_faces(plates), plates.n, 3)
    theta = dissipative(a, rhs, np.linalg.lstsq(a, rhs)[0], 3)
    uphill = a.T @ (a @ theta - rhs)
    rng = np.random.default_rng(6)
    others = [0 * theta]
    for _ in range(3):
        other = rhs + 0.05 * rng.normal(size=len(rhs))
        others.append(dissipative(a, other, theta, 3))
    for other in others:
        assert uphill @ (other - theta) >= -1e-4 * np.linalg.norm(uphill) * np.linalg.norm(other - theta)


@pytest.mark.parametrize("thick", [0.0, 0.2])
@pytest.mark.parametrize("mu_surf", [0.2, 0.4, np.inf])
def test_the_law_that_is_fitted_is_the_compiled_one(grid, thick, mu_surf):
    """Stress of eqs. (5.5), (5.6) as the fit sees it against the compiled law's; its derivative against differences."""
    grid = grid._replace(thickness=np.full(grid.n, thick))
    faces, settings, theta = leading_faces(grid), Settings(mu_surf=mu_surf), coefficients(TABLE_C3)
    rows = design(faces.normal, faces.motion, 3)
    stress, slope = law_and_slope(faces, rows, theta, settings)
    alpha = np.zeros((grid.n, 3))
    np.add.at(alpha, faces.row, stress)
    np.testing.assert_allclose(alpha, predict(TABLE_C3, 1.0, mu_surf, grid), rtol=0, atol=1e-13)
    aside = 1e-7 * np.random.default_rng(10).normal(size=60)
    more, less = (law_and_slope(faces, rows, theta + s * aside, settings)[0] for s in (0.5, -0.5))
    np.testing.assert_allclose(more - less, slope @ aside, rtol=0, atol=1e-13)


def test_capped_data_are_fitted_as_capped(grid):
    """A law whose friction mu_surf caps is fitted to 1 % where that is known, and otherwise to no better than 4 %."""
    plates = measured(TABLE_C3, where_linear(TABLE_C3, grid), 0.3)
    known, ignored = report(plates, Settings(), 0.3), report(plates, Settings(), ROUGH)
    assert known.fitted.relative < 0.01
    assert ignored.fitted.relative > 0.04


# Few data -------------------------------------------------------------------------------------------------------------


def test_too_few_plates_are_refused_without_a_prior(grid):
    """Plates in plane leave the twist open; the message says how many coefficients are determined, and what helps."""
    flat = grid.take(grid.angles[:, 2] == 0.0)
    with pytest.raises(RftsimError, match=r"determine \d+ of 60 coefficients.*at least 20.*--prior"):
        fit(measured(TABLE_C3, flat), Settings())


def test_a_prior_fills_in_what_plates_leave_open(grid):
    """The source's law, twice as strong, comes out of one plate; a heavy prior leaves nothing but the scale."""
    flat = Plates(np.array([[0.0, 90.0, 0.0]]), np.array([[0.0, 0.0, 2 * ALPHA_Z_PLATE]]), np.zeros(1), np.ones(1))
    generic = fit(flat, Settings(prior=1.0))
    assert generic.xi_n == pytest.approx(2.0, rel=1e-9)
    np.testing.assert_allclose(coefficients(generic.table), coefficients(TABLE_C3), atol=1e-9)
    heavy = fit(measured(TABLE_C4, grid), Settings(prior=1e8))
    np.testing.assert_allclose(coefficients(heavy.table), coefficients(TABLE_C3), atol=1e-4)


def test_the_prior_is_chosen_by_held_back_plates(grid):
    """A noisy few plates of Table C.3 are predicted best with much of it; many of a law far from it with little."""
    rng = np.random.default_rng(7)
    few = measured(TABLE_C3, where_linear(TABLE_C3, grid)).take(slice(None, None, 4))
    noisy = few._replace(alpha=few.alpha + 0.1 * XI_N * rng.normal(size=(few.n, 3)))
    assert report(noisy, Settings(), ROUGH, choose_prior=True).settings.prior >= 30.0
    other = measured(TABLE_C3, where_linear(TABLE_C3, grid))
    bent = dataclasses.replace(Settings(), degree=4)
    assert report(other, bent, ROUGH, choose_prior=True).settings.prior <= 1.0


# Trials ---------------------------------------------------------------------------------------------------------------

DEPTHS, SPEEDS, L, RHO = (0.02, 0.03, 0.04), (0.04, 0.16, 0.32, 0.48, 0.64), 0.016, 900.0


def drag_columns():
    """[Agarwal] section 4.6: F = 580 z + 1.1 rho_c L v^2 per metre of plate; columns z and rho_c L v^2."""
    z, v = (x.ravel() for x in np.meshgrid(DEPTHS, SPEEDS, indexing="ij"))
    return np.stack([z, RHO * L * v**2], axis=1)


def test_the_sources_drag_is_recovered():
    """K = 580 N/m^2 and lambda = 1.1 of plate drag: 11.6, 17.4, 23.2 N/m, and 6.5 more at 0.64 m/s."""
    columns = drag_columns()
    force = columns @ [580.0, 1.1]
    assert (columns @ [580.0, 0.0])[:: len(SPEEDS)] == pytest.approx([11.6, 17.4, 23.2])
    assert force[len(SPEEDS) - 1] - 11.6 == pytest.approx(6.5, abs=0.05)
    strength, lambda_ = estimate(columns, force)
    assert (strength.value, lambda_.value) == pytest.approx((580.0, 1.1), rel=1e-12)


def test_intervals_cover_as_often_as_they_say():
    """Over 400 draws of noise (1 N), 95 +- 3 % of lambda's and K's intervals hold the truth."""
    columns, rng = drag_columns(), np.random.default_rng(8)
    hits = np.zeros(2)
    for _ in range(400):
        force = columns @ [580.0, 1.1] + rng.normal(size=len(columns))
        found = estimate(columns, force, draws=0)
        hits += [one.low <= truth <= one.high for one, truth in zip(found, (580.0, 1.1), strict=True)]
    assert np.abs(hits / 400 - 0.95).max() <= 0.03


def test_the_bootstrap_of_whole_tests_covers_where_rows_of_a_test_err_together():
    """Twenty pushes whose strengths differ by 20 %: Student's interval, for independent rows, holds the mean strength
    much too seldom; the bootstrap of whole pushes about as often as it says, over 200 draws."""
    rng, depth, push = (
        np.random.default_rng(9),
        np.tile(np.linspace(0.01, 0.05, 20), 20),
        np.repeat(np.arange(20.0), 20),
    )
    hits = np.zeros(2)
    for _ in range(200):
        strength = 1.0 + 0.2 * rng.normal(size=20)
        (found,) = estimate(depth[:, None], depth * np.repeat(strength, 20), push, draws=500)
        hits += found.low <= 1.0 <= found.high, found.boot_low <= 1.0 <= found.boot_high
    assert hits[0] / 200 < 0.5
    assert 0.86 <= hits[1] / 200 <= 0.98
