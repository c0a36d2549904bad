"""The laws against a wheel that the continuum holds at a slip: at a sinkage, or free to sink under its load.

Computes no continuum: reads the campaigns `held` and `loaded` of `rftsim_mpm/data`, which say by what commands they
were made. How far these have converged is told beside them, by their cells and places on the grid.
"""

import dataclasses
import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
from rftsim_models.wheels import GROUSER_WHEEL
from rftsim_mpm.campaign import DATA, results
from rftsim_mpm.testbed import HeldWheel

from rftsim.law.rigid import surface_force
from rftsim.run.scenes import POPPY
from rftsim.surface.triangles import Wheel
from rftsim.validation.pockets import Grousers
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, near

LAWS: Final = ("rft2d", "drft2d")
"""Laws that are compared."""
SLIPS: Final = (-0.2, 0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
"""Slips of the shipped wheels [-]."""
SINKAGE: Final = 0.03
"""Sinkage at which the slip is varied [m]."""
HELD_SLIP: Final = 0.3
"""Slip at which cells and places on the grid are varied [-]."""
LOADED_SLIPS: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.6)
"""Slips of the shipped wheels that sink under their load [-]."""
LOAD: Final = HeldWheel.mass_z * HeldWheel.gravity / HeldWheel.breadth
"""That load, per metre of breadth [N/m]."""
RPM: Final = math.pi / 30.0
"""One turn a minute [rad/s]."""
RATE: Final = HeldWheel.rpm * RPM
"""Angular velocity of the wheels [rad/s]."""
NOTES: Final = ("no exact limit load without dilatancy, and means wander", "coarse cells, or means that wander")
"""What is said of the continuum where it has not converged, without and with friction that grows with the rate."""
PHASES: Final = 8
"""Phases of the wheel, within the angle between grousers, that the laws are averaged over."""
FORCES: Final = ("load_N_m", "drawbar_N_m", "torque_N")
"""What is compared, per metre of breadth, by the names that the continuum gives it."""
CELL: Final = 0.004
"""Size of the cells at which the slip is varied [m]."""
CONVERGED: Final = 0.05
"""Largest change from one size of cells to the next, or with the place on the grid, that counts as converged [-]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads what is shipped, and one for each law and slip."""
    laws = {f"{law}/{slip:g}": functools.partial(_law, law, slip, SINKAGE) for law in LAWS for slip in SLIPS}
    under = {f"loaded {law}/{slip:g}": functools.partial(_at_load, law, slip) for law in LAWS for slip in LOADED_SLIPS}
    behind = {
        _dropped(one, drop): functools.partial(_at_load, LAWS[-1], one["prescribed_slip"], one["rpm"] * RPM, drop)
        for one in _rears(_read_loaded(results(DATA / "loaded")) if (DATA / "loaded").exists() else [])
        for drop in _drops(one)
    }
    return shipped("held", _read) | shipped("loaded", _read_loaded) | laws | under | behind


def _rears(table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The wheels under their load that say where the sand leaves their rim, over the rate."""
    said = [one for one in table if one["rear_m"] is not None and one["mu_2"] == POPPY.mu_int]
    return sorted(said, key=operator.itemgetter("rpm"))


def _drops(one: dict[str, Any]) -> tuple[float, float]:
    """The drop of the surface behind by [Agarwal] section 4.6.2, and as a shipped wheel has it [m]."""
    return GROUSER_WHEEL.outer_radius**2 * (one["rpm"] * RPM) ** 2 / POPPY.g, one["rear_m"]


def _dropped(one: dict[str, Any], drop: float) -> str:
    """The name of the job of the dynamic law at a wheel's rate, with a drop behind it."""
    return f"behind {one['rpm']:g}/{drop:.5f}"


def _read(results: Results) -> list[dict[str, float]]:
    kept = ("prescribed_slip", "grousers", "mu_int", "dx", "shift")
    names = (*FORCES, *(f"{name}_noise" for name in FORCES))
    return [
        {n: one["heldwheel"][n] for n in kept}
        | {"mu_2": _fastest(one), "duration": one["heldwheel"]["duration"] or 0.0}
        | {n: one[n] for n in names}
        for one in results
    ]


def _fastest(one: dict[str, Any]) -> float:
    """Friction of a wheel's sand in its fastest flow: that at rest where it knows no rate [-]."""
    return float(one["heldwheel"].get("mu_2") or one["heldwheel"]["mu_int"])


def _read_loaded(results: Results) -> list[dict[str, Any]]:
    names = ("sinkage_m", "drawbar_N_m", "torque_N", "sinking_m")
    return [
        {n: one["heldwheel"][n] for n in ("prescribed_slip", "dx", "rpm")}
        | {"mu_2": _fastest(one), "rear_m": one.get("rear_m")}
        | {n: one[n] for n in names}
        for one in sorted(results, key=lambda one: (-one["heldwheel"]["dx"], one["heldwheel"]["prescribed_slip"]))
    ]


def _at_one_rate(measured: Measured) -> list[dict[str, float]]:
    """The wheels under their load that turn as fast as those at a sinkage."""
    return [one for one in outcome(measured, "loaded") or [] if one["rpm"] == HeldWheel.rpm]


def _at_load(law: str, slip: float, rate: float = RATE, drop: float | None = None) -> dict[str, float]:
    """The sinkage at which a law bears the wheel's load at a slip, and the forces there."""
    low, high = 0.0, GROUSER_WHEEL.outer_radius
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _law(law, slip, middle, rate, drop)["load_N_m"] < LOAD else (low, middle)
    return {"sinkage_m": high, **_law(law, slip, high, rate, drop)}


def _law(law: str, slip: float, sinkage: float, rate: float = RATE, drop: float | None = None) -> dict[str, float]:
    """The forces that a law gives on the wheel at a slip and a sinkage, a third of its grousers' height felt.

    A drop behind the wheel [m] that is not the law's own is that of another gravity, on which nothing else hangs.
    """
    own = GROUSER_WHEEL
    sand = POPPY if drop is None else dataclasses.replace(POPPY, g=(own.outer_radius * rate) ** 2 / drop)
    wheel = Grousers(own.radius, own.outer_radius, own.width, own.lugs, own.lug_width)
    surface = wheel.with_height(own.felt_height).surface
    surface = dataclasses.replace(surface, wheel=Wheel((0, 1, 0), (0, 0, 0), own.outer_radius))
    total = np.zeros(3)
    for phase in wheel.pitch * np.arange(PHASES) / PHASES:
        c, s = math.cos(phase), math.sin(phase)
        found = surface_force(
            surface, sand, law, position=(0.0, 0.0, own.outer_radius - sinkage),
            rotation=[[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            velocity=((1.0 - slip) * rate * own.outer_radius, 0.0, 0.0), angular_velocity=(0.0, rate, 0.0),
        )  # fmt: skip
        total += [found.force[2], found.force[0], -found.moment[1]]
    return dict(zip(FORCES, (total / PHASES / own.width).tolist(), strict=True))


def rows(measured: Measured) -> list[Row]:
    """The rows of the laws against the continuum, and of the continuum against finer cells of its own."""
    table = outcome(measured, "held") or []
    return [*_law_rows(measured, table), *_cell_rows(table), *_loaded_rows(measured), *_rear_rows(measured)]


def _over_slip(table: list[dict[str, float]]) -> list[dict[str, float]]:
    return sorted((o for o in _on_poppy_seeds(table) if o["dx"] == CELL), key=lambda o: o["prescribed_slip"])


def _on_poppy_seeds(table: list[dict[str, float]]) -> list[dict[str, float]]:
    """Wheels with grousers on sand of the poppy seeds' friction, which knows no rate."""
    return [o for o in table if o["grousers"] and o["mu_int"] == o["mu_2"] == POPPY.mu_int]


def _law_rows(measured: Measured, table: list[dict[str, float]]) -> list[Row]:
    """The rows of the dynamic law over the slip, to be read: nothing is promised of a wheel that heaps and digs."""
    law = LAWS[-1]
    return [
        Row(f"{law}, slip {one['prescribed_slip']:g}: {said}", got, "our continuum", unit, expected=expected)
        for one in _over_slip(table)
        for said, got, expected, unit, _ in _compared(measured[f"{law}/{one['prescribed_slip']:g}"], one)
    ]


def _loaded_rows(measured: Measured) -> list[Row]:
    """The rows of the dynamic law over the slip at a load, to be read, and of the continuum's finer cells."""
    table = _at_one_rate(measured)
    coarse = {(one["prescribed_slip"], one["mu_2"]): one for one in table if one["dx"] == CELL}
    rows = []
    for one in table:
        slip, sand = one["prescribed_slip"], "" if one["mu_2"] == POPPY.mu_int else f", μ(I) to {one['mu_2']:g}"
        if one["dx"] != CELL:
            what = f"continuum{sand}, {1e3 * one['dx']:g} mm"
            found, expected, source = one, coarse[slip, one["mu_2"]], "itself at 4 mm"
        elif sand:
            continue
        else:
            what, found, expected, source = LAWS[-1], measured[f"loaded {LAWS[-1]}/{slip:g}"], one, "our continuum"
        note = f"sinkage changes by {1e3 * one['sinking_m']:+.1f} mm meanwhile"
        for name, unit, factor in (("sinkage_m", "mm", 1e3), ("drawbar_N_m", "N/m", 1.0), ("torque_N", "N", 1.0)):
            said = f"{what}, under its load, slip {slip:g}: {name.partition('_')[0]}"
            rows.append(Row(said, factor * found[name], source, unit, expected=factor * expected[name], note=note))
    return rows


def _rear_rows(measured: Measured) -> list[Row]:
    """The rows of where the sand leaves the rim behind, over the rate, and of the dynamic law with either drop."""
    rows, law = [], LAWS[-1]
    for one in _rears(outcome(measured, "loaded") or []):
        own, read = _drops(one)
        what, note = f"{law}, {one['rpm']:g} RPM", f"sinkage of the continuum's {1e3 * one['sinkage_m']:.1f} mm"
        rows.append(Row(f"{what}: drop δh", 1e3 * own, "our continuum", "mm", expected=1e3 * read, note=note))
        for drop, whose in ((own, "its own δh"), (read, "the continuum's δh")):
            got, expected = measured[_dropped(one, drop)]["drawbar_N_m"], one["drawbar_N_m"]
            rows.append(Row(f"{what}, {whose}: drawbar", got, "our continuum", "N/m", expected=expected))
    return rows


def _cell_rows(table: list[dict[str, float]]) -> list[Row]:
    """The rows of each run against that of the next larger cells, or of the same half a cell aside."""
    rows = []
    names = ("grousers", "mu_int", "mu_2", "duration")
    for kind in sorted({tuple(one[name] for name in names) for one in table}):
        own = [o for o in table if tuple(o[name] for name in names) == kind and o["prescribed_slip"] == HELD_SLIP]
        grousers, mu, mu_2, duration = kind
        sand = (f"μ_int {mu:g}" if mu_2 == mu else f"μ(I) from {mu:g} to {mu_2:g}") + (", longer" if duration else "")
        for before, after, how in _pairs(own):
            what = f"continuum, {'wheel' if grousers else 'disc'}, {sand}, {how}"
            for said, got, expected, unit, size in _compared(after, before):
                within = CONVERGED * size
                note = NOTES[mu_2 != mu] if abs(got - expected) > within else ""
                rows.append(near(f"{what}: {said}", got, expected, within, "itself before", unit=unit, note=note))
    return rows


def _compared(got: Any, expected: Any) -> Iterator[tuple[str, float, float, str, float]]:
    """Each force's name, both its values and unit, and what differences count by: of the drawbar, the load."""
    sizes = expected["load_N_m"], expected["load_N_m"], expected["torque_N"]
    for name, size, unit in zip(FORCES, sizes, ("N/m", "N/m", "N"), strict=True):
        yield name.partition("_")[0], got[name], expected[name], unit, abs(size)


def _pairs(own: list[dict[str, float]]) -> list[tuple[dict[str, float], dict[str, float], str]]:
    """Runs of one wheel that should agree, and in what they differ."""
    level = sorted((one for one in own if not one["shift"]), key=lambda one: -one["dx"])
    found = [(a, b, f"cells {1e3 * a['dx']:.3g} to {1e3 * b['dx']:.3g} mm") for a, b in itertools.pairwise(level)]
    for one in own:
        if one["shift"]:
            same = next(other for other in level if other["dx"] == one["dx"])
            found.append((same, one, f"half a cell of {1e3 * one['dx']:.3g} mm aside"))
    return found


def draw(measured: Measured, figure: Any) -> None:
    """Draw load, drawbar and torque over the slip at a sinkage, and sinkage, drawbar and torque at a load."""
    axes = figure.subplots(2, 3)
    _draw_held(measured, axes[0])
    _draw_loaded(measured, axes[1])
    for axis in axes.flat:
        axis.set_xlabel("slip  $1 - v/(R\\omega)$ [-]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.suptitle(f"Grousered wheel, 30 RPM: held {1e3 * SINKAGE:g} mm deep, and under {LOAD:.0f} N/m")


def _draw_held(measured: Measured, axes: Any) -> None:
    table = outcome(measured, "held") or []
    coarse = _over_slip(table)
    names = ("load [N/m]", "drawbar [N/m]", "torque [N]")
    for axis, name, said in zip(axes, FORCES, names, strict=True):
        if coarse:
            slip, force, noise = (
                [one[column] for one in coarse] for column in ("prescribed_slip", name, f"{name}_noise")
            )
            axis.errorbar(slip, force, noise, fmt="ko", capsize=3, label=f"continuum, cells {1e3 * CELL:g} mm")
        finer = [one for one in _on_poppy_seeds(table) if one["dx"] < CELL]
        for one, mark in zip(sorted((o for o in finer if not o["shift"]), key=lambda o: -o["dx"]), "v^", strict=False):
            axis.plot(one["prescribed_slip"], one[name], f"C3{mark}", label=f"{1e3 * one['dx']:.3g} mm")
        for law, line in zip(LAWS, ("--", "-"), strict=True):
            axis.plot(SLIPS, [measured[f"{law}/{slip:g}"][name] for slip in SLIPS], f"C0{line}", label=law)
        axis.set_ylabel(said)


def _draw_loaded(measured: Measured, axes: Any) -> None:
    table = [one for one in _at_one_rate(measured) if one["mu_2"] == POPPY.mu_int]
    names = {"sinkage_m": "sinkage [m]", "drawbar_N_m": "drawbar [N/m]", "torque_N": "torque [N]"}
    for axis, (name, said) in zip(axes, names.items(), strict=True):
        for dx, mark in zip(sorted({one["dx"] for one in table}, reverse=True), ("ko", "C3v"), strict=False):
            points = [(one["prescribed_slip"], one[name]) for one in table if one["dx"] == dx]
            axis.plot(*np.array(points).T, mark, label=f"continuum, cells {1e3 * dx:.3g} mm")
        for law, line in zip(LAWS, ("--", "-"), strict=True):
            curve = [measured[f"loaded {law}/{slip:g}"][name] for slip in LOADED_SLIPS]
            axis.plot(LOADED_SLIPS, curve, f"C0{line}", label=law)
        axis.set_ylabel(said)
