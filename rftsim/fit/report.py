"""The worth of a fitted table: residuals, error on plates that were held back, the source's table beside it."""

import dataclasses
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.dissipation import FINE_DEG, largest_power
from rftsim.fit.generic import SOURCE, Generic, Settings, coefficients, determined, fit, nearest
from rftsim.fit.plates import Plates, at_unit_depth, directions, leading_faces
from rftsim.law.laws import fitted_law
from rftsim.law.rigid import surface_force
from rftsim.law.tables import Term
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import EDGE_ON_DOUBLE, Array

FOLDS: Final = 10
"""Parts of the plates that are held back, one after another."""
MOST: Final = 10_000
"""Most plates that are fitted at once."""
FEW: Final = 1500
"""Number of plates, drawn at random, by which the prior's weight is chosen where there are more."""
PRIORS: Final = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Weights among which the prior is chosen [plates]."""


class Errors(NamedTuple):
    """The errors of a prediction of alpha against plates."""

    rms: tuple[float, float, float]
    """Root of the mean square of each component, over xi_n [-]."""
    relative: float
    """Root of the sum of squares, over that of alpha [-]."""


class Worst(NamedTuple):
    """A plate that is fitted badly."""

    angles: list[float]
    """Its angles beta, gamma and psi [deg]."""
    alpha: list[float]
    """The alpha that was measured, over xi_n [-]."""
    fitted: list[float]
    """The alpha of the law, over xi_n [-]."""
    error: float
    """Length of the difference, over xi_n [-]."""


@dataclasses.dataclass(frozen=True)
class Report:
    """A fitted table with its errors, all of the law as it is used: with |a_n| and the cap of eq. (5.6)."""

    generic: Generic
    """The table and its scale."""
    settings: Settings
    """The settings by which it was fitted."""
    plates: Plates
    """The plates that it was fitted to."""
    mu_surf: float
    """Friction of the plates [-]."""
    rank: int
    """Number of coefficients that the plates determine without the prior."""
    predicted: Array
    """The alpha of the law [N/m^3], shape (n, 3)."""
    predicted_held_back: Array
    """The alpha of laws fitted without the plate [N/m^3], shape (n, 3)."""
    source: Errors
    """Errors of the source's table, its scale fitted to the same plates."""
    power: float
    """Largest alpha_gen . v_hat at any angle, over xi_n [-]: where it is not positive, the law never adds energy."""

    @property
    def fitted(self) -> Errors:
        """The errors on the plates that it was fitted to."""
        return errors(self.predicted, self.plates, self.generic.xi_n)

    @property
    def held_back(self) -> Errors:
        """The errors on plates that the fit did not see."""
        return errors(self.predicted_held_back, self.plates, self.generic.xi_n)

    @property
    def edge_on(self) -> int:
        """The number of plates that move along their own faces, where the law jumps."""
        m, v = directions(self.plates.angles)
        return int((np.abs((m * v).sum(axis=1)) <= EDGE_ON_DOUBLE).sum())

    def worst(self, count: int = 5) -> list[Worst]:
        """The plates that are fitted worst, the worst first."""
        xi_n = self.generic.xi_n
        error = np.linalg.norm(self.predicted - self.plates.alpha, axis=1) / xi_n
        columns = (self.plates.angles, self.plates.alpha / xi_n, self.predicted / xi_n, error)
        return [Worst(*(column[i].tolist() for column in columns)) for i in np.argsort(-error)[:count]]

    def doubts(self) -> list[str]:
        """Sentences that say what of the fit is doubtful, with numbers."""
        found = []
        if self.rank < self.settings.unknowns:
            found.append(
                f"the plates determine {self.rank} of {self.settings.unknowns} coefficients; the others are of the "
                f"source's table, which counts as {self.settings.prior:g} plates"
            )
        elif 3 * self.plates.n < 2 * self.settings.unknowns:
            found.append(
                f"{self.plates.n} plates are few for {self.settings.unknowns} coefficients: have "
                f"{-(-2 * self.settings.unknowns // 3)} or more"
            )
        if not ((self.plates.angles[:, 0] == 0.0) & (self.plates.angles[:, 1] == 90.0)).any():
            found.append("no plate is flat and pushed straight down: xi_n is an extrapolation")
        if self.power > 0.0:
            found.append(
                f"the law can add energy: alpha_gen . v is up to {self.power:.2g} xi_n (--dissipative forbids it)"
            )
        return found


def report(plates: Plates, settings: Settings, mu_surf: float, choose_prior: bool = False) -> Report:
    """Fit a table to plates, and say what the fit is worth.

    Args:
        plates: The plates that were measured.
        settings: The settings of the fit.
        mu_surf: Friction of the plates [-], for the law's cap.
        choose_prior: Take from PRIORS the one with which held-back plates are predicted best.

    Raises:
        RftsimError: There are too many plates, or see `fit`.
    """
    if plates.n > MOST:
        raise RftsimError(f"{plates.n} plates are more than the {MOST} that are fitted at once: take means, or fewer")
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):  # thousands of small problems, whose threads would wait for each other
        return _report(plates, dataclasses.replace(settings, mu_surf=mu_surf), choose_prior)


def _report(plates: Plates, settings: Settings, choose_prior: bool) -> Report:
    rank, mu_surf = determined(plates, settings), settings.mu_surf
    if choose_prior:
        free = dataclasses.replace(settings, dissipative=False)
        tried = [dataclasses.replace(free, prior=w) for w in PRIORS if w > 0.0 or rank == settings.unknowns]
        some = plates.take(np.random.default_rng(0).permutation(plates.n)[:FEW])
        missed = [((held_back(some, one) - some.alpha) ** 2).sum() for one in tried]
        settings = dataclasses.replace(settings, prior=tried[int(np.argmin(missed))].prior)
    generic = fit(plates, settings)
    return Report(
        generic=generic,
        settings=settings,
        plates=plates,
        mu_surf=mu_surf,
        rank=rank,
        predicted=predict(generic.table, generic.xi_n, mu_surf, plates),
        predicted_held_back=held_back(plates, settings),
        source=_of_source(plates, settings),
        power=largest_power(coefficients(generic.table), settings.degree, FINE_DEG)[0],
    )


def _of_source(plates: Plates, settings: Settings) -> Errors:
    table = SOURCE[settings.degree]
    unit = predict(table, 1.0, settings.mu_surf, plates)
    xi_n = float((unit * plates.alpha).sum() / (unit**2).sum())
    return errors(xi_n * unit, plates, xi_n)


def errors(predicted: Array, plates: Plates, xi_n: float) -> Errors:
    """The errors of a predicted alpha [N/m^3], shape (n, 3), against plates."""
    off = predicted - plates.alpha
    x, y, z = (np.sqrt((off**2).mean(axis=0)) / xi_n).tolist()
    return Errors((x, y, z), float(np.sqrt((off**2).sum() / (plates.alpha**2).sum())))


def held_back(plates: Plates, settings: Settings) -> Array:
    """Stress per depth of each plate by a law fitted to the plates outside of its part [N/m^3], shape (n, 3)."""
    count = plates.n
    part = np.random.default_rng(0).permutation(count) % min(FOLDS, count)
    found = np.empty((count, 3))
    for k in range(part.max() + 1):
        generic, out = nearest(plates.take(part != k), settings), part == k
        found[out] = predict(generic.table, generic.xi_n, settings.mu_surf, plates.take(out))
    return found


def predict(table: tuple[Term, ...], xi_n: float, mu_surf: float, plates: Plates) -> Array:
    """Stress per depth of plates by the law with a table [N/m^3], shape (n, 3): that on every face that leads."""
    law, sand = fitted_law(table), Sand(xi_n=xi_n, mu_surf=min(mu_surf, 1e9))
    faces = leading_faces(plates)
    alpha = np.zeros((plates.n, 3))
    for own, where, velocity, omega in _spins(faces.motion):
        surface = at_unit_depth(faces.normal[own], where)
        stress = surface_force(surface, sand, law, velocity=velocity, angular_velocity=omega).stress
        np.add.at(alpha, faces.row[own], faces.weight[own, None] * stress)
    return alpha


def _spins(motion: Array) -> Iterator[tuple[Any, Array, Array, Array]]:
    """Rigid motions by which faces in the right places move in directions of their own, so that one call serves many.

    A spin about y moves the points of the plane z = -1 by (1, 0, -x), and one about z those with x = 0 by (-y, 0,
    -1) or (-y, 0, 1): every direction of the x-z plane but those backwards, which no plate has.

    Args:
        motion: Directions of motion, shape (k, 3).

    Yields:
        Which faces, their places beside the origin (n, 3), the velocity of the origin and the spin.
    """
    x, z = motion[:, 0], motion[:, 2]
    level = x >= np.abs(z)
    for own, side in ((level, 0.0), (~level & (z < 0.0), -1.0), (~level & (z > 0.0), 1.0)):
        if own.any():
            where = np.zeros((int(own.sum()), 3))
            where[:, 1 if side else 0] = -x[own] / np.abs(z[own]) if side else -z[own] / x[own]
            spin, velocity = ((0.0, 0.0, 1.0), (0.0, 0.0, side)) if side else ((0.0, 1.0, 0.0), (2.0, 0.0, 0.0))
            yield own, where, np.array(velocity), np.array(spin)
