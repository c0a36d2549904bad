"""`rftsim force`: the sand's force on a rigid mesh."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from rftsim.cli.options import Amount, Flag
from rftsim.cli.output import print_json, print_line
from rftsim.errors import RftsimError
from rftsim.law.rigid import surface_force
from rftsim.sand.presets import make_sand
from rftsim.surface.triangles import load_surface

Vector = Annotated[tuple[float, float, float], tyro.conf.arg(metavar="X Y Z")]
"""Three numbers on the command line: x, y, z."""


@dataclasses.dataclass(frozen=True)
class Force:
    """Force and moment of sand on a rigid mesh; the sand's surface is at z = 0.

    Example: rftsim force cylinder.stl --sand rho_c=3000,mu_int=0.4,mu_surf=0.4,xi_n=0.92e6 --position 0 0 -0.1
    --velocity 0 0 -0.1
    """

    mesh: tyro.conf.Positional[Path]
    """A closed triangle mesh: STL, OBJ, PLY, ..."""
    velocity: Vector
    """Velocity of the mesh's origin [m/s]."""
    position: Vector = (0.0, 0.0, 0.0)
    """Where the mesh's own origin is [m]; the moment is about it."""
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    """Angular velocity, world frame [rad/s]."""
    law: Annotated[str, tyro.conf.arg(metavar="NAME")] = "rft3d"
    """rft2d, drft2d, rft3d, drft3d, rft3d:c4, rft3d:FILE.toml."""
    sand: Annotated[str, tyro.conf.arg(metavar="TEXT")] = "poppy-seeds"
    """A preset, key=value,.. or a TOML file."""
    plane: Vector = (0.0, 1.0, 0.0)
    """Normal of the plane of motion of the 2D laws."""
    scale: Amount = 1.0
    """Factor on the mesh's lengths: 0.001 for millimetres."""
    allow_open: Flag = False
    """Accept a mesh that is not closed."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Evaluate the law on the mesh, and print the result."""
        for name in ("position", "velocity", "angular_velocity", "plane"):
            vector = getattr(self, name)
            if not all(map(math.isfinite, vector)):
                raise RftsimError(f"{name} must be three finite numbers, not {vector}")
        sand = make_sand(self.sand)
        surface = load_surface(self.mesh, scale=self.scale, allow_open=self.allow_open)
        result = surface_force(
            surface,
            sand,
            self.law,
            position=self.position,
            velocity=self.velocity,
            angular_velocity=self.angular_velocity,
            plane=self.plane,
        )
        if not (np.isfinite(result.force).all() and np.isfinite(result.moment).all() and math.isfinite(result.power)):
            raise RftsimError("the force is too large for a number: give smaller sizes, depths, speeds or strengths")
        report = {
            "force_N": result.force.tolist(),
            "moment_Nm": result.moment.tolist(),
            "triangles": surface.ntri,
            "active": int(result.active.sum()),
            "area_m2": float(surface.areas.sum()),
            "power_W": result.power,
            "law": self.law,
            "sand": dataclasses.asdict(sand),
            "warnings": [*surface.notes, *warnings()],
        }
        if self.json:
            print_json(report)
            return
        console = Console()
        for name, unit, vector in (("force", "N", result.force), ("moment", "N m", result.moment)):
            console.print(f"{name:8}" + "".join(f"{component:14.6g}" for component in vector) + f"  {unit}")
        console.print(f"power   {result.power:14.6g}  W")
        console.print(f"{report['active']} of {surface.ntri} triangles active, area {surface.areas.sum():.6g} m^2")
        for note in surface.notes:
            print_line(console, f"note: {note}")
