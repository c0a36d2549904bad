"""The command `rftsim-mpm push`: force on a solid pushed through deep sand."""

from pathlib import Path
from typing import Any, NamedTuple

from rftsim_mpm.cli.study import StudyCommand, with_last_frame
from rftsim_mpm.fields import Frame
from rftsim_mpm.push import Push, PushForce, measure
from rftsim_mpm.simulation import Watch


class PushFound(NamedTuple):
    """The force on a solid, and the sand at the end."""

    force: PushForce
    """The measurement on the solid."""
    frame: Frame
    """The sand at the end."""


class PushCommand(StudyCommand[Push, PushFound]):
    """Push a solid through deep sand and read its force and moment.

    Example: rftsim-mpm push --shape cube-60-45 --theta 30 --plot push.png
    """

    title = "push"

    def _quicker(self) -> Push:
        return self.study.quick

    def _run(self, study: Push, watch: Watch) -> PushFound:
        shoot, frames = with_last_frame(watch)
        return PushFound(measure(study, shoot), frames[0])

    def _report(self, study: Push, found: PushFound) -> dict[str, Any]:
        return found.force.report

    def _lines(self, study: Push, found: PushFound) -> list[str]:
        names, felt = "xyz", found.force
        return [
            ", ".join(f"F{n} {f:.4g} N" for n, f in zip(names, felt.force, strict=True)),
            ", ".join(f"M{n} {m:.4g} N m" for n, m in zip(names, felt.moment, strict=True)) + " about the centroid",
            f"noise of 0.5 ms averages {100 * felt.noise:.1f} %",
        ]

    def _draw(self, study: Push, found: PushFound, path: Path) -> None:
        from rftsim_mpm.plots import plot_history

        plot_history(found.force.history, f"{study.shape}, θ {study.theta:g}°", path, found.frame, "N")
