"""Sums over episodes: return, length, and the mean of everything in `info`."""

from typing import Final

import numpy as np

from rftsim_envs.episodes import Outcome
from rftsim_envs.physics import Array, Flags

LAST: Final = ("cost_of_transport", "diverged", "reached")
"""Names of what counts with its value at the episode's end, not with its mean."""


class Tally:
    """Sums over the episodes of n simulations, from the start of each."""

    def __init__(self, n: int) -> None:
        self._sums: dict[str, Array] = {}
        self._return, self._length = np.zeros(n), np.zeros(n, dtype=int)

    @property
    def names(self) -> list[str]:
        """Names of what is counted beside return and length."""
        return list(self._sums)

    def add(self, outcome: Outcome, counted: "Flags | None" = None) -> None:
        """Count a control step, of some simulations only if `counted` says so."""
        share = np.ones(len(self._return), dtype=bool) if counted is None else counted
        self._return += outcome.reward * share
        self._length += share
        for name, values in outcome.info.items():
            sums = self._sums.setdefault(name, np.zeros(len(share)))
            np.copyto(sums, values if name in LAST else sums + values.astype(float), where=share)

    def so_far(self, i: int) -> float:
        """Return of simulation i since its episode's start [-]."""
        return float(self._return[i])

    def take(self, i: int) -> dict[str, float]:
        """Give what simulation i's episode came to, and let its next one start from nothing.

        `r` return, `l` control steps, `reward/...` each term's share of the return, and means over the episode (of
        `LAST`, the last value).
        """
        length = max(int(self._length[i]), 1)
        found: dict[str, float] = {"r": float(self._return[i]), "l": int(self._length[i])}
        for name, sums in self._sums.items():
            found[name] = float(sums[i]) / (1 if name in LAST or name.startswith("reward/") else length)
            sums[i] = 0.0
        self._return[i], self._length[i] = 0.0, 0
        return found
