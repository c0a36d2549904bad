"""Options by which several commands take a scene: a shipped one, or somebody's model file, on sand."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.markup import escape

from rftsim.cli.options import Flag, Name, Names, Number, Text, Whole
from rftsim.cli.output import print_line
from rftsim.cli.settings import Settings, read_settings
from rftsim.errors import RftsimError
from rftsim.model.geometry import Geoms, Meshes
from rftsim.run.robot import Robot
from rftsim.run.scenes import SCENES, Staged, Start, stage
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene on sand, as the command line has it."""

    scene: tyro.conf.Positional[str]
    """Model file, MJCF or URDF, or grouser-wheel, half-grouser-wheel, four-flap-runner, intruder."""
    law: Name = None
    """rft2d, drft2d, rft3d, drft3d; by default the scene's."""
    sand: Text = None
    """A preset, key=value,.. or a TOML file."""
    set: Settings = ()
    """Settings of a shipped scene."""
    bodies: Names = None
    """Bodies that feel sand; by default all that can."""
    geoms: Annotated[Geoms, tyro.conf.arg(metavar="WHICH", help_behavior_hint="")] = "collision"
    """Of bodies that cannot collide: collision, or all."""
    meshes: Annotated[Meshes | None, tyro.conf.arg(metavar="HOW", help_behavior_hint="")] = None
    """How meshes are felt: hull, or exact."""
    terrain: Text = None
    """Surface: 0.2, slope=10, dunes,seed=1, hill.png,size=8x6,high=1, a height field's name; by default the floor's."""
    ruts: Flag = False
    """The sand keeps ruts, prints and heaps."""
    keyframe: Name = None
    """Keyframe to start in; by default the first."""
    keep_floor: Flag = False
    """Leave the floor at the sand's level as it is."""
    reduction: Number = None
    """Elements for this error; by default 0.01, of shipped scenes 0: every triangle."""
    tolerance: Number = None
    """Of the implicit force, 1e-6 to 0.1; by default 0.003."""
    iterations: Whole = None
    """Of it, at most, 1 to 60; by default 40."""

    def staged(self, *, settle: bool = True, **options: Any) -> Staged:
        """Make the scene with its sand, compiled.

        Args:
            settle: Whether a model file starts where it stands in the sand.
            **options: Further options of `stage`.
        """
        if self.keyframe is not None and self.scene in SCENES:
            raise RftsimError(f"{self.scene} has a start of its own; --keyframe is for model files")
        options.setdefault("reduction", self.reduction)
        if self.bodies is not None:
            options["bodies"] = [name.strip() for name in self.bodies.split(",")]
        return stage(
            self.scene,
            sand=self.sand,
            law=self.law,
            settings=read_settings(self.set),
            start=Start(self.keyframe, settle),
            terrain=self.terrain,
            ruts=self.ruts,
            geoms=self.geoms,
            meshes=self.meshes,
            keep_floor=self.keep_floor,
            tolerance=self.tolerance,
            iterations=self.iterations,
            **options,
        )


def surface_report(terrain: FreeSurface | Terrain) -> dict[str, Any]:
    """The measures of the sand's surface, as JSON has them."""
    if isinstance(terrain, FreeSurface):
        return dataclasses.asdict(terrain)
    return {
        "rows": terrain.heights.shape[0],
        "columns": terrain.heights.shape[1],
        "spacing_m": terrain.spacing,
        "origin_m": terrain.origin,
        "repeat": terrain.repeat,
        "lowest_m": float(terrain.heights.min()),
        "highest_m": float(terrain.heights.max()),
        "steepest_deg": math.degrees(terrain.steepest),
    }


def robot_report(robot: Robot) -> dict[str, Any]:
    """The measures of a robot, as JSON has them."""
    return {
        "trunk": robot.trunk,
        "trunk_height_m": robot.height,
        "feet_sinkage_m": robot.feet,
        "weight_N": robot.weight,
        "carried": robot.carried if robot.weight > 0.0 else None,
    }


def print_robot(console: Console, robot: Robot) -> None:
    """Print the measures of a robot: where its trunk is, its feet, and what the sand carries."""
    for line in _robot_lines(robot):
        print_line(console, escape(line))


def _robot_lines(robot: Robot) -> Iterator[str]:
    yield f"trunk {robot.trunk}: {robot.height:.4g} m above the sand"
    feet = ", ".join(f"{name} {1000 * depth:.1f}" for name, depth in robot.feet.items())
    yield f"sinkage [mm]: {feet or 'nothing is in the sand'}"
    if robot.weight > 0.0:
        yield f"the sand carries {100 * robot.carried:.1f} % of {robot.weight:.4g} N"
