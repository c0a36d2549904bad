"""`rftsim inspect`: the parts of a scene that would be modelled, and why."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rftsim.cli.options import Flag, Number
from rftsim.cli.output import print_json, print_line
from rftsim.cli.scene import Scene, surface_report
from rftsim.errors import RftsimError
from rftsim.model.add_sand import REDUCTION, Bed
from rftsim.model.poses import posed
from rftsim.model.readout import instances
from rftsim.model.standing import Tree, standing
from rftsim.run.advice import Advice, advise
from rftsim.run.scenes import Staged


@dataclasses.dataclass(frozen=True)
class Inspect(Scene):
    """Show how a scene would be modelled: bodies, triangles, law, sand, and why; and how much of it the scene needs.

    Example: rftsim inspect robot.xml --sand poppy-seeds --reduction 0.01
    """

    reduction: Number = None
    """Error of a body's wrench, at most; by default 0.01."""
    speed: Number = None
    """Speed that decides on the law [m/s]; by default that of the fastest body at the start."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Stage the scene, whole and reduced, and print how it is modelled."""
        if self.speed is not None and not self.speed >= 0.0:
            raise RftsimError(f"the speed must be zero or more, not {self.speed:g} m/s")
        reduction = REDUCTION if self.reduction is None else self.reduction
        found = _inspected(self.staged(reduction=0.0), self.staged(reduction=reduction), self.speed, self.keyframe)
        if self.json:
            print_json(
                {"scene": self.scene, "reduction": reduction} | _report(found) | {"warnings": warnings()},
            )
            return
        console, bed = Console(), found.whole.bed
        console.print(f"[bold]{self.scene}[/bold]  law {bed.law.name}: {bed.law.says}", highlight=False)
        given = {k: v for k, v in dataclasses.asdict(bed.sand).items() if v not in (None, "")}
        console.print("sand  " + ", ".join(f"{k} {v:g}" if k != "source" else v for k, v in given.items()))
        print_line(console, _solution_line(found.whole.model))
        console.print(_table(found.bodies, reduction))
        for name, row in found.bodies.items():
            print_line(console, f"{name}: {row['why']}")
        for tree in found.trees:
            print_line(console, escape(_stand_line(found.whole.model, tree)))
        for one in found.advice:
            change = "keep" if one.law == bed.law.name else f"--law {one.law}, not"
            print_line(console, f"law: {change} {bed.law.name}: {one.reason}")


class _Inspected(NamedTuple):
    """A scene as it would be modelled."""

    whole: Staged
    """With every triangle."""
    lean: Staged
    """With the fewest elements."""
    bodies: dict[str, dict[str, Any]]
    """The measures of each body, by its name, as JSON has them."""
    trees: tuple[Tree, ...]
    """The trees of bodies as they stand in the sand."""
    advice: list[Advice]
    """The laws that would serve."""


def _inspected(whole: Staged, lean: Staged, speed: float | None, keyframe: str | None) -> _Inspected:
    advice = advise(lean.model, lean.bed, speed)
    trees = standing(whole.model, posed(whole.model, keyframe)).trees
    bodies = {name: _body(whole.bed, lean.bed, name) for name in whole.bed.reasons}
    return _Inspected(whole, lean, bodies, trees, advice)


def _report(found: _Inspected) -> dict[str, Any]:
    """The report as JSON has it, but for what the command line knows."""
    model, bed = found.whole.model, found.whole.bed
    solution = instances(model)[0].bed
    return {
        "law": bed.law.name,
        "law_says": bed.law.says,
        "sand": dataclasses.asdict(bed.sand),
        "surface": surface_report(bed.terrain),
        "timestep_s": float(model.opt.timestep),
        "tolerance": float(solution.tolerance),
        "iterations": int(solution.iterations),
        "bodies": found.bodies,
        "triangles": sum(surface.ntri for surface in bed.surfaces.values()),
        "elements": sum(surface.ntri for surface in found.lean.bed.surfaces.values()),
        "stands": [_stand(model, tree) for tree in found.trees],
        "advice": [one._asdict() for one in found.advice],
        "choices": bed.choices,
    }


def _solution_line(model: mujoco.MjModel) -> str:
    """A line that says how exactly the implicit force is solved for."""
    bed = instances(model)[0].bed
    return f"implicit force: solved to {bed.tolerance:g} of a body's velocity, in {bed.iterations:g} iterations at most"


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


def _stand(model: mujoco.MjModel, tree: Tree) -> dict[str, Any]:
    """Where a tree of bodies stands in the sand, as JSON has it."""
    carried = np.isfinite(tree.lowered)
    feet = {model.body(foot.body).name: {"sinkage_m": foot.sinkage, "share": foot.share} for foot in tree.feet}
    lowered = tree.lowered if carried else None
    return {"root": model.body(tree.root).name, "weight_N": tree.weight, "lowered_m": lowered, "feet": feet}


def _stand_line(model: mujoco.MjModel, tree: Tree) -> str:
    """A line that says where a tree of bodies stands in the sand."""
    name = model.body(tree.root).name
    if not np.isfinite(tree.lowered):
        return f"stands: {name} does not, the sand carries its {tree.weight:.4g} N at no depth"
    feet = ", ".join(
        f"{model.body(foot.body).name} {1000 * foot.sinkage:.1f} mm ({100 * foot.share:.0f} %)" for foot in tree.feet
    )
    return f"stands: {name}, {tree.weight:.4g} N, lowered by {1000 * tree.lowered:.1f} mm: {feet}"


def _table(bodies: dict[str, dict[str, Any]], reduction: float) -> Table:
    table = Table("body", caption=f"needed: what --reduction {reduction:g} models; errors of its wrench in %")
    for heading in ("triangles", "needed", "error", "held back", "area [m²]"):
        table.add_column(escape(heading), justify="right")
    table.add_column("wheel")
    for name, row in bodies.items():
        errors = [f"{100 * row[key]:.2f}" if row[key] is not None else "" for key in ("error", "error_held_back")]
        counts = str(row["triangles"]), str(row["needed"])
        table.add_row(name, *counts, *errors, f"{row['area_m2']:.4g}", "yes" if row["wheel"] else "")
    return table
