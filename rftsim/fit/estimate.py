"""Coefficients of a straight law with 95 % intervals: linear least squares, and a bootstrap beside it."""

import warnings
from typing import Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError, RftsimWarning
from rftsim.surface.triangles import Array

CONFIDENCE: Final = 0.95
"""Probability with which an interval holds its coefficient."""
DRAWS: Final = 2000
"""Samples that the bootstrap draws."""
PARTS: Final = 1000
"""Most parts that the bootstrap draws from; more rows or tests are dealt into so many, which err alike."""


class Estimate(NamedTuple):
    """A coefficient of a straight law, and how far it is known."""

    value: float
    """The coefficient itself."""
    low: float
    """Lower end of the interval by Student's t: right for independent errors of one size."""
    high: float
    """Upper end of that interval."""
    boot_low: float
    """Lower end of the interval by a bootstrap of rows, or of whole tests where there are several: asks for neither."""
    boot_high: float
    """Upper end of that interval."""

    def over(self, divisor: float) -> "Estimate":
        """The estimate of a quantity that is smaller by a divisor."""
        return Estimate(*(x / divisor for x in self))


def estimate(columns: Array, y: Array, tests: Array | None = None, *, draws: int = DRAWS) -> list[Estimate]:
    """Estimates of the p coefficients c of y = columns c + error.

    Args:
        columns: What the coefficients multiply, shape (n, p).
        y: What was measured, shape (n,).
        tests: Number of the test that each row belongs to, shape (n,): rows of one test err together.
        draws: Samples that the bootstrap draws; 0 for none.

    Raises:
        RftsimError: There are too few rows that differ, or they do not tell the coefficients apart.
    """
    n, p = columns.shape
    unlike = len(np.unique(np.column_stack([columns, y]), axis=0))
    if unlike <= p:
        rows = f"{n} rows" if unlike == n else f"{n} rows, of which {unlike} differ,"
        raise RftsimError(f"{rows} are too few for {p} coefficients and their intervals: give {p + 1} or more")
    if unlike < n:
        warnings.warn(
            f"{n - unlike} of {n} rows repeat another: the intervals take them for readings of their own",
            RftsimWarning,
            stacklevel=2,
        )
    c, _, rank, _ = np.linalg.lstsq(columns, y)
    if rank < p:
        raise RftsimError(f"the rows do not tell {p} coefficients apart: vary what the force depends on")
    variance = ((y - columns @ c) ** 2).sum() / (n - p)
    from scipy.stats import t  # not before it is needed: it takes a second

    reach = t.ppf(0.5 + CONFIDENCE / 2, n - p) * np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    apart = tests is not None and len(np.unique(tests)) > 2
    boot = _bootstrap(columns, y, tests if apart and tests is not None else np.arange(n, dtype=float), draws)
    return [Estimate(*row) for row in np.stack([c, c - reach, c + reach, *boot], axis=1).tolist()]


def _bootstrap(columns: Array, y: Array, tests: Array, draws: int) -> tuple[Array, Array]:
    """Ends of the intervals of the coefficients that samples with replacement have, (p,) both."""
    rng = np.random.default_rng(0)
    names, which = np.unique(tests, return_inverse=True)
    if len(names) > PARTS:
        which = (rng.permutation(len(names)) % PARTS)[which]
    count = min(len(names), PARTS)
    squares, products = np.zeros((count, *2 * columns.shape[1:])), np.zeros((count, columns.shape[1]))
    np.add.at(squares, which, columns[:, :, None] * columns[:, None, :])
    np.add.at(products, which, columns * y[:, None])
    counts = rng.multinomial(count, np.full(count, 1.0 / count), size=draws)
    left, right = np.tensordot(counts, squares, 1), counts @ products
    regular = np.linalg.cond(left) < 1e12 if draws else np.zeros(0, bool)
    if not regular.any():
        return np.full(columns.shape[1], np.nan), np.full(columns.shape[1], np.nan)
    drawn = np.linalg.solve(left[regular], right[regular][:, :, None])[:, :, 0]
    low, high = np.quantile(drawn, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], axis=0)
    return low, high
