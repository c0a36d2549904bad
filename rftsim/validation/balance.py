"""Steady rolling of a free wheel where nothing depends on speed: forces balance, without any simulation."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rftsim_models.wheels import WheelParameters

from rftsim.errors import RftsimError
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array
from rftsim.validation import pockets
from rftsim.validation.pockets import Grousers, Motion, Shaded

PHASES = 4
"""Phases of the wheel, within the angle between grousers, that forces are averaged over."""
LAW = "rft2d"
"""The law that the grousered wheel is balanced under."""


def steady(wheel: WheelParameters, force: Callable[[float, float], tuple[float, float]]) -> dict[str, float]:
    """Find rolling v / (R omega) and sinkage / l at which the drawbar balances the push and the load the weight.

    Args:
        wheel: The wheel on its carriage.
        force: Gives drawbar and load [N] at a rolling [-] and a sinkage of the outer circle [m].

    Raises:
        RftsimError: There is no such state.
    """
    weight = wheel.vertical_mass * wheel.gravity

    def unbalanced(state: Any) -> list[float]:
        drawbar, load = force(float(state[0]), float(state[1]) * 2 * wheel.outer_radius)
        return [(drawbar + wheel.forward_force) / weight, load / weight - 1.0]

    from scipy.optimize import root  # not before it is needed: it takes a second

    found = root(unbalanced, [0.85, 0.17], options={"eps": 1e-4})
    if np.abs(found.fun).max() > 1e-3:
        raise RftsimError("the wheel finds no steady state: its push or its weight is too large for this sand")
    return {"rolling": float(found.x[0]), "sinkage": float(found.x[1])}


def grousered(wheel: WheelParameters, sand: Sand, rule: str, share: float | None) -> dict[str, Any]:
    """Find the same by 2D-RFT, the grousers having a share of their height, or by least power where it is None."""
    grousers = Grousers(wheel.radius, wheel.outer_radius, wheel.width, wheel.lugs, wheel.lug_width)
    shaded = Shaded(grousers)
    solid = None if share is None else grousers.with_height(share)

    def at(motion: Motion) -> Array:
        return shaded.force(sand, motion, LAW) if solid is None else pockets.force(solid, sand, motion, LAW)

    def force(rolling: float, sinkage: float) -> tuple[float, float]:
        velocity = np.array([rolling * grousers.tip, 0.0, 0.0])
        phases = grousers.pitch * np.arange(PHASES) / PHASES
        total = np.mean([at(Motion(grousers.tip - sinkage, phase, velocity, 1.0)) for phase in phases], axis=0)
        return float(total[0]), float(total[2])

    return {"rule": rule} | steady(wheel, force)
