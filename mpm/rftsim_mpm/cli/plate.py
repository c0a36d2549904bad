"""The command `rftsim-mpm plate`: force on a plate moved through sand."""

import dataclasses
from pathlib import Path
from typing import Any, NamedTuple

from rftsim_mpm.cli.options import Flag
from rftsim_mpm.cli.study import StudyCommand, with_last_frame
from rftsim_mpm.fields import Frame
from rftsim_mpm.plate import Array, Plate, PlateForce, extrapolated, finer, measure
from rftsim_mpm.simulation import Watch


class PlateFound(NamedTuple):
    """The force on a plate, the sand at the end, and the force with finer cells if it was asked for."""

    force: PlateForce
    """The measurement on the plate as it was asked for."""
    frame: Frame
    """The sand at the end."""
    fine: PlateForce | None
    """The measurement with finer cells, or None."""


@dataclasses.dataclass(frozen=True)
class PlateCommand(StudyCommand[Plate, PlateFound]):
    """Push or drag a flat plate through level sand and read its force.

    Example: rftsim-mpm plate --mu-int 0.4 --extrapolate --plot plate.png
    """

    title = "plate"
    extrapolate: Flag = False
    """Run more cells, too, and give the limit."""

    def _quicker(self) -> Plate:
        return self.study.quick

    def _run(self, study: Plate, watch: Watch) -> PlateFound:
        second = finer(study) if self.extrapolate else None
        first = 1.0 if second is None else 1.0 / (1.0 + (second.cells / study.cells) ** (study.dim + 1))
        shoot, frames = with_last_frame(lambda sim, share: watch(sim, first * share))
        force = measure(study, shoot)
        fine = None
        if second is not None:
            fine = measure(second, lambda sim, share: watch(sim, first + (1.0 - first) * share))
        return PlateFound(force, frames[0], fine)

    def _report(self, study: Plate, found: PlateFound) -> dict[str, Any]:
        places, stresses = found.force.profile
        report = {
            "young_Pa": study.material.young,
            "force_unit": _unit(study),
            **found.force.report,
            "particle_updates_per_s": _rate(found.force),
            "surface": {"place_m": places.tolist(), "stress_Pa": stresses.tolist()},
        }
        if found.fine is not None:
            limit, cells = _limit(study, found.force, found.fine), finer(study).cells
            report["fine"] = {"cells": cells, "force": found.fine.force.tolist(), "noise": found.fine.noise}
            report["limit"] = {"force": limit.tolist(), "alpha": (limit / (study.area * study.z)).tolist()}
        return report

    def _lines(self, study: Plate, found: PlateFound) -> list[str]:
        force, rows = found.force, [("", found.force.force)]
        if found.fine is not None:
            rows.append((f"{finer(study).cells:g} cells: ", found.fine.force))
            rows.append(("limit: ", _limit(study, force, found.fine)))
        return [
            f"[bold]{_title(study)}[/bold], read at {1e3 * study.z:g} mm",
            *(label + _components(study, value) for label, value in rows),
            f"noise of 0.5 ms averages {100 * force.noise:.1f} %; beside the plate the sand has risen "
            f"{1e3 * force.heave:.1f} mm",
            f"{force.particles} particles, {force.steps} steps, {force.seconds:.1f} s, "
            f"{1e-6 * _rate(force):.1f} M particle-updates/s",
        ]

    def _draw(self, study: Plate, found: PlateFound, path: Path) -> None:
        from rftsim_mpm.plots import plot_history

        plot_history(found.force.history, _title(study), path, found.frame, _unit(study))


def _limit(plate: Plate, coarse: PlateForce, fine: PlateForce) -> Array:
    return extrapolated(coarse, fine, finer(plate).cells / plate.cells)


def _rate(found: PlateForce) -> float:
    return found.particles * found.steps / found.seconds


def _unit(plate: Plate) -> str:
    return "N/m" if plate.dim == 2 else "N"


def _title(plate: Plate) -> str:
    angles = f"β {plate.beta:g}°, γ {plate.gamma:g}°" + (f", ψ {plate.psi:g}°" if plate.dim == 3 else "")
    return f"plate, {angles}, μ_int {plate.mu_int:g}, μ_surf {plate.mu_surf:g}, {plate.cells:g} cells"


def _components(plate: Plate, force: Array) -> str:
    names = "xyz" if plate.dim == 3 else "xz"
    forces = ", ".join(f"F{n} {f:.4g} {_unit(plate)}" for n, f in zip(names, force, strict=True))
    alphas = force / (plate.area * plate.z)
    return (
        f"{forces}; per area and depth "
        + ", ".join(f"α{n} {a:.4g}" for n, a in zip(names, alphas, strict=True))
        + " N/m³"
    )
