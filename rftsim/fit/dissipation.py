"""Tables that never add energy: least squares under alpha_gen . v <= 0 at every orientation and motion.

The law's power is v . alpha = -|a_n| n.v + s a_t.v with n.v >= 0 and 0 <= s <= 1, [Agarwal] eqs. (5.5), (5.6). It is
linear in s, so it is largest at s = 0, where it is not positive, or at s = 1, where it is at most
a_n n.v + a_t.v = alpha_gen . v. What is constrained is therefore alpha_gen . v = x3 f1 + f2 + x1 f3, linear in the
coefficients, and it bounds the law at every mu_surf.
"""

from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize, nnls

from rftsim.errors import RftsimError
from rftsim.surface import Array
from rftsim.tables import monomials

GRID_DEG: Final = 5.0
"""Step of the grid of angles on which the constraint is looked at [deg]; between its points, maxima are followed."""
MARGIN: Final = 1e-6
"""By how much alpha_gen . v stays below zero, in units of the plates' mean alpha [-]."""
_ROUNDS: Final = 50
_WORST: Final = 30


def power_rows(angles: Array, degree: int) -> Array:
    """The matrix from coefficients to alpha_gen . v at (beta, gamma, psi) [rad], (k, 3) to (k, 3 terms)."""
    beta, gamma, psi = angles.T
    x1, x2 = np.sin(gamma), np.cos(beta)
    x3 = np.cos(psi) * np.cos(gamma) * np.sin(beta) + x1 * x2
    terms = np.prod(np.stack([x1, x2, x3], axis=1)[:, None, :] ** np.array(monomials(degree)), axis=2)
    return np.concatenate([x3[:, None] * terms, terms, x1[:, None] * terms], axis=1)


def angle_grid(step_deg: float) -> Array:
    """Every orientation and motion, (k, 3) [rad]: beta 0 to 90, gamma -90 to 90, psi 0 to 180 degrees."""
    axes = [np.linspace(low, high, 1 + round((high - low) / step_deg)) for low, high in ((0, 90), (-90, 90), (0, 180))]
    return np.radians(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))


def largest_power(theta: Array, degree: int, step_deg: float) -> tuple[float, Array]:
    """Largest alpha_gen . v, its maxima followed from the worst points of a grid; where they are, (k, 3) [rad]."""
    grid = angle_grid(step_deg)
    power = power_rows(grid, degree) @ theta
    best, places = float(power.max()), []
    for start in grid[np.argsort(-power)[: _WORST * 20 : 20]]:
        found = minimize(
            lambda x: -float(power_rows(x[None], degree)[0] @ theta),
            start,
            bounds=[(0.0, np.pi / 2), (-np.pi / 2, np.pi / 2), (0.0, np.pi)],
            method="L-BFGS-B",
        )
        best = max(best, -float(found.fun))
        places.append(found.x)
    return best, np.array(places)


def dissipative(a: Array, rhs: Array, start: Array, degree: int) -> Array:
    """The least-squares solution of a x = rhs for which alpha_gen . v <= 0, by cutting planes.

    Unknowns behind the table's coefficients are free. Constraints are added where they are broken, on a grid and at the
    maxima between its points, until none is.

    Raises:
        RftsimError: The constraints could not all be met.
    """
    grid = angle_grid(GRID_DEG)
    rows = power_rows(grid, degree)
    size = rows.shape[1]
    factor: Array = np.linalg.qr(np.column_stack([a, rhs]))[1]
    r, q = factor[:-1, :-1], factor[:-1, -1]
    cuts, x = np.empty((0, size)), start
    for _ in range(_ROUNDS):
        power = rows @ x[:size]
        worst = np.argsort(-power)[:_WORST]
        broken = rows[worst[power[worst] > -0.5 * MARGIN]]
        if not len(broken):
            best, places = largest_power(x[:size], degree, GRID_DEG)
            if best <= -0.5 * MARGIN:
                return x
            broken = power_rows(places, degree)
        cuts = np.vstack([cuts, broken])
        x = _least(r, q, np.column_stack([cuts, np.zeros((len(cuts), len(x) - size))]))
        cuts = cuts[cuts @ x[:size] > -100 * MARGIN]  # those that bind, or nearly
    raise RftsimError(f"no table of degree {degree} that never adds energy was found in {_ROUNDS} rounds")


def _least(r: Array, q: Array, cuts: Array) -> Array:
    """The x of least |r x - q| under cuts x <= -MARGIN: least distance programming, Lawson and Hanson ch. 23."""
    turned = -solve_triangular(r, cuts.T, trans="T").T
    bound = MARGIN - turned @ q
    e = np.vstack([turned.T, bound])
    target = np.zeros(len(e))
    target[-1] = 1.0
    u, _ = nnls(e, target)
    rest = e @ u - target
    solution: Array = solve_triangular(r, q - rest[:-1] / rest[-1])
    return solution
