"""How far a moment of a run lies from where resistive force theory holds."""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from rftsim.law.layout import extent
from rftsim.model.readout import body_velocities, instances, tractions

FROUDE_LIMIT = 0.4
"""Froude number from which on inertial terms count [-]."""
INERTIAL_LIMIT = 0.1
"""Inertial number above which grains no longer flow densely [-]."""
DEPTH_LIMIT = 2.0
"""Depth over size beyond which the laws overestimate stress [-]."""


class Validity(NamedTuple):
    """The dimensionless numbers of one body in the sand, zero where it does not touch it."""

    body: str
    """Name of the body."""
    froude: float
    """Froude number v / sqrt(g L), v the mean speed of the active triangles, L the body's size. Without inertial terms
    below 0.4."""
    inertial: float
    """Inertial number (v / L) d / sqrt(g z), z the mean active depth, d the grain diameter. Below 0.1; NaN if
    unknown."""
    depth: float
    """Largest depth of an active triangle over L. Of order one."""
    dynamic: bool
    """Whether the law has inertial terms."""

    def doubts(self) -> list[tuple[str, float, str]]:
        """Each number that is out of range: its name, its value, and a sentence that says so."""
        found = []
        if self.froude > FROUDE_LIMIT and not self.dynamic:
            said = f"Froude number {self.froude:.2g} > {FROUDE_LIMIT}: use a dynamic law"
            found.append(("froude", self.froude, said))
        if self.inertial > INERTIAL_LIMIT:
            said = f"inertial number {self.inertial:.2g} > {INERTIAL_LIMIT}: grains no longer flow densely"
            found.append(("inertial", self.inertial, said))
        if self.depth > DEPTH_LIMIT:
            said = f"depth is {self.depth:.2g} times the size, more than {DEPTH_LIMIT:g}: stress overestimated"
            found.append(("depth", self.depth, said))
        return found


def validity(model: mujoco.MjModel, data: mujoco.MjData, grain_diameter: float | None = None) -> list[Validity]:
    """The numbers of every body that feels sand, at the positions and velocities of the last mj_forward or mj_step.

    Args:
        model: Compiled, with sand.
        data: Its data.
        grain_diameter: Diameter of the sand's grains [m], if it is known.
    """
    velocity, omega = body_velocities(model, data)
    found = []
    for bed in instances(model):
        g = float(bed.bed.g)
        dynamic = bool(bed.bed.dynamic)
        for body, surface in bed.bodies.items():
            triangles = tractions(model, data, body)
            size = extent(surface)
            name = model.body(body).name
            if not triangles.active.any():
                found.append(Validity(name, 0.0, 0.0, 0.0, dynamic))
                continue
            arm = triangles.centre[triangles.active] - data.xpos[body]
            weight, depth = triangles.area[triangles.active], triangles.depth[triangles.active]
            speeds = np.linalg.norm(velocity[body] + np.cross(omega[body], arm), axis=1)
            speed = float(np.average(speeds, weights=weight))
            mean_depth = float(np.average(depth, weights=weight))
            inertial = (grain_diameter or math.nan) * speed / size / math.sqrt(g * mean_depth)
            found.append(Validity(name, speed / math.sqrt(g * size), inertial, float(depth.max()) / size, dynamic))
    return found
