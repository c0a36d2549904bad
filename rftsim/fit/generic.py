"""The generic response of 3D-RFT fitted to plates: f1, f2, f3 as polynomials, by least squares.

alpha_gen = f1 m + f2 v - f3 z, [Agarwal] eq. (5.9), is linear in the polynomials' coefficients, and isotropic whatever
they are. What is fitted is the law that is made of it, with |a_n| and the cap by mu_surf. The scale is told from the
coefficients by the flat plate pushed straight down: there alpha_z = 0.87574 xi_n, as Table C.3 has it, so that xi_n
compares with Table C.1, and zeta = 0.87574 xi_n holds for every table.
"""

import dataclasses
import itertools
import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.dissipation import dissipative
from rftsim.fit.plates import Faces, Plates, leading_faces
from rftsim.fit.polynomials import terms
from rftsim.law.tables import TABLE_C3, TABLE_C4, Term, columns, monomials
from rftsim.sand.medium import ALPHA_Z_PLATE
from rftsim.surface.triangles import EDGE_ON_DOUBLE, Array

SOURCE: Final = {3: TABLE_C3, 4: TABLE_C4}
"""The source's tables by degree."""
_ROUNDS: Final = 12
_CONSTRAINED_ROUNDS: Final = 4
_SETTLED: Final = 1e-3


@dataclasses.dataclass(frozen=True)
class Settings:
    """The settings by which a table is fitted to plates."""

    degree: int = 3
    """Degree of the polynomials: 3 (20 terms each) or 4 (35)."""
    prior: float = 0.0
    """As how many plates over its reference grid the source's table of this degree counts, to scale."""
    dissipative: bool = False
    """Whether alpha_gen . v <= 0 is held at every orientation and motion, see `dissipation`."""
    mu_surf: float = math.inf
    """Friction of the plates [-], for the law's cap."""

    @property
    def unknowns(self) -> int:
        """Number of the coefficients of f1, f2 and f3 together."""
        return 3 * len(SOURCE[self.degree])


class Generic(NamedTuple):
    """A fitted table of the generic response, and its scale."""

    table: tuple[Term, ...]
    """The coefficients of f1, f2 and f3 by monomial, over xi_n [-]."""
    xi_n: float
    """Strength of the sand under this table [N/m^3]."""
    condition: float
    """Condition number of the least-squares problem, prior included."""


def design(normal: Array, motion: Array, degree: int) -> Array:
    """The matrix from coefficients (f1's, f2's, f3's) to alpha_gen on faces, shape (k, 3, 3 terms).

    Args:
        normal: Outward normals of the faces, shape (k, 3).
        motion: Directions of their motion, shape (k, 3).
        degree: Degree of the polynomials.
    """
    m = np.where(normal[:, 2:] < -EDGE_ON_DOUBLE, normal, -normal)
    x = np.stack([-motion[:, 2], -m[:, 2], (m * motion).sum(axis=1)], axis=1)
    t = terms(x, degree)
    down = np.broadcast_to([0.0, 0.0, -1.0], m.shape)
    return np.concatenate([vector[:, :, None] * t[:, None, :] for vector in (m, motion, down)], axis=2)


def on_plates(faces: Faces, count: int, degree: int) -> Array:
    """The matrix from coefficients to alpha on plates, shape (3 count, 3 terms).

    On the two sides of a plate that moves edge-on the law's normal stresses cancel; what is left of them here is the
    tangential part.
    """
    rows = design(faces.normal, faces.motion, degree)
    cancel = faces.edge_on
    n = faces.normal[cancel]
    rows[cancel] -= n[:, :, None] * np.einsum("ki,kij->kj", n, rows[cancel])[:, None, :]
    return _by_plate(faces, faces.weight[:, None, None] * rows, count).reshape(3 * count, -1)


def _by_plate(faces: Faces, values: Array, count: int) -> Array:
    """Sums of values on faces, (k, ...), over each plate, (count, ...)."""
    order = np.argsort(faces.row, kind="stable")
    starts = np.searchsorted(faces.row[order], np.arange(count))
    found: Array = np.add.reduceat(values[order], starts, axis=0)
    return found


@lru_cache(maxsize=1)
def reference_grid() -> Plates:
    """The source's plates, [Agarwal] section 5.7: 13 x 13 x 7 angles in steps of 15 degrees; without forces."""
    angles = np.array([*itertools.product(range(-90, 91, 15), range(-90, 91, 15), range(0, 91, 15))], dtype=float)
    return Plates(angles, np.zeros_like(angles), np.zeros(len(angles)), np.ones(len(angles)))


def coefficients(table: tuple[Term, ...]) -> Array:
    """The coefficients of a table in one column: f1's, f2's, f3's, shape (3 terms,)."""
    return np.concatenate(columns(table))


def fit(plates: Plates, settings: Settings) -> Generic:
    """The table and scale that are nearest to plates in the sum of squares of alpha.

    Raises:
        RftsimError: The plates do not determine the table, and there is no prior; or they resist nothing.
    """
    rank = determined(plates, settings)
    if rank < settings.unknowns and not settings.prior > 0.0:
        raise RftsimError(
            f"{plates.n} plates determine {rank} of {settings.unknowns} coefficients of degree {settings.degree}; "
            f"measure at least {-(-settings.unknowns // 3)} at different beta, gamma and psi (in plane, psi = 0, one "
            "counts for two thirds), or pass --prior 10, which takes the source's table for 10 plates"
        )
    return nearest(plates, settings)


def determined(plates: Plates, settings: Settings) -> int:
    """The number of coefficients that plates determine without a prior."""
    a = on_plates(leading_faces(plates), plates.n, settings.degree)
    return int(np.linalg.matrix_rank(a, tol=1e-9 * np.linalg.norm(a, 2)))


def nearest(plates: Plates, settings: Settings) -> Generic:
    """The table and scale of `fit`, and where the plates leave coefficients open, the smallest.

    Raises:
        RftsimError: The plates feel no force, or by their fit none that has a scale.
    """
    a = on_plates(leading_faces(plates), plates.n, settings.degree)
    unit = float(np.sqrt((plates.alpha**2).sum(axis=1).mean()))
    if not unit > 0.0:
        raise RftsimError("the plates feel no force")
    theta = _solve(plates._replace(alpha=plates.alpha / unit), settings)
    down = np.array([[0.0, 0.0, -1.0]])
    flat = float(design(down, down, settings.degree)[0, 2] @ theta)
    if not flat > 0.0:
        raise RftsimError(
            "by the fit a flat plate is not pushed back, so that there is no scale xi_n: measure that plate, too "
            "(beta 0, gamma 90), and check the signs of alpha"
        )
    f = (theta * ALPHA_Z_PLATE / flat).reshape(3, -1).T.tolist()
    table = tuple((powers, (p, q, r)) for powers, (p, q, r) in zip(monomials(settings.degree), f, strict=True))
    return Generic(table, unit * flat / ALPHA_Z_PLATE, float(np.linalg.cond(_with_prior(a, settings))))


def _solve(plates: Plates, settings: Settings) -> Array:
    """Coefficients, (3 terms,): of the linear problem, then by Gauss-Newton steps of the law itself.

    The law is not linear: it has |a_n| and the cap of eq. (5.6). A step counts where it brings the law nearer to the
    plates, and is damped where it does not.
    """
    faces, measured = leading_faces(plates), plates.alpha.ravel()
    rows = design(faces.normal, faces.motion, settings.degree)

    def law(theta: Array) -> tuple[float, tuple[Array, Array]]:
        """The cost, and the linear problem for the next step."""
        own = theta[: settings.unknowns]
        stress, slope = law_and_slope(faces, rows, own, settings)
        alpha = _by_plate(faces, stress, plates.n).ravel()
        slope = _by_plate(faces, slope, plates.n).reshape(len(alpha), -1)
        return _cost(alpha, theta, measured, settings), (slope, measured - alpha + slope @ own)

    free = dataclasses.replace(settings, dissipative=False)
    theta = _least((on_plates(faces, plates.n, settings.degree), measured), free, None, 0.0)
    damping = 1e-3
    for step in (free, settings) if settings.dissipative else (free,):
        if step.dissipative:
            theta = _least(law(theta)[1], step, theta, damping)
        cost, linear = law(theta)
        for _ in range(_CONSTRAINED_ROUNDS if step.dissipative else _ROUNDS):
            trial = _least(linear, step, theta, damping)
            reached, there = law(trial)
            settled = abs(cost - reached) <= _SETTLED * cost
            if reached < cost:
                theta, cost, linear, damping = trial, reached, there, max(0.2 * damping, 1e-9)
            else:
                damping *= 10.0
            if settled or damping > 1e3:
                break
    return theta[: settings.unknowns]


def _least(problem: tuple[Array, Array], settings: Settings, near: Array | None, damping: float) -> Array:
    """The x nearest to rows x = rhs under prior (whose scale is its last) and constraint, damped towards `near`."""
    rows, rhs = problem
    a = _with_prior(rows, settings)
    b = np.append(rhs, np.zeros(len(a) - len(rhs)))
    if near is not None:
        a, b = np.vstack([a, np.sqrt(damping) * np.eye(len(near))]), np.append(b, np.sqrt(damping) * near)
    x = np.asarray(np.linalg.lstsq(a, b, rcond=1e-12)[0], dtype=float)
    return dissipative(a, b, x, settings.degree) if settings.dissipative else x


def _cost(alpha: Array, theta: Array, measured: Array, settings: Settings) -> float:
    away = _with_prior(np.zeros((0, settings.unknowns)), settings) @ theta
    return float(((alpha - measured) ** 2).sum() + (away**2).sum())


def law_and_slope(faces: Faces, rows: Array, theta: Array, settings: Settings) -> tuple[Array, Array]:
    """The law on faces, at xi_n = 1, and its derivative by the coefficients, [Agarwal] eqs. (5.5) and (5.6).

    Args:
        faces: The faces that lead.
        rows: Their `design`, shape (k, 3, 3 terms).
        theta: Coefficients, shape (3 terms,).
        settings: Settings of the fit, for mu_surf.

    Returns:
        Stress per depth times weight, shape (k, 3), and its derivative, shape (k, 3, 3 terms).
    """
    n = faces.normal
    a = rows @ theta
    rows_n, a_n = np.einsum("ki,kij->kj", n, rows), (n * a).sum(axis=1)
    rows_t, a_t = rows - n[:, :, None] * rows_n[:, None, :], a - a_n[:, None] * n
    size, most = np.linalg.norm(a_t, axis=1), settings.mu_surf * np.abs(a_n)
    capped, sign = size > most, np.where(a_n > 0.0, 1.0, -1.0)
    hat = a_t[capped] / size[capped, None]
    turned = rows_t[capped] - hat[:, :, None] * np.einsum("ki,kij->kj", hat, rows_t[capped])[:, None, :]
    grown = (settings.mu_surf * sign[capped])[:, None, None] * hat[:, :, None] * rows_n[capped, None, :]
    rows_t[capped] = (most / np.where(capped, size, 1.0))[capped, None, None] * turned + grown
    a_t[capped] = most[capped, None] * hat
    stress = faces.weight[:, None] * (a_t - np.abs(a_n)[:, None] * n)
    slope = faces.weight[:, None, None] * (rows_t - (sign[:, None] * n)[:, :, None] * rows_n[:, None, :])
    return stress, slope


def _with_prior(rows: Array, settings: Settings) -> Array:
    """Rows of a problem and, with a prior, those that ask for the source's table times a scale, the last unknown."""
    if not settings.prior > 0.0:
        return rows
    weight = np.sqrt(settings.prior / reference_grid().n)
    return np.vstack([np.column_stack([rows, np.zeros(len(rows))]), weight * _of_source(settings.degree)])


@lru_cache(maxsize=2)
def _of_source(degree: int) -> Array:
    """The matrix from coefficients and a scale to how far a table is from the source's over its grid, made square."""
    grid = reference_grid()
    rows = on_plates(leading_faces(grid), grid.n, degree)
    return np.asarray(np.linalg.qr(np.column_stack([rows, -rows @ coefficients(SOURCE[degree])]))[1])
