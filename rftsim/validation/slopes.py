"""RFT on a slope against the continuum that ships with it: which depth and which "up" the laws should take.

Computes no continuum: reads the campaign `slopes` of `rftsim_mpm/data`. All forces are over what the same plate meets
on level ground as it lies and moves to the surface, so that conventions are compared and not the laws' scales.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from rftsim_mpm.shapes import box
from rftsim_mpm.slope import Slope

from rftsim.law.rigid import surface_force
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, make_surface
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row

LAWS: Final = ("rft3d", "rft2d")
"""Laws that the conventions are tried with."""
CONTINUUM: Final = "level"
"""Name of the law that a table of the continuum's own forces on level ground is."""


class Convention(NamedTuple):
    """What a law takes for depth and for up on a slope."""

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


CONVENTIONS: Final = {
    "surface's up, depth along normal": Convention(True, False),
    "surface's up, vertical depth": Convention(True, True),
    "gravity's up, depth along normal": Convention(False, False),
    "gravity's up, vertical depth": Convention(False, True),
    "surface's up, depth along normal, times cos θ": Convention(True, False, True),
}
"""Conventions by name."""
SHOWN: Final = ("surface's up, depth along normal", "gravity's up, vertical depth")
"""Conventions that are shown direction by direction."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads the campaign, where it is there."""
    return shipped("slopes", compare)


def compare(results: Results) -> list[dict[str, Any]]:
    """Each plate on a slope: resistance over that on level ground, by continuum and by convention and law [-].

    The error of the whole force, over its size on level ground, is there for the table of the continuum's own forces.
    """
    found = {Slope(**one["slope"]): np.array(one["force"]) for one in results}
    whole = [job for job in found if job.slope != 0.0 and job.as_to_gravity in found]
    return [
        _case(job, found) for job in sorted(whole, key=lambda job: (abs(job.slope), job.gamma, job.slope, job.beta))
    ]


def _case(job: Slope, found: dict[Slope, Array]) -> dict[str, Any]:
    theta, force, level = np.radians(job.slope), found[job], found[job.as_to_surface]
    turned = found[job.as_to_gravity] * ([-1.0, 1.0] if job.turned_back else [1.0, 1.0]) @ _turn(theta).T
    ratios: dict[str, dict[str, float]] = {law: {} for law in (CONTINUUM, *LAWS)}
    errors = {}
    for name, convention in CONVENTIONS.items():
        guess = (level if convention.leans else turned) * convention.factor(theta)
        errors[name] = float(np.linalg.norm(guess - force) / np.linalg.norm(level))
        ratios[CONTINUUM][name] = float((guess @ job.direction) / (level @ job.direction))
    for law in LAWS:
        straight = resistance(job, law, leans=True)
        for name, convention in CONVENTIONS.items():
            own = resistance(job, law, leans=convention.leans) * convention.factor(theta)
            ratios[law][name] = own / straight
    return {
        **{name: getattr(job, name) for name in ("slope", "beta", "gamma", "cells")},
        "continuum": float((force @ job.direction) / (level @ job.direction)),
        "ratios": ratios,
        "errors": errors,
        "force": (force / np.linalg.norm(level)).tolist(),
        "level": (level / np.linalg.norm(level)).tolist(),
    }


def _turn(theta: float) -> Array:
    """Rotation by which a row of the surface's axes x and z becomes one of gravity's, shape (2, 2)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, s], [-s, c]]).T


def resistance(job: Slope, law: str, *, leans: bool) -> float:
    """Resistance of a law to a plate at depths along the normal, for either up, of unit strength [m^3].

    Args:
        job: The plate on its slope.
        law: The law's name.
        leans: Whether up is the surface's normal.
    """
    shape = box(job.length, 1.0, job.thick)
    surface = make_surface(shape.vertices, shape.faces)
    theta = 0.0 if leans else np.radians(job.slope)
    to_up = _in_space(_turn(theta).T)
    rotation, direction = _in_space(job.rotation), np.array([job.direction[0], 0.0, job.direction[1]])
    middle = job.z + 0.5 * job.thick * job.leading[-1]
    depth = middle - (surface.centres @ rotation.T)[:, 2]
    sand = Sand(xi_n=1.0, zeta=1.0, mu_surf=job.mu_surf)
    place = {"position": (0.0, 0.0, -1.0), "rotation": to_up @ rotation, "velocity": to_up @ direction}
    state = surface_force(surface, sand, law, **place)
    force = (surface.areas * depth / state.depth) @ state.stress
    return -float(force @ to_up @ direction)


def _in_space(plane: Array) -> Array:
    """A rotation of x and z as one of space, shape (3, 3)."""
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
    """Root mean square of a convention's errors with a law, over the force on level ground [-]."""
    off = [case["ratios"][law][name] - case["continuum"] for case in cases]
    return float(np.sqrt(np.mean(np.square(off))))


def rows(measured: Measured) -> list[Row]:
    """The rows of the continuum's resistance by direction, and of what each convention misses."""
    cases = outcome(measured, "slopes") or []
    if not cases:
        return []
    table = []
    for (slope, name), own in grouped(cases).items():
        expected, source = float(np.mean([case["continuum"] for case in own])), f"our continuum, {len(own)} plates"
        for convention in SHOWN:
            got = float(np.mean([case["ratios"]["rft3d"][convention] for case in own]))
            what = f"{slope:g}°, {name}: resistance over level ground, {convention}"
            table.append(Row(what, got, source, expected=expected))
    source = f"our continuum, {len(cases)} plates"
    for law, said in {CONTINUUM: "the continuum's forces on level ground", **{law: law for law in LAWS}}.items():
        for name in CONVENTIONS:
            table.append(Row(f"{said}, {name}: RMS error", 100 * missed(cases, law, name), source, unit="%"))
    return table


def draw(measured: Measured, figure: Any) -> None:
    """Draw the resistance by direction for each slope, of continuum and conventions, and what each misses."""
    cases = outcome(measured, "slopes") or []
    slopes = sorted({abs(case["slope"]) for case in cases})
    axes = figure.subplots(1, len(slopes) + 1)
    for axis, slope in zip(axes, slopes, strict=False):
        _draw_ratios(axis, {name: own for (angle, name), own in grouped(cases).items() if angle == slope})
        axis.set_title(f"slope of {slope:g}°, rft3d")
    places, laws = np.arange(len(CONVENTIONS)), (CONTINUUM, *LAWS)
    for k, law in enumerate(laws if cases else ()):
        label = "continuum's own forces on level ground" if law == CONTINUUM else law
        axes[-1].barh(places + 0.27 * (k - 1), [missed(cases, law, name) for name in CONVENTIONS], 0.25, label=label)
    axes[-1].set_yticks(places, [name.replace(", ", ",\n") for name in CONVENTIONS], fontsize=7)
    axes[-1].invert_yaxis()
    axes[-1].set_xlabel("RMS error of the resistance over level ground [-]")
    axes[-1].legend(fontsize=7)


def _draw_ratios(axis: Any, groups: dict[str, list[dict[str, Any]]]) -> None:
    """Draw each plate's resistance over level ground, a row for each direction of motion."""
    for row, own in enumerate(groups.values()):
        for k, name in enumerate(SHOWN):
            some = [case["ratios"]["rft3d"][name] for case in own]
            label = name if row == 0 else None
            axis.plot(some, [row - 0.15 * (k + 1)] * len(own), "x", color=f"C{k}", label=label)
        label = "continuum" if row == 0 else None
        axis.plot([case["continuum"] for case in own], [row] * len(own), "ko", fillstyle="none", label=label)
    axis.set_yticks(range(len(groups)), list(groups), fontsize=7)
    axis.set_xlabel("resistance over that on level ground [-]")
    axis.axvline(1.0, color="0.6", lw=0.8)
    axis.legend(fontsize=6)
