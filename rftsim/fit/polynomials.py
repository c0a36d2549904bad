"""The monomials of which f1, f2 and f3 are made."""

import numpy as np

from rftsim.law.tables import monomials
from rftsim.surface.triangles import Array


def terms(x: Array, degree: int) -> Array:
    """Monomials of x1, x2 and x3 in the order of Table C.3 or C.4, shape (k, terms).

    Args:
        x: The projections x1, x2 and x3 of [Agarwal] eq. (5.17), shape (k, 3).
        degree: Highest degree of a monomial, 3 or 4.
    """
    powers = np.ones((degree + 1, *x.shape))
    for n in range(degree):
        powers[n + 1] = powers[n] * x
    i, j, k = np.array(monomials(degree)).T
    found: Array = (powers[i, :, 0] * powers[j, :, 1] * powers[k, :, 2]).T
    return found
