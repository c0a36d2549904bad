"""`rftsim-mpm plate`: force on a plate moved through sand."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console

from rftsim_mpm.cli.report import print_json, progress
from rftsim_mpm.fields import Camera, Frame
from rftsim_mpm.output import check_writable, replacing
from rftsim_mpm.plate import Plate, PlateForce, extrapolated, finer, measure
from rftsim_mpm.simulation import Simulation


@dataclasses.dataclass(frozen=True)
class PlateCommand:
    """Push or drag a flat plate through level sand and read its force.

    Example: rftsim-mpm plate --mu-int 0.4 --extrapolate --plot plate.png
    """

    plate: tyro.conf.OmitArgPrefixes[Plate] = dataclasses.field(default_factory=Plate)
    extrapolate: bool = False
    """Also run more cells (twice, in 3D one and a half times as many), and give the limit."""
    quick: bool = False
    """Six cells, and less sand around: a look, not a measurement."""
    json: bool = False
    """Print JSON."""
    plot: Path | None = None
    """Draw force against travel and the sand, .png, .pdf or .svg."""
    record: Path | None = None
    """Write a Rerun recording, .rrd."""

    def __call__(self) -> None:
        """Run and report."""
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
        if self.record:
            check_writable(self.record, ".rrd")
        plate = self.plate.quick if self.quick else self.plate
        second = finer(plate) if self.extrapolate else None
        found, frame = self._run(plate)
        report = _report(plate, found)
        if second is not None:
            other, _ = self._run(second, picture=False)
            force = extrapolated(found, other, second.cells / plate.cells)
            report["fine"] = {"cells": second.cells, "force": other.force.tolist(), "noise": other.noise}
            report["limit"] = {"force": force.tolist(), "alpha": (force / (plate.area * plate.z)).tolist()}
        if self.plot and frame is not None:
            from rftsim_mpm.plots import plot_history  # matplotlib is an extra

            with replacing(self.plot) as temporary:
                plot_history(found.history, _title(plate), temporary, frame, _unit(plate))
        if self.json:
            print_json(report)
            return
        _print(plate, report)
        for path in (self.plot, self.record):
            if path:
                Console().print(f"wrote {path}", highlight=False)

    def _run(self, plate: Plate, *, picture: bool = True) -> tuple[PlateForce, Frame | None]:
        camera: Camera | None = None
        frame: Frame | None = None
        recorder: Any = None
        if self.record and picture:
            from rftsim_mpm.record import Recorder  # rerun is an extra

            recorder = Recorder(self.record)
        with progress(f"plate, {plate.cells:g} cells", quiet=self.json) as show:

            def watch(sim: Simulation, share: float) -> None:
                nonlocal camera, frame
                if sim.steps % 20 == 0:
                    show(share)
                if recorder is not None:
                    recorder.log(sim)
                if not (self.plot and picture):
                    return
                if camera is None and share > 0.95:
                    camera = Camera(sim)
                if camera is not None and share >= 1.0 and frame is None:
                    frame = camera.shoot(sim)

            found = measure(plate, watch)
        if recorder is not None:
            recorder.close()
        return found, frame


def _report(plate: Plate, found: PlateForce) -> dict[str, Any]:
    return {
        **dataclasses.asdict(plate),
        "young_Pa": plate.material.young,
        "force_unit": _unit(plate),
        **found.report,
        "particle_updates_per_s": found.particles * found.steps / found.seconds,
        "surface": {"place_m": found.profile[0].tolist(), "stress_Pa": found.profile[1].tolist()},
    }


def _unit(plate: Plate) -> str:
    return "N/m" if plate.dim == 2 else "N"


def _title(plate: Plate) -> str:
    angles = f"β {plate.beta:g}°, γ {plate.gamma:g}°" + (f", ψ {plate.psi:g}°" if plate.dim == 3 else "")
    return f"plate, {angles}, μ_int {plate.mu_int:g}, μ_surf {plate.mu_surf:g}, {plate.cells:g} cells"


def _print(plate: Plate, report: dict[str, Any]) -> None:
    console, unit = Console(highlight=False, soft_wrap=True), _unit(plate)
    console.print(f"[bold]{_title(plate)}[/bold], read at {1e3 * plate.z:g} mm")
    names = "xyz" if plate.dim == 3 else "xz"
    rows = [("", report["force"], report["alpha_N_m3"])]
    if "limit" in report:
        fine = np.array(report["fine"]["force"])
        rows += [
            (f"{report['fine']['cells']:g} cells: ", fine, fine / (plate.area * plate.z)),
            ("limit: ", report["limit"]["force"], report["limit"]["alpha"]),
        ]
    for label, force, alpha in rows:
        text = ", ".join(f"F{n} {f:.4g} {unit}" for n, f in zip(names, force, strict=True))
        per = ", ".join(f"α{n} {a:.4g}" for n, a in zip(names, alpha, strict=True))
        console.print(f"{label}{text}; per area and depth {per} N/m³")
    console.print(
        f"noise of 0.5 ms averages {100 * report['noise']:.1f} %; beside the plate the sand has risen "
        f"{1e3 * report['heave_m']:.1f} mm"
    )
    console.print(
        f"{report['particles']} particles, {report['steps']} steps, {report['seconds']:.1f} s, "
        f"{1e-6 * report['particle_updates_per_s']:.1f} M particle-updates/s"
    )
