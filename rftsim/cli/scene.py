"""Options by which several commands take a scene: a shipped one, or somebody's model file, on sand."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import tyro
from rich.console import Console
from rich.markup import escape

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
    """A shipped scene (grouser-wheel, half-grouser-wheel, four-flap-runner, intruder) or a model file, MJCF or URDF."""
    law: str | None = None
    """Law to take instead of the scene's."""
    sand: str | None = None
    """Sand to take instead of the scene's: a preset, key=value,... or a TOML file."""
    set: Settings = ()
    """Settings of a shipped scene, key=value ...; may be repeated."""
    bodies: str | None = None
    """Names of the bodies that feel the sand, a,b,...; by default each that can move and has geoms."""
    geoms: Geoms = "collision"
    """Geoms that bound a body: those that can collide, or, where a body has none of these, all that it has."""
    meshes: Meshes | None = None
    """How meshes of model files are felt: hull, as MuJoCo collides with them, or exact, as they are where closed."""
    terrain: str | None = None
    """The sand's surface: a height [m]; slope=DEGREES[,heading=DEGREES]; dunes[,amplitude=M,wavelength=M,seed=N];
    FILE.png,size=XxY,high=M[,low=M]; a .npy, .npz or .csv of heights with spacing=M; or the name of a height field geom
    of the model. By default that of the floor, whose place it takes."""
    ruts: bool = False
    """Let the sand remember: bodies leave ruts, prints and heaps in it, which they feel when they come back."""
    keyframe: str | None = None
    """Name or number of the keyframe in which a model file starts; by default the first."""
    keep_floor: bool = False
    """Leave the floor at the sand's level as it is; by default it no longer collides, and is hidden."""
    reduction: float | None = None
    """Model only what the scene needs: the fewest elements whose wrench errs by at most this share; 0 for every
    triangle; by default 0.01 for model files, and 0 for shipped scenes."""
    tolerance: float | None = None
    """Error of a body's velocity, relative, that the implicit force is solved to, 1e-6 to 0.1; by default 0.003."""
    iterations: int | None = None
    """Most iterations of one solution of the implicit force, 1 to 60; by default 20."""

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
