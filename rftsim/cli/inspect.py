"""`rftsim inspect`: what would be modelled of a scene, and why."""

import dataclasses
from collections.abc import Callable
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table

from rftsim.cli.output import print_json
from rftsim.scenes import stage

Settings = Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction]


@dataclasses.dataclass(frozen=True)
class Inspect:
    """What would be modelled of a scene: bodies, triangles, law, sand, and why.

    Example: rftsim inspect robot.xml --sand poppy-seeds
    """

    scene: tyro.conf.Positional[str]
    """A shipped scene (grouser-wheel, half-grouser-wheel, four-flap-runner, intruder) or an MJCF file."""
    law: str | None = None
    """Instead of the scene's law."""
    sand: str | None = None
    """Instead of the scene's sand: a preset, key=value,... or a TOML file."""
    set: Settings = ()
    """Settings of a shipped scene, key=value ...; may be repeated."""
    disable_floor: bool = False
    """Take collision from planes at the sand's level."""
    allow_open: bool = False
    """Accept meshes that are not closed."""
    json: bool = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Stage the scene and print."""
        staged = stage(
            self.scene,
            sand=self.sand,
            law=self.law,
            settings=settings(self.set),
            disable_floor=self.disable_floor,
            allow_open=self.allow_open,
        )
        bed, model = staged.bed, staged.model
        bodies: dict[str, dict[str, Any]] = {
            name: {
                "feels_sand": name in bed.surfaces,
                "triangles": bed.surfaces[name].ntri if name in bed.surfaces else 0,
                "area_m2": float(bed.surfaces[name].areas.sum()) if name in bed.surfaces else 0.0,
                "wheel": name in bed.surfaces and bed.surfaces[name].wheel is not None,
                "why": why,
            }
            for name, why in bed.reasons.items()
        }
        if self.json:
            print_json(
                {
                    "scene": self.scene,
                    "law": bed.law.name,
                    "law_says": bed.law.says,
                    "sand": dataclasses.asdict(bed.sand),
                    "surface": dataclasses.asdict(bed.free_surface),
                    "timestep_s": float(model.opt.timestep),
                    "bodies": bodies,
                    "triangles": sum(surface.ntri for surface in bed.surfaces.values()),
                    "warnings": warnings(),
                }
            )
            return
        console = Console()
        console.print(f"[bold]{self.scene}[/bold]  law {bed.law.name}: {bed.law.says}", highlight=False)
        given = {k: v for k, v in dataclasses.asdict(bed.sand).items() if v not in (None, "")}
        console.print("sand  " + ", ".join(f"{k} {v:g}" if k != "source" else v for k, v in given.items()))
        table = Table("body", "triangles", "area [m^2]", "wheel", "why")
        for name, row in bodies.items():
            table.add_row(
                name, str(row["triangles"]), f"{row['area_m2']:.4g}", "yes" if row["wheel"] else "", row["why"]
            )
        console.print(table)


def settings(groups: Settings) -> dict[str, str]:
    """Settings from `key=value` words.

    Raises:
        ValueError: A word is not key=value.
    """
    found = {}
    for pair in (pair for group in groups for pair in group):
        key, separator, value = pair.partition("=")
        if not separator or not key:
            raise ValueError(f"--set takes key=value, not {pair!r}")
        found[key] = value
    return found
