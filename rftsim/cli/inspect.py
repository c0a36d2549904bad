"""`rftsim inspect`: the parts of a scene that would be modelled, and why."""

import dataclasses
from collections.abc import Callable
from typing import Any

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rftsim.cli.output import print_json, print_line
from rftsim.cli.settings import Settings, read_settings
from rftsim.errors import RftsimError
from rftsim.model.add_sand import Bed
from rftsim.model.geometry import Meshes
from rftsim.run.advice import advise
from rftsim.run.scenes import Staged, stage


@dataclasses.dataclass(frozen=True)
class Inspect:
    """Show how a scene would be modelled: bodies, triangles, law, sand, and why; and how much of it the scene needs.

    Example: rftsim inspect robot.xml --sand poppy-seeds --tolerance 0.01
    """

    scene: tyro.conf.Positional[str]
    """A shipped scene (grouser-wheel, half-grouser-wheel, four-flap-runner, intruder) or an MJCF file."""
    law: str | None = None
    """Law to take instead of the scene's."""
    sand: str | None = None
    """Sand to take instead of the scene's: a preset, key=value,... or a TOML file."""
    set: Settings = ()
    """Settings of a shipped scene, key=value ...; may be repeated."""
    tolerance: float = 0.01
    """Largest error of a body's wrench, from which follows how many elements it needs."""
    speed: float | None = None
    """Speed that decides on the law [m/s]; by default that of the fastest body at the start."""
    keep_floor: bool = False
    """Leave the floor as it is; by default the sand takes its place."""
    meshes: Meshes | None = None
    """How the meshes of model files are felt: as hulls by which MuJoCo collides with them, or as they are."""
    json: bool = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Stage the scene, whole and reduced, and print how it is modelled."""
        if self.speed is not None and not self.speed >= 0.0:
            raise RftsimError(f"the speed must be zero or more, not {self.speed:g} m/s")
        whole, lean = self._stage(0.0), self._stage(self.tolerance)
        bed = whole.bed
        advice = advise(lean.model, lean.bed, self.speed)
        bodies = {name: _body(bed, lean.bed, name) for name in bed.reasons}
        if self.json:
            print_json(
                {
                    "scene": self.scene,
                    "law": bed.law.name,
                    "law_says": bed.law.says,
                    "sand": dataclasses.asdict(bed.sand),
                    "surface": dataclasses.asdict(bed.terrain),
                    "timestep_s": float(whole.model.opt.timestep),
                    "bodies": bodies,
                    "triangles": sum(surface.ntri for surface in bed.surfaces.values()),
                    "tolerance": self.tolerance,
                    "elements": sum(surface.ntri for surface in lean.bed.surfaces.values()),
                    "advice": [one._asdict() for one in advice],
                    "warnings": warnings(),
                }
            )
            return
        console = Console()
        console.print(f"[bold]{self.scene}[/bold]  law {bed.law.name}: {bed.law.says}", highlight=False)
        given = {k: v for k, v in dataclasses.asdict(bed.sand).items() if v not in (None, "")}
        console.print("sand  " + ", ".join(f"{k} {v:g}" if k != "source" else v for k, v in given.items()))
        console.print(_table(bodies, self.tolerance))
        for name, row in bodies.items():
            print_line(console, f"{name}: {row['why']}")
        for one in advice:
            change = "keep" if one.law == bed.law.name else f"--law {one.law}, not"
            print_line(console, f"law: {change} {bed.law.name}: {one.reason}")

    def _stage(self, tolerance: float) -> Staged:
        return stage(
            self.scene,
            sand=self.sand,
            law=self.law,
            settings=read_settings(self.set),
            tolerance=tolerance,
            keep_floor=self.keep_floor,
            meshes=self.meshes,
        )


def _body(whole: Bed, lean: Bed, name: str) -> dict[str, Any]:
    surface = whole.surfaces.get(name)
    economy = lean.economies.get(name)
    return {
        "feels_sand": surface is not None,
        "triangles": surface.ntri if surface else 0,
        "area_m2": float(surface.areas.sum()) if surface else 0.0,
        "wheel": surface is not None and surface.wheel is not None,
        "needed": lean.surfaces[name].ntri if name in lean.surfaces else 0,
        "error": economy.error if economy else None,
        "error_held_back": economy.held_back if economy else None,
        "why": lean.reasons[name],
    }


def _table(bodies: dict[str, dict[str, Any]], tolerance: float) -> Table:
    table = Table("body", caption=f"needed: what --tolerance {tolerance:g} models; errors of its wrench in %")
    for heading in ("triangles", "needed", "error", "held back", "area [m²]"):
        table.add_column(escape(heading), justify="right")
    table.add_column("wheel")
    for name, row in bodies.items():
        errors = [f"{100 * row[key]:.2f}" if row[key] is not None else "" for key in ("error", "error_held_back")]
        counts = str(row["triangles"]), str(row["needed"])
        table.add_row(name, *counts, *errors, f"{row['area_m2']:.4g}", "yes" if row["wheel"] else "")
    return table
