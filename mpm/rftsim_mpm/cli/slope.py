"""The command `rftsim-mpm slope`: force on a plate moved through a slope, over that on level ground."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rftsim_mpm.cli.study import StudyCommand, with_last_frame
from rftsim_mpm.fields import Frame
from rftsim_mpm.plate import PlateForce
from rftsim_mpm.simulation import Watch
from rftsim_mpm.slope import Slope, measure


class SlopeFound(NamedTuple):
    """The force on a plate in a slope, that on level ground, and the slope's sand at the end."""

    force: PlateForce
    """The measurement on the slope."""
    level: PlateForce
    """The measurement on level ground, the plate lying and moving to the surface as on the slope."""
    frame: Frame
    """The slope's sand at the end."""

    def ratio(self, study: Slope) -> float:
        """Resistance to the motion on the slope over that on level ground [-]."""
        return float((self.force.force @ study.direction) / (self.level.force @ study.direction))


class SlopeCommand(StudyCommand[Slope, SlopeFound]):
    """Move a flat plate through a slope, and through level sand, and read the forces.

    Example: rftsim-mpm slope --slope -20 --beta 90 --gamma 0
    """

    title = "slope"

    def _quicker(self) -> Slope:
        return self.study.quick

    def _run(self, study: Slope, watch: Watch) -> SlopeFound:
        shoot, frames = with_last_frame(lambda sim, share: watch(sim, 0.5 * share))
        force = measure(study, shoot)
        level = measure(study.as_to_surface, lambda sim, share: watch(sim, 0.5 + 0.5 * share))
        return SlopeFound(force, level, frames[0])

    def _report(self, study: Slope, found: SlopeFound) -> dict[str, Any]:
        return {
            **found.force.report,
            "level": {"force": found.level.force.tolist(), "noise": found.level.noise},
            "resistance_over_level": found.ratio(study),
        }

    def _lines(self, study: Slope, found: SlopeFound) -> list[str]:
        return [
            f"[bold]{_title(study)}[/bold], read at {1e3 * study.z:g} mm along the normal",
            *(f"{where}: {_components(one.force)}; noise of 0.5 ms averages {100 * one.noise:.1f} %"
              for where, one in (("on the slope", found.force), ("on level ground", found.level))),
            f"resistance on the slope over that on level ground {found.ratio(study):.3f}",
        ]  # fmt: skip

    def _draw(self, study: Slope, found: SlopeFound, path: Path) -> None:
        from rftsim_mpm.plots import plot_history

        plot_history(found.force.history, _title(study), path, found.frame, "N/m" if study.dim == 2 else "N")


def _title(study: Slope) -> str:
    return f"slope of {study.slope:g}°, plate, β {study.beta:g}°, γ {study.gamma:g}°, μ_int {study.mu_int:g}"


def _components(force: np.ndarray) -> str:
    names = "along", "aside", "normal"
    return ", ".join(f"{name} {f:.4g}" for name, f in zip(names if force.size == 3 else names[::2], force, strict=True))
