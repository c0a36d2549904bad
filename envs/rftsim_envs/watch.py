"""A task's simulation as a Rerun recording: what `rftsim.record` shows, and what the task measures and rewards."""

import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from rftsim.view.record import Recorder
from rftsim_envs.episodes import Episodes

GROUPS: Final = {"speed": "motion", "command": "motion", "slip": "slip", "power": "power"}
"""Measures with a plot of their own; the others share `measures`, and each reward's term is in `reward`."""


class Watch:
    """A recorder of one simulation, which closes as a context.

    Args:
        episodes: Episodes of an environment: `env.episodes`.
        path: The file to write, `*.rrd`.
        i: Number of the simulation.
        fps: Frames per second of simulated time; by default one per control step.

    Raises:
        RftsimError: The path cannot be written.
    """

    def __init__(self, episodes: Episodes, path: "str | Path", i: int = 0, fps: float | None = None) -> None:
        self._physics, self._i = episodes.physics, i
        rate = 1.0 / episodes.task.config.period if fps is None else fps
        self.recorder = Recorder(self._physics.shown, path, application_id=type(episodes.task).__name__, fps=rate)

    def log(self, info: Mapping[str, Any]) -> None:
        """Record the moment after a control step.

        Args:
            info: Info of the step: `info` of one environment or of a vector one, or `Outcome.info`.
        """
        self.recorder.log(self._physics.snapshot(self._i), scalars(info, self._i))

    def close(self) -> None:
        """Write the rest of the recording to its file."""
        self.recorder.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        self.close()


def scalars(info: Mapping[str, Any], i: int = 0) -> dict[str, float]:
    """The numbers in `info` of simulation i, by their path in the recording."""
    found = {}
    for name, value in info.items():
        values = np.atleast_1d(value)
        if not name.startswith("_") and values.dtype.kind in "fiub":
            path = name if "/" in name else f"{GROUPS.get(name, 'measures')}/{name}"
            found[path] = float(values[i if values.size > 1 else 0])
    return found
