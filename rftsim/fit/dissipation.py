"""Tables that never add energy: least squares under alpha_gen . v <= 0 at every orientation and motion.

The law's power is v . alpha = -|a_n| n.v + s a_t.v with n.v >= 0 and 0 <= s <= 1, [Agarwal] eqs. (5.5), (5.6). It is
linear in s, so it is largest at s = 0, where it is not positive, or at s = 1, where it is at most
a_n n.v + a_t.v = alpha_gen . v. What is constrained is therefore alpha_gen . v = x3 f1 + f2 + x1 f3, linear in the
coefficients, and it bounds the law at every mu_surf.
"""

import itertools
import math
from functools import lru_cache
from typing import Final

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.polynomials import terms
from rftsim.surface.triangles import Array

GRID_DEG: Final = 5.0
"""Step of the grid of angles on which the constraint is looked at [deg]; between its points, maxima are followed."""
FINE_DEG: Final = 3.0
"""Step of the grid from which the last maxima are followed [deg]."""
MARGIN: Final = 1e-5
"""By how much alpha_gen . v stays below zero, in units of the plates' mean alpha [-]."""
_ROUNDS: Final = 50
_CUTS: Final = 50
_STARTS: Final = 200
_CLOSE: Final = 0.1
_RANGE: Final = ((0.0, math.pi / 2), (-math.pi / 2, math.pi / 2), (0.0, math.pi))
"""Ranges of beta, gamma and psi [rad]: every orientation of a face and motion."""


def power_rows(angles: Array, degree: int) -> Array:
    """The matrix from coefficients to alpha_gen . v at angles, shape (k, 3 terms).

    Args:
        angles: beta, gamma and psi [rad], shape (k, 3).
        degree: Degree of the polynomials.
    """
    x = _projections(angles)
    t = terms(x, degree)
    return np.concatenate([x[:, 2:] * t, t, x[:, :1] * t], axis=1)


def _projections(angles: Array) -> Array:
    """x1, x2, x3 of [Agarwal] eq. (5.17), (k, 3)."""
    beta, gamma, psi = angles.T
    x1, x2 = np.sin(gamma), np.cos(beta)
    return np.stack([x1, x2, np.cos(psi) * np.cos(gamma) * np.sin(beta) + x1 * x2], axis=1)


@lru_cache(maxsize=2)
def _on_grid(step_deg: float, degree: int) -> tuple[Array, Array, Array]:
    """A grid of every orientation and motion: angles [rad], (k, 3), their power rows, and which are close, (k,)."""
    axes = [np.linspace(low, high, 1 + round((high - low) / step_deg)) for low, high in np.degrees(_RANGE)]
    grid = np.radians(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    cells = (_projections(grid) / _CLOSE).round() @ np.array([1.0, 1e3, 1e6])
    return grid, power_rows(grid, degree), cells


def largest_power(theta: Array, degree: int, step_deg: float) -> tuple[float, Array]:
    """The largest power, alpha_gen.v, at any orientation and motion, and where its maxima are [rad], shape (k, 3).

    From the best points of a grid, no two of them close in (x1, x2, x3), it goes uphill by ever smaller steps.

    Args:
        theta: Coefficients of f1, f2 and f3, shape (3 terms,).
        degree: Degree of the polynomials.
        step_deg: Step of the grid of angles [deg].
    """
    grid, rows, cells = _on_grid(step_deg, degree)
    order = np.argsort(-(rows @ theta))
    best = np.sort(np.unique(cells[order], return_index=True)[1])[:_STARTS]
    places = grid[order[best]]
    aside = np.array([*itertools.product((-1.0, 0.0, 1.0), repeat=3)])
    for k in range(30):
        around = np.clip(places[:, None] + math.radians(step_deg) * 0.65**k * aside, *np.transpose(_RANGE))
        found = (power_rows(around.reshape(-1, 3), degree) @ theta).reshape(len(places), -1)
        places = around[np.arange(len(places)), found.argmax(axis=1)]
    return float((power_rows(places, degree) @ theta).max()), places


def dissipative(a: Array, rhs: Array, start: Array, degree: int) -> Array:
    """The least-squares solution of a x = rhs for which alpha_gen . v <= 0, by cutting planes, shape (nunknown,).

    Unknowns behind the table's coefficients are free. Constraints are added where they are broken, on a grid and at the
    maxima between its points, until none is.

    Args:
        a: Matrix of the problem, shape (nrow, nunknown).
        rhs: Right-hand side, shape (nrow,).
        start: Solution without constraints, shape (nunknown,).
        degree: Degree of the polynomials.

    Raises:
        RftsimError: The constraints could not all be met.
    """
    _, rows, _ = _on_grid(GRID_DEG, degree)
    size = rows.shape[1]
    factor: Array = np.linalg.qr(np.column_stack([a, rhs]))[1]
    r, q = factor[:-1, :-1], factor[:-1, -1]
    cuts, x = np.empty((0, size)), start
    for _ in range(_ROUNDS):
        broken = _broken(rows, x[:size], degree)
        if not len(broken):
            return x
        cuts = np.vstack([cuts, broken])
        x = _least(r, q, np.column_stack([cuts, np.zeros((len(cuts), len(x) - size))]))
        cuts = cuts[cuts @ x[:size] > -100 * MARGIN]  # those that bind, or nearly
    raise RftsimError(f"no table of degree {degree} that never adds energy was found in {_ROUNDS} rounds")


def _broken(rows: Array, theta: Array, degree: int) -> Array:
    """Power rows that coefficients break, on the grid or else at the maxima between its points, (k, 3 terms)."""
    power = rows @ theta
    worst = np.argsort(-power)[:_CUTS]
    broken: Array = rows[worst[power[worst] > -0.5 * MARGIN]]
    if len(broken):
        return broken
    for step in (GRID_DEG, FINE_DEG):
        best, places = largest_power(theta, degree, step)
        if best > -0.5 * MARGIN:
            return power_rows(places, degree)
    return broken


def _least(r: Array, q: Array, cuts: Array) -> Array:
    """The x of least |r x - q| under cuts x <= -MARGIN: least distance programming, Lawson and Hanson ch. 23."""
    from scipy.linalg import solve_triangular  # not before it is needed: it takes a second
    from scipy.optimize import nnls

    turned = -solve_triangular(r, cuts.T, trans="T").T
    bound = MARGIN - turned @ q
    e = np.vstack([turned.T, bound])
    target = np.zeros(len(e))
    target[-1] = 1.0
    u, _ = nnls(e, target)
    rest = e @ u - target
    solution: Array = solve_triangular(r, q - rest[:-1] / rest[-1])
    return solution
