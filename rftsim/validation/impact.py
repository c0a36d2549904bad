"""The inertial term of 3D-DRFT: plates that the continuum moves at speed, and spheres that are dropped on sand.

Computes no continuum: reads the campaign `speeds` of `rftsim_mpm/data`, which says by what command it was made. Spheres
fall on sand under the law with nothing fitted to them, and are held against what was measured.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.model.add_sand import add_sand
from rftsim.sand.medium import Sand
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, near

Array = NDArray[np.float64]

LAWS: Final = ("rft3d", "drft3d")
"""Laws under which spheres fall."""
HEIGHTS: Final = (0.02, 0.05, 0.1, 0.2, 0.5)
"""Heights from which they fall, of their lowest point above the sand [m]."""
DIAMETERS: Final = (0.0127, 0.0254, 0.0508)
"""Their diameters [m]."""
DENSITIES: Final = (700.0, 1500.0, 3000.0, 7800.0)
"""Their densities [kg/m^3]."""
FRICTIONS: Final = (0.3, 0.4, 0.5, 0.6)
"""Internal friction of the sands, the tangent of their angles of repose [-]."""
BULK: Final = 1510.0
"""Density of the sands [kg/m^3]."""
SURFACE: Final = 0.3
"""Friction between sand and sphere [-]."""
EXPONENTS: Final = {"drop distance": 1 / 3, "diameter": 2 / 3, "sphere's over sand's density": 1 / 2, "friction": -1.0}
"""Exponents of the depth that were measured, see SOURCE."""
PREFACTOR: Final = 0.14
"""Depth over the product of those powers, that of the density as a ratio, lengths in metres."""
SOURCE: Final = "Uehara et al. 2003, measured"
STEP: Final = 5e-4
"""Time step of a fall [s]."""
STILL: Final = 1e-4
"""Speed at which a sphere has stopped [m/s]."""
SLOWEST: Final = 0.2
"""Speed up to which a plate of the continuum is taken for slow [m/s]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads what is shipped, and one for each law and diameter of sphere."""
    drops = {f"{law}/{size:g}": functools.partial(_drops, law, size) for law in LAWS for size in DIAMETERS}
    return shipped("speeds", _read) | drops


def _drops(law: str, diameter: float) -> list[dict[str, float]]:
    return [
        {"height": height, "diameter": diameter, "density": density, "friction": friction, "depth": depth}
        for friction in FRICTIONS
        for density in DENSITIES
        for height in HEIGHTS
        for depth in [drop(law, Sand(rho_c=BULK, mu_int=friction, mu_surf=SURFACE), height, diameter, density)]
    ]


def drop(law: str, sand: Sand, height: float, diameter: float, density: float) -> float:
    """Let a sphere fall on level sand, and return how deep its lowest point comes [m].

    Args:
        law: The force law.
        sand: The sand.
        height: Height of its lowest point above the sand at first [m].
        diameter: Its diameter [m].
        density: Its density [kg/m^3].
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    body = spec.worldbody.add_body(name="sphere", pos=[0.0, 0.0, 0.5 * diameter])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.5 * diameter, 0.0, 0.0], density=density)
    add_sand(spec, sand, law=law, reduction=0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[0] = -math.sqrt(2.0 * sand.g * height)
    while data.qvel[0] < -STILL:
        mujoco.mj_step(model, data)
    return -float(data.qpos[0])


def _read(results: Results) -> list[dict[str, Any]]:
    kept = ("beta", "gamma", "mu_int", "rho", "length", "speed", "cells", "bed", "softness")
    return [{name: one["plate"][name] for name in kept} | {"force": one["force"]} for one in results]


def law_of(spheres: list[dict[str, float]]) -> tuple[Array, float]:
    """Fit the depth by a product of powers.

    Args:
        spheres: Drops, of all laws' one.

    Returns:
        The exponents as EXPONENTS has them, (4,), and the geometric mean of the depth over the measured law [-].
    """
    height, size, density, friction, depth = (
        np.array([one[name] for one in spheres]) for name in ("height", "diameter", "density", "friction", "depth")
    )
    powers = np.log([height + depth, size, density / BULK, friction])
    found, *_ = np.linalg.lstsq(np.vstack([powers, np.ones(len(depth))]).T, np.log(depth), rcond=None)
    measured = math.log(PREFACTOR) + np.array(list(EXPONENTS.values())) @ powers
    return found[:4], float(np.exp((np.log(depth) - measured).mean()))
