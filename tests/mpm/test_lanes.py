"""Fours of compiled code against NumPy's rows."""

import numpy as np
import pytest
from numba import njit
from rftsim_mpm.lanes import four, lane, load, store


@njit
def weigh(rows, weights, first):
    """Four of each row, from a column on: times a weight, plus (0, 1, 2, 3); returns the last of their sum."""
    total = four(0.0, 0.0, 0.0, 0.0)
    for i in range(rows.shape[0]):
        new = weights[i] * load(rows, i, first) + four(0.0, 1.0, 2.0, 3.0)
        store(rows, i, first, new)
        total += new
    return lane(total, 3)


@pytest.mark.parametrize("first", [0, 3, 4])
def test_fours_are_rows_added_and_multiplied(first):
    """Wherever in a row they begin, and what lies beside them stays."""
    rng = np.random.default_rng(0)
    rows, weights = rng.normal(size=(5, 8)), rng.normal(size=5)
    expected = rows.copy()
    expected[:, first : first + 4] = weights[:, None] * rows[:, first : first + 4] + np.arange(4.0)
    last = weigh(rows, weights, first)
    np.testing.assert_allclose(rows, expected, rtol=1e-15)
    assert last == pytest.approx(expected[:, first + 3].sum(), rel=1e-14)
