"""3D-RFT against a smooth wheel that the continuum holds at a slip and a sinkage in space.

Computes no continuum: reads the campaign `drum` of `rftsim_mpm/data`, a wheel of the size of the measured one of
`measured`, and the flat plates of `plates`, which say how strong the continuum's sand is.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rftsim_mpm.shapes import drum

from rftsim.law.rigid import surface_force
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Surface, make_surface
from rftsim.validation.held import CONVERGED, FORCES
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, near

STRENGTHS: Final = {"own": "ξ_n of our flat plates", "table": "ξ_n of Table C.1"}
"""Strengths of the law's sand, by the names that they have here."""
SIDES: Final = 96
"""Sides of the wheel that the law feels."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The jobs that read what is shipped."""
    return shipped("drum", _read) | shipped("plates", _flat)


def _flat(results: Results) -> list[tuple[float, float]]:
    """Internal friction [-] and strength over density [N/kg/m] of flat plates, one for each friction."""
    plates = [(one["plate"], one["alpha_N_m3"][2]) for one in results]
    flat = {p["mu_int"]: alpha / p["rho"] for p, alpha in plates if p["beta"] == 0.0 and p["gamma"] == 90.0}
    return sorted(flat.items())


def _read(results: Results) -> list[dict[str, Any]]:
    kept = ("prescribed_slip", "prescribed_sinkage", "dx", "rpm", "radius", "breadth", "mu_int", "mu_surf", "rho")
    return [
        {name: one["heldwheel"][name] for name in kept} | {name: one[name] for name in FORCES}
        for one in sorted(results, key=lambda one: -float(one["heldwheel"]["dx"]))
    ]


def law(wheel: dict[str, Any], xi_n: float) -> dict[str, float]:
    """The forces of `rft3d` on a held wheel, by the names of `held.FORCES`, over its breadth.

    Args:
        wheel: What the continuum held.
        xi_n: Strength of the sand [N/m^3].
    """
    omega = wheel["rpm"] * math.pi / 30.0
    sand = Sand(rho_c=wheel["rho"], mu_int=wheel["mu_int"], mu_surf=wheel["mu_surf"], xi_n=xi_n)
    found = surface_force(
        _surface(wheel["radius"], wheel["breadth"]), sand, "rft3d",
        position=(0.0, 0.0, wheel["radius"] - wheel["prescribed_sinkage"]),
        velocity=((1.0 - wheel["prescribed_slip"]) * omega * wheel["radius"], 0.0, 0.0),
        angular_velocity=(0.0, omega, 0.0),
    )  # fmt: skip
    forces = found.force[2], found.force[0], -found.moment[1]
    return dict(zip(FORCES, (np.array(forces) / wheel["breadth"]).tolist(), strict=True))


@functools.cache
def _surface(radius: float, breadth: float) -> Surface:
    shape = drum(radius, breadth, SIDES)
    return make_surface(shape.vertices, shape.faces)


def _laws(measured: Measured, wheel: dict[str, Any]) -> dict[str, dict[str, float]]:
    """The forces of the law on a wheel, by the names of STRENGTHS."""
    return {name: law(wheel, xi_n) for name, xi_n in _strengths(measured, wheel).items()}


def _strengths(measured: Measured, wheel: dict[str, Any]) -> dict[str, float]:
    """Strengths of a wheel's sand by the names of STRENGTHS [N/m^3]."""
    friction, over_density = np.array(outcome(measured, "plates")).T
    own = wheel["rho"] * math.exp(np.interp(wheel["mu_int"], friction, np.log(over_density)))
    table = Sand(rho_c=wheel["rho"], mu_int=wheel["mu_int"], mu_surf=wheel["mu_surf"]).xi_n
    assert table is not None
    return {"own": own, "table": table}


def rows(measured: Measured) -> list[Row]:
    """The rows of the law against the continuum's finest cells, to be read, and of these against coarser ones."""
    wheels, table = outcome(measured, "drum") or [], []
    for which in sorted({_place(one) for one in wheels}):
        *coarser, wheel = (one for one in wheels if _place(one) == which)
        what = f"slip {which[0]:g}, sinkage {1e3 * which[1]:g} mm"
        for name, forces in _laws(measured, wheel).items():
            for force in FORCES:
                said = f"rft3d, {STRENGTHS[name]}, {what}: {_said(force)}"
                table.append(Row(said, forces[force], "our continuum", _unit(force), expected=wheel[force]))
        for one in coarser:
            said = f"continuum, {what}, cells of {1e3 * one['dx']:g} to {1e3 * wheel['dx']:g} mm"
            for force in FORCES:
                within = CONVERGED * abs(one["torque_N" if force == "torque_N" else "load_N_m"])
                more = {"unit": _unit(force), "source": "itself before"}
                table.append(near(f"{said}: {_said(force)}", wheel[force], one[force], within, **more))
    return table


def _place(wheel: dict[str, Any]) -> tuple[float, float]:
    return float(wheel["prescribed_slip"]), float(wheel["prescribed_sinkage"])


def _said(force: str) -> str:
    return force.partition("_")[0]


def _unit(force: str) -> str:
    return "N" if force == "torque_N" else "N/m"


def draw(measured: Measured, figure: Any) -> None:
    """Draw load, drawbar and torque over the slip, of the continuum and of the law with either strength."""
    wheels = outcome(measured, "drum") or []
    laws = {_place(one): _laws(measured, one) for one in wheels}
    names = ("load [N/m]", "drawbar [N/m]", "torque [N]")
    for axis, force, said in zip(figure.subplots(1, 3), FORCES, names, strict=True):
        for k, sinkage in enumerate(sorted({one["prescribed_sinkage"] for one in wheels})):
            own = [one for one in wheels if one["prescribed_sinkage"] == sinkage]
            for dx, mark in zip(sorted({one["dx"] for one in own}, reverse=True), "o^v", strict=False):
                points = sorted((one["prescribed_slip"], one[force]) for one in own if one["dx"] == dx)
                label = f"continuum, {1e3 * sinkage:g} mm deep, cells {1e3 * dx:g} mm"
                axis.plot(*np.array(points).T, mark, color=f"C{k}", label=label)
            level = sorted({_place(one) for one in own})
            for name, line in zip(STRENGTHS, ("-", ":"), strict=True):
                curve = [laws[place][name][force] for place in level]
                said_once = f"rft3d, {STRENGTHS[name]}" if k == 0 else None
                axis.plot([slip for slip, _ in level], curve, line, color=f"C{k}", label=said_once)
        axis.set_xlabel("slip  $1 - v/(R\\omega)$ [-]")
        axis.set_ylabel(said)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.suptitle("Smooth wheel held in space")
