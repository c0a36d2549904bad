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
from rftsim_mpm.plate import Plate
from rftsim_mpm.reading import limit

from rftsim.model.add_sand import add_sand
from rftsim.sand.medium import Sand
from rftsim.validation.plates import fit_terms
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, near

Array = NDArray[np.float64]

LAMBDA: Final = Sand.lambda_
"""Factor of the inertial term that `drft3d` has unless told otherwise [-]."""
BAND: Final = 0.4
"""How far from that the continuum's may be [-]."""
OURS: Final = f"drft3d, λ {LAMBDA:g}"
"""The case that is judged."""
CASES: Final = {"rft3d": ("rft3d", 0.0), OURS: ("drft3d", LAMBDA), "drft3d, λ 1.7": ("drft3d", 1.7)}
"""Laws and factors of the inertial term under which spheres fall."""
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
SOURCE: Final = "[Uehara2003], measured"
STEP: Final = 5e-4
"""Time step of a fall [s]."""
STILL: Final = 1e-4
"""Speed at which a sphere has stopped [m/s]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads what is shipped, and one for each law and diameter of sphere."""
    drops = {f"{case}/{size:g}": functools.partial(_drops, *CASES[case], size) for case in CASES for size in DIAMETERS}
    return shipped("speeds", _read) | drops


def _drops(law: str, inertia: float, diameter: float) -> list[dict[str, float]]:
    return [
        {"height": height, "diameter": diameter, "density": density, "friction": friction, "depth": depth}
        for friction in FRICTIONS
        for density in DENSITIES
        for height in HEIGHTS
        for sand in [Sand(rho_c=BULK, mu_int=friction, mu_surf=SURFACE, lambda_=inertia)]
        for depth in [drop(law, sand, height, diameter, density)]
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
    kept = ("beta", "gamma", "mu_int", "rho", "length", "speed", "cells")
    return [{name: one["plate"][name] for name in kept} | {"force": one["force"]} for one in results]


def rows(measured: Measured) -> list[Row]:
    """The rows of lambda by the continuum's plates, and of the spheres' depths."""
    return [*_plate_rows(outcome(measured, "speeds") or []), *_sphere_rows(measured)]


def _plate_rows(plates: list[dict[str, Any]]) -> list[Row]:
    table = []
    for (beta, gamma, friction), by_cells in inertia_of(plates).items():
        what = f"continuum: λ of a plate, β {beta:g}°, γ {gamma:g}°, μ_int {friction:g}"
        coarse, *finer = sorted(by_cells)
        for cells in (coarse, *finer):
            table.append(Row(f"{what}, {cells:g} cells", by_cells[cells], "our continuum"))
        for cells in finer:
            found = limit(np.array(by_cells[coarse]), np.array(by_cells[cells]), cells / coarse)
            table.append(near(f"{what}, limit", float(found), LAMBDA, BAND, "drft3d's own λ"))
    return table


def inertia_of(plates: list[dict[str, Any]]) -> dict[tuple[float, float, float], dict[float, float]]:
    """Fit lambda of F_n = F_0 + lambda rho A v_n^2, n along the normal of the face that leads.

    Args:
        plates: Plates as the continuum reports them, several speeds of each.

    Returns:
        For each (beta, gamma, mu_int) lambda by the number of cells to a plate.
    """
    found: dict[tuple[float, float, float], dict[float, float]] = {}
    for which in sorted({_kind(p) for p in plates}):
        own, plate = [p for p in plates if _kind(p) == which], Plate(dim=3, beta=which[0], gamma=which[1])
        force = np.array([-np.dot(p["force"], plate.leading) for p in own])
        across = float(plate.direction @ plate.leading)
        unit = np.array([p["rho"] * (p["length"] * p["speed"] * across) ** 2 for p in own])
        _, inertia = fit_terms(np.ones(len(own)), unit, force)
        found.setdefault(which[:3], {})[which[3]] = inertia
    return found


def _kind(plate: dict[str, Any]) -> tuple[float, float, float, float]:
    """What plates have in common that differ in speed alone: beta, gamma [deg], mu_int [-], and cells to a plate."""
    return plate["beta"], plate["gamma"], plate["mu_int"], plate["cells"]


def _sphere_rows(measured: Measured) -> list[Row]:
    table = []
    for case in CASES:
        exponents, factor = law_of(_spheres(measured, case))
        compared = case == OURS
        for (name, expected), got in zip(EXPONENTS.items(), exponents, strict=True):
            what = f"{case}: exponent of a sphere's depth over {name}"
            within = 0.15 * abs(expected) if compared else math.inf
            table.append(near(what, float(got), expected, within, SOURCE))
        what, within = f"{case}: a sphere's depth over the measured law, geometric mean", 0.25 if compared else math.inf
        table.append(near(what, factor, 1.0, within, SOURCE))
    return table


def _spheres(measured: Measured, case: str) -> list[dict[str, float]]:
    return [one for size in DIAMETERS for one in measured[f"{case}/{size:g}"]]


def law_of(spheres: list[dict[str, float]]) -> tuple[Array, float]:
    """Fit the depth by a product of powers.

    Args:
        spheres: Drops, all under one law.

    Returns:
        The exponents as EXPONENTS has them, (4,), and the geometric mean of the depth over the measured law [-].
    """
    powers, depth = np.log(_bases(spheres)), np.log([one["depth"] for one in spheres])
    found, *_ = np.linalg.lstsq(np.vstack([powers, np.ones(len(depth))]).T, depth, rcond=None)
    return found[:4], float(np.exp((depth - np.log(measured_depth(spheres))).mean()))


def _bases(spheres: list[dict[str, float]]) -> Array:
    """What the powers of EXPONENTS are of, (4, n): total drop, diameter [m], ratio of densities, friction [-]."""
    height, size, density, friction, depth = (
        np.array([one[name] for one in spheres]) for name in ("height", "diameter", "density", "friction", "depth")
    )
    return np.array([height + depth, size, density / BULK, friction])


def measured_depth(spheres: list[dict[str, float]]) -> Array:
    """Depth that was measured at the total drop of each sphere, (n,) [m]."""
    powers = np.array(list(EXPONENTS.values()))
    found: Array = PREFACTOR * np.exp(powers @ np.log(_bases(spheres)))
    return found


def draw(measured: Measured, figure: Any) -> None:
    """Draw the plates' stress over their speed, and the spheres' depth over the one that was measured."""
    left, right = figure.subplots(1, 2)
    plates = outcome(measured, "speeds") or []
    for k, kind in enumerate(sorted({_kind(p) for p in plates})):
        own = sorted((p for p in plates if _kind(p) == kind), key=lambda p: float(p["speed"]))
        stress = [1e-3 * float(np.linalg.norm(p["force"])) / p["length"] ** 2 for p in own]
        label = f"β {kind[0]:g}°, γ {kind[1]:g}°, μ {kind[2]:g}, {kind[3]:g} cells"
        left.plot([p["speed"] ** 2 for p in own], stress, "o-", color=f"C{k % 10}", label=label)
    left.set_xlabel("speed² [m²/s²]")
    left.set_ylabel("force per area [kPa]")
    left.set_title("plates in the continuum", fontsize=10)
    for k, case in enumerate(CASES):
        spheres = _spheres(measured, case)
        got = 1e3 * np.array([one["depth"] for one in spheres])
        right.loglog(1e3 * measured_depth(spheres), got, ".", color=f"C{k}", label=case)
    line = np.array(right.get_xlim())
    right.loglog(line, line, "k--", linewidth=1, label=SOURCE)
    right.set_xlabel("measured law of depth [mm]")
    right.set_ylabel("depth under the law [mm]")
    right.set_title("spheres dropped on sand", fontsize=10)
    for axis in (left, right):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
