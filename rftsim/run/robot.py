"""The measures of somebody's robot in sand: its trunk, how deep its feet are, and how much of it the sand carries."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from rftsim.model.ground import ground
from rftsim.model.readout import instances, wrenches
from rftsim.model.standing import moving_weight, sinkage
from rftsim.surface.triangles import Array


class Robot(NamedTuple):
    """A robot at the end of a run."""

    trunk: str
    """Name of the body by which it is measured."""
    height: float
    """Height of the trunk's origin above the sand, along its normal [m]."""
    feet: dict[str, float]
    """Sinkage of each body that is in the sand, by body name, the deepest first [m]."""
    weight: float
    """The weight of everything that can move [N]."""
    carried: float
    """The sand's force against gravity over this weight; NaN without weight."""


def trunk(model: mujoco.MjModel, felt: Sequence[int]) -> str:
    """The name of the body by which a robot is measured.

    Of the trees with a body that feels the sand it is of the heaviest: the root, or where that cannot move the heaviest
    body.

    Args:
        model: Compiled.
        felt: Ids of the bodies that feel the sand.
    """
    moving = model.body_weldid != 0
    mass = np.where(moving, model.body_mass, 0.0)
    roots = np.unique(model.body_rootid[list(felt)])
    root = int(roots[np.argmax([mass[model.body_rootid == one].sum() for one in roots])])
    if not moving[root]:
        root = int(np.argmax(np.where(model.body_rootid == root, mass, -1.0)))
    return str(model.body(root).name)


def measure(model: mujoco.MjModel, data: mujoco.MjData, body: str, lift: float | None = None) -> Robot:
    """The measures of a robot at the positions of its data.

    Args:
        model: Compiled, with sand.
        data: Its data after mj_forward or mj_step.
        body: Name of its trunk.
        lift: The sand's force on it against gravity [N]; by default that of the moment.
    """
    weight = moving_weight(model)
    lift = against_gravity(model, total_force(model, data)) if lift is None else lift
    return Robot(
        body,
        -float(ground(model, data, instances(model)[0].name).depth(data.body(body).xpos)),
        {name: depth for name, depth in sinkages(model, data).items() if depth > 0.0},
        weight,
        lift / weight if weight > 0.0 else float("nan"),
    )


def sinkages(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """Sinkage of each body that feels the sand, by body name, the deepest first [m]; negative above the sand."""
    found = {
        model.body(body).name: sinkage(ground(model, data, bed.name), surface, data.xpos[body], data.xmat[body])
        for bed in instances(model)
        for body, surface in bed.bodies.items()
    }
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def total_force(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The sand's force on all bodies together [N], shape (3,)."""
    total: Array = wrenches(model, data).force.sum(axis=0)
    return total


def against_gravity(model: mujoco.MjModel, force: Array) -> float:
    """The part of a force that holds up a weight [N]: against gravity, or along z where there is none."""
    strength = float(np.linalg.norm(model.opt.gravity))
    return -float(force @ model.opt.gravity) / strength if strength > 0.0 else float(force[2])
