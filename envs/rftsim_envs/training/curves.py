"""Learning curves: the return of several runs over the steps that they were trained, and its spread over the seeds."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rftsim_envs.physics import Array
from rftsim_envs.training.folder import Folder, read_progress


class Curve(NamedTuple):
    """The runs of one setting, which differ in their seed, as far as all of them are trained."""

    name: str
    """The settings that set these runs apart, `KEY=VALUE,...`; empty where nothing is varied."""
    steps: Array
    """Control steps after each update, (k,)."""
    returns: Array
    """Mean return of the last episodes before each update's end, nan where none has ended yet, (nrun, k)."""
    seconds: Array
    """Time that each run has taken [s], (nrun,)."""

    @property
    def last(self) -> Array:
        """Return of each run at the end, (nrun,)."""
        found: Array = self.returns[:, -1]
        return found


def read_curves(out: Path, names: Iterable[str]) -> list[Curve]:
    """Read the curves of runs that have begun, a curve for each group of runs that differ in their seed alone.

    Args:
        out: The folder of all of them.
        names: Their folders in it, `KEY=VALUE,.../seed-N` or `seed-N`.
    """
    groups: dict[str, list[list[dict[str, str]]]] = {}
    for name in names:
        path = Folder(out / name).progress
        rows = read_progress(path) if path.is_file() else []
        if rows:
            groups.setdefault(name.rpartition("/")[0], []).append(rows)
    return [_curve(name, runs) for name, runs in groups.items()]


def _curve(name: str, runs: list[list[dict[str, str]]]) -> Curve:
    shared = min(map(len, runs))
    returns = [[float(row["return"] or "nan") for row in rows[:shared]] for rows in runs]
    return Curve(
        name,
        np.array([float(row["steps"]) for row in runs[0][:shared]]),
        np.array(returns),
        np.array([float(rows[-1]["seconds"]) for rows in runs]),
    )
