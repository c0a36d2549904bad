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


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """The job that reads the campaign, where it is there."""
    return shipped("slopes", compare)


def compare(results: Results) -> list[dict[str, Any]]:
    """Each plate on a slope: resistance over that on level ground, by continuum and by convention and law [-].

    The error of the whole force, over its size on level ground, is there for the table of the continuum's own forces.
    """
    found = {Slope(**one["slope"]): np.array(one["force"]) for one in results}
    whole = [job for job in found if job.slope != 0.0 and job.as_to_gravity in found]
    return [_case(job, found) for job in sorted(whole, key=lambda job: (abs(job.slope), job.gamma, job.slope, job.beta))]


def _case(job: Slope, found: dict[Slope, Array]) -> dict[str, Any]:
    theta, force, level = np.radians(job.slope), found[job], found[job.as_to_surface]
    turned = found[job.as_to_gravity] * ([-1.0, 1.0] if job.turned_back else [1.0, 1.0]) @ _turn(theta).T
    ratios: dict[str, dict[str, float]] = {CONTINUUM: {}} | {law: {} for law in LAWS}
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


def missed(cases: list[dict[str, Any]], law: str, name: str) -> float:
    """Root mean square of a convention's errors with a law, over the force on level ground [-]."""
    off = [case["ratios"][law][name] - case["continuum"] for case in cases]
    return float(np.sqrt(np.mean(np.square(off))))


def rows(measured: Measured) -> list[Row]:
    """The rows of the continuum's resistance by direction, and of what each convention misses."""
    cases = outcome(measured, "slopes") or []
    table = []
    for slope, name in sorted({(abs(case["slope"]), direction(case)) for case in cases}):
        own = [case for case in cases if (abs(case["slope"]), direction(case)) == (slope, name)]
        got, expected = (
            float(np.mean(some)) for some in zip(*((_by(case, DEFAULT), case["continuum"]) for case in own), strict=True)
        )
        what = f"{slope:g}°, {name}: resistance over level ground, {DEFAULT}"
        table.append(Row(what, got, f"our continuum, mean of {len(own)} plates", expected=expected))
    for law, said in ({CONTINUUM: "our continuum's own forces on level ground"} | {law: law for law in LAWS}).items():
        for name in CONVENTIONS if cases else ():
            what = f"{name}: error of {said}, root mean square"
            table.append(Row(what, 100 * missed(cases, law, name), f"our continuum, {len(cases)} plates", unit="%"))
    return table


def _by(case: dict[str, Any], name: str) -> float:
    found: float = case["ratios"]["rft3d"][name]
    return found
