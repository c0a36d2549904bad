"""Sand that remembers, against the continuum: a foot in its own print, a blade with its heap, a wheel in its own rut.

Computes no continuum: reads the campaign `ruts` of `rftsim_mpm/data`, which says by what command it was made, and plays
the same motions in MuJoCo. Plane strain has no sides, so bodies here are as wide as WIDTH, far wider than deep; the
wheel is played as wide as it is, too.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rftsim_mpm.blade import SHARES
from rftsim_mpm.rut import Rut

from rftsim.surface.triangles import Array
from rftsim.validation.played import VARIANTS, WIDTH, blade, foot, wheel
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, near

BOUNDS: Final = {"ratio": 0.2, "slip": 0.05, "mm": 3.0}
"""How far laws with ruts may be off: in ratios of forces, and in what a second pass adds to slip and sinkage [mm]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads the continuum, and a job for each motion and each memory of the sand."""
    narrow = functools.partial(wheel, width=Rut().breadth)
    plays: dict[str, Callable[[str], Any]] = {"foot": foot, "blade": blade, "wheel": wheel, "narrow": narrow}
    played = {
        f"{name}/{variant}": functools.partial(play, variant) for name, play in plays.items() for variant in VARIANTS
    }
    return shipped("ruts", _continuum) | played


def _continuum(results: Results) -> dict[str, list[dict[str, Any]]]:
    """The shipped runs of each kind, from coarse to fine cells."""
    kinds = {"footprint": "cells", "blade": "cells", "rut": "dx"}
    found = {}
    for kind, resolution in kinds.items():
        own = [one for one in results if kind in one]
        found[kind] = sorted(own, key=lambda one: float(one[kind][resolution]), reverse=resolution == "dx")
    return found


def rows(measured: Measured) -> list[Row]:
    """The rows of foot, blade and wheel, without ruts and, where the sand can remember, with them."""
    found = outcome(measured, "ruts")
    if not found:
        return []
    table = []
    for variant in VARIANTS:
        table += _foot_rows(found["footprint"], measured[f"foot/{variant}"], variant)
        table += _blade_rows(found["blade"], measured[f"blade/{variant}"], variant)
        for name, said in (("wheel", f"wide wheel, {WIDTH:g} m"), ("narrow", "wheel as it is")):
            table += _wheel_rows(found["rut"], measured[f"{name}/{variant}"], variant, said)
    return [*table, *_own_rows(found)]


def _row(what: str, got: float, expected: float, within: float, variant: str, unit: str = "-") -> Row:
    """Make a row that is judged where the sand remembers, and only shown where it does not."""
    within = within if VARIANTS[variant] else math.inf
    return near(f"{variant}: {what}", float(got), expected, within, "our continuum", unit=unit)


def ratios(pushes: dict[str, Any], depths: Array) -> Array:
    """The second push's force over the first's at depths below the undisturbed surface [-]."""
    forces = [np.interp(depths, pushes[name]["depth_m"], pushes[name]["force"]) for name in ("second", "first")]
    found: Array = forces[0] / forces[1]
    return found


def _foot_rows(runs: list[dict[str, Any]], played: dict[str, Any], variant: str) -> list[Row]:
    if not runs:
        return []
    fine = runs[-1]
    depths = np.array(fine["depths_m"])
    shape = [
        _row(f"footprint: {what}", 1e3 * played[name], 1e3 * fine[name], BOUNDS["mm"], variant, "mm")
        for what, name in (("print after its walls slid", "print_m"), ("its rim", "rim_m"))
    ]
    return shape + [
        _row(f"footprint, {1e3 * z:.0f} mm deep: second push over first", float(got), one, BOUNDS["ratio"], variant)
        for z, got, one in zip(depths, ratios(played, depths), fine["ratios"], strict=True)
    ]


def _blade_rows(runs: list[dict[str, Any]], played: dict[str, Any], variant: str) -> list[Row]:
    if not runs:
        return []
    fine, table = runs[-1], []
    travel, drag = np.array(played["travel_m"]), np.array(played["drag"])
    start = float(drag[travel <= 0.05 * travel[-1]].mean())
    for share, way, force in zip(SHARES, fine["travel_m"], fine["drag_N_m"], strict=True):
        own = (travel >= (share - 0.05) * travel[-1]) & (travel <= share * travel[-1])
        expected = force / fine["start_N_m"]
        what = f"blade after {1e3 * way:.0f} mm: drag over that without a heap"
        table.append(_row(what, float(drag[own].mean()) / start, expected, BOUNDS["ratio"] * expected, variant))
    heap = 1e3 * fine["heap_m"][-1]
    what = "blade at the end of its way: heap"
    return [*table, _row(what, 1e3 * played["heap_m"], heap, BOUNDS["ratio"] * heap, variant, "mm")]


def _wheel_rows(runs: list[dict[str, Any]], played: dict[str, Any], variant: str, said: str) -> list[Row]:
    if not runs:
        return []
    fine = runs[-1]
    slip, sunk = np.array(fine["slip"]), 1e3 * np.array(fine["sinkage_m"])
    got_slip, got_sunk = np.array(played["slip"]), 1e3 * np.array(played["sinkage_m"])
    flat = BOUNDS["mm"] if said.startswith("wide") else math.inf  # a wheel with sides lets sand out there
    got_rut, more = 1e3 * played["rut_m"], f"{said}, second pass:"
    return [
        _row(f"{said}, first pass: slip", got_slip[0], slip[0], math.inf, variant),
        _row(f"{said}, first pass: sinkage", got_sunk[0], sunk[0], math.inf, variant, "mm"),
        _row(f"{said}, first pass: its rut", got_rut, 1e3 * fine["rut_m"][0], flat, variant, "mm"),
        _row(f"{more} it slips more by", got_slip[1] - got_slip[0], slip[1] - slip[0], BOUNDS["slip"], variant),
        _row(f"{more} it sinks more by", got_sunk[1] - got_sunk[0], sunk[1] - sunk[0], BOUNDS["mm"], variant, "mm"),
    ]


def _own_rows(found: dict[str, list[dict[str, Any]]]) -> list[Row]:
    """What the continuum says of its surfaces, and how far its coarser cells are from its finer ones."""
    table = []
    for coarse, fine in zip(found["footprint"][-2:-1], found["footprint"][-1:], strict=True):
        for what, name, factor, unit in (
            ("print after its walls slid", "print_m", 1e3, "mm"),
            ("rim of the print", "rim_m", 1e3, "mm"),
            ("slope of the print's walls", "wall_deg", 1.0, "°"),
            ("volume of the rims over the print's", "rim_over_print", 1.0, "-"),
        ):
            table.append(_against(what, factor * fine[name], factor * coarse[name], unit))
    for coarse, fine in zip(found["blade"][-2:-1], found["blade"][-1:], strict=True):
        for what, name, factor, unit in (
            ("heap at the end of the blade's way", "heap_m", 1e3, "mm"),
            ("slope of the heap's front", "front_deg", 1.0, "°"),
            ("drag on the blade", "drag_N_m", 1.0, "N/m"),
        ):
            table.append(_against(what, factor * fine[name][-1], factor * coarse[name][-1], unit))
    for coarse, fine in zip(found["rut"][-2:-1], found["rut"][-1:], strict=True):
        table.append(_against("rut that the wheel leaves", 1e3 * fine["rut_m"][0], 1e3 * coarse["rut_m"][0], "mm"))
    return table


def _against(what: str, got: float, coarse: float, unit: str) -> Row:
    return Row(f"continuum: {what}", got, "its coarser cells", unit=unit, expected=coarse)


def draw(measured: Measured, figure: Any) -> None:
    """Draw both pushes of the foot, the blade's drag, and the surfaces that foot and blade leave."""
    axes = figure.subplots(2, 2)
    found = outcome(measured, "ruts") or {"footprint": [], "blade": [], "rut": []}
    _draw_foot(axes[0, 0], axes[0, 1], measured, found["footprint"][-1:])
    _draw_blade(axes[1, 0], axes[1, 1], measured, found["blade"][-1:])
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.suptitle("Sand that remembers: the continuum in plane strain, and 2D-RFT")


def _draw_foot(left: Any, right: Any, measured: Measured, runs: list[dict[str, Any]]) -> None:
    """Force over depth of both pushes, in units of the first push's last force, and the surface between them."""
    for k, name in enumerate(("first", "second")):
        for one in runs:
            z, force = np.array(one[name]["depth_m"]), np.array(one[name]["force_N_m"])
            left.plot(1e3 * z, force / one["first"]["force_N_m"][-1], color=f"C{k}", label=f"{name} push, continuum")
        for variant, line in zip(VARIANTS, ("--", ":"), strict=False):
            own = measured[f"foot/{variant}"]
            force = np.array(own[name]["force"]) / own["first"]["force"][-1]
            left.plot(1e3 * np.array(own[name]["depth_m"]), force, line, color=f"C{k}", label=f"{name}, {variant}")
    left.set_xlim(0.0)
    left.set_xlabel("depth below the undisturbed surface [mm]")
    left.set_ylabel("force over the first push's last [-]")
    for one in runs:
        for name, said in (("pressed", "foot in"), ("left", "after lift-off"), ("end", "foot in again")):
            right.plot(*(1e3 * np.array(one[name][key]) for key in ("x_m", "height_m")), label=f"continuum, {said}")
    right.set_xlabel("x from the foot's middle [mm]")
    right.set_ylabel("height of the surface [mm]")


def _draw_blade(left: Any, right: Any, measured: Measured, runs: list[dict[str, Any]]) -> None:
    """Drag over travel, in units of that without a heap, and the surface after parts of the way."""
    for one in runs:
        force = -np.array(one["force_N_m"])[:, 0] / one["start_N_m"]
        left.plot(1e3 * np.array(one["way_m"]), force, label="continuum")
    for variant, line in zip(VARIANTS, ("--", ":"), strict=False):
        own = measured[f"blade/{variant}"]
        travel, drag = np.array(own["travel_m"]), np.array(own["drag"])
        start = drag[travel <= 0.05 * travel[-1]].mean()
        left.plot(1e3 * travel, drag / start, line, color="k", label=variant)
    left.set_xlabel("travel [mm]")
    left.set_ylabel("drag over that without a heap [-]")
    for one in runs:
        for way, surface in zip(one["travel_m"], one["surfaces"], strict=True):
            x, height = (1e3 * np.array(surface[key]) for key in ("x_m", "height_m"))
            right.plot(x, height, label=f"continuum, {1e3 * way:.0f} mm")
    right.set_xlabel("x from the blade's face [mm]")
    right.set_ylabel("height of the surface [mm]")
