"""Forces read from a run: averages over half a millisecond, a straight line through a window, and what is left over."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError

Array = NDArray[np.float64]

AVERAGE = 0.5e-3
"""Length of the averages [s]."""
FEWEST = 5
"""Fewest averages that a force is read from."""
MOST_POINTS = 100
"""Points of a history that files keep, at the most."""


class History(NamedTuple):
    """Averages of one body's force over AVERAGE, along its way."""

    travel: Array
    """Distance moved, (n,) [m]."""
    depth: Array
    """Depth of the point that the study reads at, (n,) [m]."""
    force: Array
    """Force of the sand on the body, (n, dim) [N, in the plane N/m]."""
    moment: Array
    """Moment about the body's origin, (n, 1 or 3) [N m, in the plane N]."""

    @property
    def series(self) -> dict[str, Any]:
        """Travel [m] and force as files keep them, thinned."""
        return thinned(travel_m=self.travel, history=self.force)


def thinned(**columns: Array) -> dict[str, Any]:
    """Return at most MOST_POINTS rows of each column, evenly chosen, to five digits."""
    count = len(next(iter(columns.values())))
    some = np.linspace(0, count - 1, min(MOST_POINTS, count)).astype(int)
    return {name: np.vectorize(lambda x: float(f"{x:.5g}"))(column[some]).tolist() for name, column in columns.items()}


def averaged(**columns: Array) -> dict[str, Any]:
    """Return at most MOST_POINTS means over neighbouring rows of each column, to five digits."""
    count = len(next(iter(columns.values())))
    edges = np.linspace(0, count, min(MOST_POINTS, count) + 1).astype(int)[:-1]
    sizes = np.diff(edges, append=count)
    return thinned(**{name: (np.add.reduceat(rows, edges).T / sizes).T for name, rows in columns.items()})


class Reading(NamedTuple):
    """Force on a body at one place on its way."""

    force: Array
    """Value of the line there, (dim,) [N, in the plane N/m]."""
    noise: float
    """Standard deviation of the averages about the line, relative to the force [-]."""


class Log:
    """Collects forces step by step and averages them."""

    def __init__(self) -> None:
        self._rows: list[Array] = []
        self._pending: list[Array] = []
        self._until = AVERAGE

    def add(self, time: float, travel: float, depth: float, force: Array, moment: Array) -> None:
        """Take the force and moment of one step, at a time [s], travel [m] and depth [m]."""
        self._pending.append(np.concatenate([[travel, depth], force, moment]))
        if time >= self._until:
            self._rows.append(np.mean(self._pending, axis=0))
            self._pending.clear()
            self._until = time + AVERAGE

    def history(self, dim: int) -> History:
        """Return the averages so far, without the one that is not complete."""
        rows = np.array(self._rows).reshape(len(self._rows), -1)
        return History(rows[:, 0], rows[:, 1], rows[:, 2 : 2 + dim], rows[:, 2 + dim :])


def read(history: History, travel: float, window: float) -> Reading:
    """Return the force at a travel [m], by a straight line through the averages within `window` [m]."""
    near = np.abs(history.travel - travel) <= window
    if near.sum() < FEWEST:
        raise MpmError(
            f"only {near.sum()} averages of {AVERAGE * 1e3:g} ms lie within {window:g} m of {travel:g} m: go slower"
        )
    basis = np.column_stack([np.ones(near.sum()), history.travel[near] - travel])
    line, *_ = np.linalg.lstsq(basis, history.force[near], rcond=None)
    rest = history.force[near] - basis @ line
    size = float(np.linalg.norm(line[0]))
    return Reading(line[0], float(np.linalg.norm(rest.std(axis=0))) / size if size else 0.0)


def limit(coarse: Array, fine: Array, ratio: float) -> Array:
    """Return the limit of vanishing cells, from two resolutions that differ by `ratio`, by an error of first order."""
    return fine + (fine - coarse) / (ratio - 1.0)
