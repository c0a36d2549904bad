"""RFT on a slope against the continuum that ships with it: which depth and which "up" the laws should take.

Computes no continuum: reads the campaign `slopes` of `rftsim_mpm/data`. All forces are over what the same plate meets
on level ground as it lies and moves to the surface, so that conventions are compared and not the laws' scales.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from rftsim_mpm.body import plane_rotation
from rftsim_mpm.shapes import box
from rftsim_mpm.slope import Slope

from rftsim.law.rigid import surface_force
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, make_surface
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, at_most

LAWS: Final = ("rft3d", "rft2d")
"""Laws that the conventions are tried with."""
CONTINUUM: Final = "level"
"""Name of the law that a table of the continuum's own forces on level ground is."""


class Convention(NamedTuple):
    """A choice of what is depth and what is up on a slope."""

    leans: bool
    """Whether up is the surface's normal, not gravity's."""
    vertical: bool
    """Whether depth is measured along gravity, not along the normal."""
    across: bool = False
    """Whether the stress grows with the gravity that is left across the surface."""

    def factor(self, slope: float) -> float:
        """Factor on the stress at a depth along the normal, for a slope [rad]."""
        cos = float(np.cos(slope))
        return (1.0 / cos if self.vertical else 1.0) * (cos if self.across else 1.0)


SURFACE_S: Final = "surface's up, depth along normal"
"""Name of the convention that knows no slope."""
GRAVITY_S: Final = "gravity's up, vertical depth"
"""Name of its opposite."""
CONVENTIONS: Final = {
    SURFACE_S: Convention(True, False),
    "surface's up, vertical depth": Convention(True, True),
    "gravity's up, depth along normal": Convention(False, False),
    GRAVITY_S: Convention(False, True),
    "surface's up, depth along normal, times cos θ": Convention(True, False, True),
}
"""Conventions by name."""
PLACE: Final = ("slope", "beta", "gamma")
"""Names of what tells plates in the same sand apart."""
VARIED: Final = {"cells": "{:g} cells", "dim": "{:d} dimensions", "mu_int": "μ_int {:g}"}
"""What is varied to tell what it changes, and how it is said."""
SAID: Final = {CONTINUUM: "continuum's own forces on level ground", **{law: law for law in LAWS}}
"""What the laws are called in tables."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads the campaign, where it is there."""
    return shipped("slopes", compare)


def compare(results: Results) -> dict[str, list[dict[str, Any]]]:
    """Resistance of each plate on a slope, over that on level ground [-]: `cases` by convention and law, and `others`.

    `cases` also have the error of the whole force, over its size on level ground, where the law is the continuum's own
    forces there. `others` are plates for which nothing lies on level ground as they do to gravity: in other cells, in
    space, in other sand, to tell what these change.
    """
    found = {Slope(**one["slope"]): np.array(one["force"]) for one in results}
    jobs = sorted(
        (job for job in found if job.slope and job.as_to_surface in found),
        key=lambda job: (abs(job.slope), job.gamma, job.slope, job.beta),
    )
    return {
        "cases": [_known(job, found) | _guessed(job, found) for job in jobs if job.as_to_gravity in found],
        "others": [_known(job, found) for job in jobs if job.as_to_gravity not in found],
    }


def _known(job: Slope, found: dict[Slope, Array]) -> dict[str, float]:
    ratio = float((found[job] @ job.direction) / (found[job.as_to_surface] @ job.direction))
    return {name: getattr(job, name) for name in (*PLACE, *VARIED)} | {"continuum": ratio}


def _guessed(job: Slope, found: dict[Slope, Array]) -> dict[str, Any]:
    theta, force, level = np.radians(job.slope), found[job], found[job.as_to_surface]
    image = [-1.0, 1.0] if job.turned_back else [1.0, 1.0]
    turned = found[job.as_to_gravity] * image @ plane_rotation(theta)
    ratios: dict[str, dict[str, float]] = {law: {} for law in (CONTINUUM, *LAWS)}
    errors = {}
    for name, convention in CONVENTIONS.items():
        guess = (level if convention.leans else turned) * convention.factor(theta)
        errors[name] = float(np.linalg.norm(guess - force) / np.linalg.norm(level))
        ratios[CONTINUUM][name] = float((guess @ job.direction) / (level @ job.direction))
        for law in LAWS:
            own = convention.factor(theta) * resistance(job, law, leans=convention.leans)
            ratios[law][name] = own / resistance(job, law, leans=True)
    return {"ratios": ratios, "errors": errors}


def resistance(job: Slope, law: str, *, leans: bool) -> float:
    """Resistance of a law of unit strength to a plate per metre of width, at depths along the normal [m^2].

    Args:
        job: The plate on its slope.
        law: The law's name.
        leans: Whether up is the surface's normal, not gravity's.
    """
    shape = box(job.length, 1.0, job.thick)
    surface = make_surface(shape.vertices, shape.faces)
    turn = np.eye(3) if leans else _in_space(plane_rotation(np.radians(job.slope)))
    rotation, motion = _in_space(job.rotation), np.array([job.direction[0], 0.0, job.direction[1]])
    depth = job.z + 0.5 * job.thick * job.leading[-1] - (surface.centres @ rotation.T)[:, 2]
    sand = Sand(xi_n=1.0, zeta=1.0, mu_surf=job.mu_surf)
    place = {"position": (0.0, 0.0, -1.0), "rotation": turn @ rotation, "velocity": turn @ motion}
    state = surface_force(surface, sand, law, **place)
    force = (surface.areas * depth / state.depth) @ state.stress
    return -float(force @ turn @ motion)


def _in_space(plane: Array) -> Array:
    """Return a rotation of x and z as one of space, shape (3, 3)."""
    (a, b), (c, d) = plane
    return np.array([[a, 0.0, b], [0.0, 1.0, 0.0], [c, 0.0, d]])


def direction(case: dict[str, Any]) -> str:
    """Name of a plate's motion on its slope."""
    gamma, slope = case["gamma"], case["slope"]
    if gamma == 90.0:
        return "in along the normal"
    if gamma + slope == 90.0:
        return "straight down"
    way = "dragged" if gamma == 0.0 else "obliquely in" if gamma > 0.0 else "obliquely out"
    return f"{way}, {'down' if slope > 0.0 else 'up'}hill"


def grouped(cases: list[dict[str, Any]]) -> dict[tuple[float, str], list[dict[str, Any]]]:
    """Return the cases by slope [deg] and direction."""
    groups: dict[tuple[float, str], list[dict[str, Any]]] = {}
    for case in cases:
        groups.setdefault((abs(case["slope"]), direction(case)), []).append(case)
    return groups


def missed(cases: list[dict[str, Any]], law: str, name: str) -> float:
    """Root mean square of a convention's errors with a law, over the resistance on level ground [-]."""
    off = [case["ratios"][law][name] - case["continuum"] for case in cases]
    return float(np.sqrt(np.mean(np.square(off))))


def left_over(cases: list[dict[str, Any]]) -> tuple[float, float, float]:
    """Fit 1 - a sin(theta) v.e - b sin(theta)^2 to the resistance over level ground, v along the motion, e downhill.

    Returns:
        a and b, and the root mean square of what the fit misses [-].
    """
    sines = np.array([np.sin(np.radians(case["slope"])) for case in cases])
    along = sines * np.array([np.cos(np.radians(case["gamma"])) for case in cases])
    basis, lost = np.column_stack([along, sines**2]), 1.0 - np.array([case["continuum"] for case in cases])
    (a, b), *_ = np.linalg.lstsq(basis, lost, rcond=None)
    return float(a), float(b), float(np.sqrt(np.mean((lost - basis @ [a, b]) ** 2)))


def rows(measured: Measured) -> list[Row]:
    """The rows of the continuum's resistance by direction, and of what each convention misses."""
    found = outcome(measured, "slopes")
    if not found:
        return []
    cases = found["cases"]
    return [*_direction_rows(cases), *_error_rows(cases), *_other_rows(cases, found["others"])]


def _direction_rows(cases: list[dict[str, Any]]) -> list[Row]:
    table = []
    for (slope, name), own in grouped(cases).items():
        got = float(np.mean([case["continuum"] for case in own]))
        other = np.mean([case["ratios"]["rft3d"][GRAVITY_S] for case in own])
        what = f"continuum: {slope:g}°, {name}: resistance over level ground"
        note = f"rft3d, {GRAVITY_S}: {other:.2f}; plates: {len(own)}"
        table.append(Row(what, got, f"{SURFACE_S}, by definition", expected=1.0, note=note))
    return table


def _error_rows(cases: list[dict[str, Any]]) -> list[Row]:
    table, source = [], f"our continuum, {len(cases)} plates"
    for law, said in SAID.items():
        for name, convention in CONVENTIONS.items():
            if convention.leans and law != CONTINUUM:
                continue  # every law is over itself then
            what = f"{'any law' if convention.leans else said}; {name}: RMS error of the resistance over level ground"
            table.append(Row(what, 100 * missed(cases, law, name), source, unit="%"))
    for name in CONVENTIONS:
        off = float(np.sqrt(np.mean([case["errors"][name] ** 2 for case in cases])))
        table.append(Row(f"{SAID[CONTINUUM]}; {name}: of the whole force", 100 * off, source, unit="%"))
    a, b, off = left_over(cases)
    what = f"continuum: 1 - {a:.2f} sin θ v·e - {b:.2f} sin² θ, fitted: RMS error of the resistance over level ground"
    table.append(Row(what, 100 * off, source, unit="%", note="v the motion, e downhill along the surface"))
    share = missed(cases, "rft3d", SURFACE_S) / missed(cases, "rft3d", GRAVITY_S)
    table.append(at_most(f"rft3d: error, {SURFACE_S}, over that of {GRAVITY_S}", share, 1.0, source))
    return table


def _other_rows(cases: list[dict[str, Any]], others: list[dict[str, Any]]) -> list[Row]:
    """The rows of what cells, a third dimension and other sand do to the resistance over level ground."""
    table = []
    for one in others:
        (same,) = (case for case in cases if all(case[name] == one[name] for name in PLACE))
        new, old = (
            ", ".join(text.format(which[name]) for name, text in VARIED.items() if one[name] != same[name])
            for which in (one, same)
        )
        what = f"continuum: {abs(one['slope']):g}°, {direction(one)}, β {one['beta']:g}°, {new}"
        source = f"the same, {old}"
        table.append(Row(what, one["continuum"], source, expected=same["continuum"]))
    return table


def draw(measured: Measured, figure: Any) -> None:
    """Draw the resistance by direction for each slope, of continuum and conventions, and what each misses."""
    cases = (outcome(measured, "slopes") or {"cases": []})["cases"]
    slopes = sorted({abs(case["slope"]) for case in cases})
    axes = np.atleast_1d(figure.subplots(1, len(slopes) + 1))
    for axis, slope in zip(axes, slopes, strict=False):
        _draw_ratios(axis, {name: own for (angle, name), own in grouped(cases).items() if angle == slope})
        axis.set_title(f"slope of {slope:g}°", fontsize=10)
    places = np.arange(len(CONVENTIONS))
    for k, (law, said) in enumerate(SAID.items() if cases else ()):
        axes[-1].barh(places + 0.27 * (k - 1), [missed(cases, law, name) for name in CONVENTIONS], 0.25, label=said)
    axes[-1].set_yticks(places, [name.replace(", ", ",\n") for name in CONVENTIONS], fontsize=7)
    axes[-1].invert_yaxis()
    axes[-1].set_xlabel("RMS error of the resistance over level ground [-]")
    shown = [pair for axis in (axes[0], axes[-1]) for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    if cases:
        figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=len(shown), fontsize=8)


def _draw_ratios(axis: Any, groups: dict[str, list[dict[str, Any]]]) -> None:
    """Draw each plate's resistance over level ground, a row for each direction of motion."""
    for row, own in enumerate(groups.values()):
        for k, name in enumerate((SURFACE_S, GRAVITY_S)):
            some = [case["ratios"]["rft3d"][name] for case in own]
            label = f"rft3d, {name}" if row == 0 else None
            axis.plot(some, [row - 0.15 * (k + 1)] * len(own), "x", color=f"C{k}", label=label)
        label = "continuum" if row == 0 else None
        axis.plot([case["continuum"] for case in own], [row] * len(own), "ko", fillstyle="none", label=label)
    axis.set_yticks(range(len(groups)), list(groups), fontsize=7)
    axis.set_xlabel("resistance over that on level ground [-]")
    axis.axvline(1.0, color="0.6", lw=0.8)
