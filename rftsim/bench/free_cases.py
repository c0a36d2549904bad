"""Hard cases of free bodies: dropped on the sand, on a slope, and leaving the sand to come back."""

from collections.abc import Callable
from typing import Final

import numpy as np

from rftsim.bench.trials import (
    REST,
    SAND,
    Force,
    HardCase,
    Judged,
    Quantities,
    Trial,
    free_body,
    leave_alone,
    make_spec,
    plate,
    sphere,
)
from rftsim.sand.free_surface import FreeSurface


def _drop(says: str, geom: str, below: float, exact: float | None = None) -> HardCase:
    """Make the case of a body dropped from 50 mm, its centre `below` [m] above its lowest point."""

    def build(h: float, force: Force) -> Trial:
        return Trial(make_spec(free_body(geom, "0 0 .05")), h, force)

    def play(trial: Trial) -> Quantities:
        trial.run(0.4)
        depth = 1e3 * (below - trial.data.qpos[2])
        return {"depth": depth} | leave_alone(trial)

    return HardCase(says, build, play, {"depth": Judged("mm", exact=exact)} | REST)


def plate_depth(mass: float, area: float, fall: float) -> float:
    """Depth [m] at which a flat plate that falls comes to rest: m g (H + z) = xi_n alpha_z A z^2 / 2."""
    weight, stiffness = mass * 9.81, float(SAND.zeta or 0.0) * area
    return float((weight + np.sqrt(weight**2 + 2 * stiffness * weight * fall)) / stiffness)


def _build_leaving(law: str) -> Callable[[float, Force], Trial]:
    def build(h: float, force: Force) -> Trial:
        model = make_spec(free_body(sphere(0.5), "0 0 0"))
        trial = Trial(model, h, force, law=law, sand=SAND.replace(lambda_=1.4))
        trial.data.qvel[:3] = 0.5, 0.0, 3.0
        return trial

    return build


def _play_re_entry(trial: Trial) -> Quantities:
    trial.run(1.5)
    return {"depth": 1e3 * (0.05 - trial.data.qpos[2]), "travel": 1e3 * trial.data.qpos[0]}


def _build_slope(h: float, force: Force) -> Trial:
    slope = np.array([-0.3, 0.0, 1.0])
    terrain = FreeSurface(normal=tuple(slope / np.linalg.norm(slope)))
    return Trial(make_spec(free_body(plate(0.3), "0 0 .03")), h, force, terrain=terrain)


def _play_slope(trial: Trial) -> Quantities:
    trial.run(1.0)
    x, z = 1e3 * trial.data.qpos[0], 1e3 * trial.data.qpos[2]
    return {"slip": x, "height": z} | leave_alone(trial)


DROPPED: Final = {
    "plate": _drop(
        "a flat 20 g plate dropped by 45 mm: crosses its depth in 3 ms",
        plate(0.02),
        0.005,
        exact=1e3 * plate_depth(0.02, 0.01, 0.045),
    ),
    "heavy sphere": _drop("1.5 kg, dropped from the surface", sphere(1.5), 0.05),
    "light sphere": _drop("20 g, dropped from the surface", sphere(0.02), 0.05),
}
"""Bodies that are dropped on level sand and left alone."""

THROWN: Final = {
    "re-entry": HardCase(
        "a sphere leaves the sand at 3 m/s and comes back",
        _build_leaving("rft3d"),
        _play_re_entry,
        {"depth": Judged("mm"), "travel": Judged("mm")},
    ),
    "re-entry, dynamic law": HardCase(
        "the same under drft3d, lambda 1.4",
        _build_leaving("drft3d"),
        _play_re_entry,
        {"depth": Judged("mm"), "travel": Judged("mm")},
    ),
}
"""Bodies that leave the sand and come back."""

SLOPE: Final = {
    "slope": HardCase(
        "a plate dropped on a slope of 17 degrees",
        _build_slope,
        _play_slope,
        {"slip": Judged("mm"), "height": Judged("mm")} | REST,
    ),
}
"""A body that is dropped on a slope and left alone."""
