"""The generic response of 3D-RFT fitted to plates: f1, f2, f3 as polynomials, by linear least squares.

alpha = xi_n (f1 m + f2 v - f3 z), [Agarwal] eq. (5.9), is linear in the polynomials' coefficients, and isotropic
whatever they are. The scale is told from them by the flat plate pushed straight down: there alpha_z = 0.87574 xi_n, as
Table C.3 has it, so that xi_n compares with Table C.1, and zeta = 0.87574 xi_n holds for every table.
"""

import dataclasses
import itertools
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.dissipation import dissipative
from rftsim.fit.plates import Counted, Faces, Plates, leading_faces
from rftsim.fit.polynomials import terms
from rftsim.sand import ALPHA_Z_PLATE
from rftsim.surface import EDGE_ON_DOUBLE, Array
from rftsim.tables import TABLE_C3, TABLE_C4, Term, columns, monomials

SOURCE: Final = {3: TABLE_C3, 4: TABLE_C4}
"""The source's tables by degree."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """How a table is fitted.

    Attributes:
        degree: Of the polynomials: 3 (20 terms each) or 4 (35).
        prior: As how many plates over its reference grid the source's table of this degree counts, to scale.
        dissipative: Hold alpha_gen . v <= 0 at every orientation and motion, see `dissipation`.
        counted: Which faces of a plate carry its force, see `plates.Counted`.
    """

    degree: int = 3
    prior: float = 0.0
    dissipative: bool = False
    counted: Counted = "plate"

    @property
    def unknowns(self) -> int:
        """Coefficients of f1, f2 and f3."""
        return 3 * len(SOURCE[self.degree])


class Generic(NamedTuple):
    """A fitted table and its scale."""

    table: tuple[Term, ...]
    xi_n: float
    """[N/m^3]."""
    condition: float
    """Of the least-squares problem, prior included."""


def design(normal: Array, motion: Array, degree: int) -> Array:
    """The matrix from coefficients (f1's, f2's, f3's) to alpha_gen on faces, (k, 3, 3 terms)."""
    m = np.where(normal[:, 2:] <= EDGE_ON_DOUBLE, normal, -normal)
    x = np.stack([-motion[:, 2], -m[:, 2], (m * motion).sum(axis=1)], axis=1)
    t = terms(x, degree)
    down = np.broadcast_to([0.0, 0.0, -1.0], m.shape)
    return np.concatenate([vector[:, :, None] * t[:, None, :] for vector in (m, motion, down)], axis=2)


def on_plates(faces: Faces, count: int, degree: int) -> Array:
    """The matrix from coefficients to alpha on plates, (3 count, 3 terms).

    On the two sides of a plate that moves edge-on the law's normal stresses cancel; what is left of them here is the
    tangential part.
    """
    rows = design(faces.normal, faces.motion, degree)
    cancel = faces.edge_on & faces.paired
    n = faces.normal[cancel]
    rows[cancel] -= n[:, :, None] * np.einsum("ki,kij->kj", n, rows[cancel])[:, None, :]
    found = np.zeros((count, *rows.shape[1:]))
    np.add.at(found, faces.row, faces.weight[:, None, None] * rows)
    return found.reshape(3 * count, -1)


def reference_grid() -> Plates:
    """The source's plates, [Agarwal] section 5.7: 13 x 13 x 7 angles in steps of 15 degrees; without forces."""
    angles = np.array([*itertools.product(range(-90, 91, 15), range(-90, 91, 15), range(0, 91, 15))], dtype=float)
    return Plates(angles, np.zeros_like(angles), np.zeros(len(angles)), np.ones(len(angles)))


def coefficients(table: tuple[Term, ...]) -> Array:
    """A table as one column: f1's, f2's, f3's, (3 terms,)."""
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
    """How many coefficients plates determine without a prior."""
    a = on_plates(leading_faces(plates, settings.counted), plates.n, settings.degree)
    return int(np.linalg.matrix_rank(a, tol=1e-9 * np.linalg.norm(a, 2)))


def nearest(plates: Plates, settings: Settings) -> Generic:
    """As `fit`; where the plates leave coefficients open, the smallest.

    Raises:
        RftsimError: The plates feel no force, or by their fit none that has a scale.
    """
    a = on_plates(leading_faces(plates, settings.counted), plates.n, settings.degree)
    unit = float(np.sqrt((plates.alpha**2).sum(axis=1).mean()))
    if not unit > 0.0:
        raise RftsimError("the plates feel no force")
    rhs = plates.alpha.ravel() / unit
    if settings.prior > 0.0:
        a, rhs = _with_prior(a, rhs, settings)
    theta = np.asarray(np.linalg.lstsq(a, rhs, rcond=1e-12)[0], dtype=float)
    if settings.dissipative:
        theta = dissipative(a, rhs, theta, settings.degree)
    theta = theta[: settings.unknowns]
    down = np.array([[0.0, 0.0, -1.0]])
    flat = float(design(down, down, settings.degree)[0, 2] @ theta)
    if not flat > 0.0:
        raise RftsimError(
            "by the fit a flat plate is not pushed back, so that there is no scale xi_n: measure that plate, too "
            "(beta 0, gamma 90), and check the signs of alpha"
        )
    f = (theta * ALPHA_Z_PLATE / flat).reshape(3, -1).T.tolist()
    table = tuple((powers, (p, q, r)) for powers, (p, q, r) in zip(monomials(settings.degree), f, strict=True))
    return Generic(table, unit * flat / ALPHA_Z_PLATE, float(np.linalg.cond(a)))


def _with_prior(a: Array, rhs: Array, settings: Settings) -> tuple[Array, Array]:
    """The problem with rows that ask for the source's table over its grid, times a scale, the last unknown."""
    rows = _of_source(settings.degree)
    weight = np.sqrt(settings.prior / (len(rows) / 3))
    return np.vstack([np.column_stack([a, np.zeros(len(a))]), weight * rows]), np.append(rhs, np.zeros(len(rows)))


@lru_cache(maxsize=2)
def _of_source(degree: int) -> Array:
    """The matrix from coefficients and a scale to what a table has more than the source's, over its grid."""
    grid = reference_grid()
    rows = on_plates(leading_faces(grid), grid.n, degree)
    return np.column_stack([rows, -rows @ coefficients(SOURCE[degree])])
