"""The scaling law of driven wheels, [Slonaker2017]: whole simulations of wheel and runner at other scales.

g -> q g, lengths -> r, masses -> s, width -> s r^-2 of itself, omega -> (q / r)^1/2 give V -> (q r)^1/2 V and
P -> q^3/2 r^1/2 s P; in 3D, where the sides count, s = r^3.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from rftsim_models.wheels import FOUR_FLAP_RUNNER, GROUSER_WHEEL, SERVO, WHEEL, WheelParameters, build_wheel

from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.run.run import STEADY, run
from rftsim.run.scenes import POPPY, Staged
from rftsim.run.scenes import Measured as MeasuredBy
from rftsim.surface.triangles import Wheel
from rftsim.validation.study import Measured, Request, Row, at_most

TIMESTEP: Final = 5e-4
"""Time step of the unscaled cases [s]."""
TURNS: Final = 4.0
"""Turns that the means are over."""
NAMES: Final = ("speed", "sinkage", "power")
"""Quantities that are compared."""
LIMIT: Final = 0.1
"""Largest deviation from the scaling law that passes [%]."""


class Scale(NamedTuple):
    """Factors on gravity, lengths and masses."""

    q: float
    """Factor on gravity."""
    r: float
    """Factor on lengths."""
    s: float
    """Factor on masses."""


class Case(NamedTuple):
    """A driven wheel under a law, before it is scaled."""

    wheel: WheelParameters
    """The wheel on its carriage."""
    rpm: float
    """Imposed rate [1/min]."""
    law: str
    """The law's name."""
    lambda_: float
    """Inertial factor of the sand [-]."""
    structural: bool
    """Whether the sand's surface drops behind the wheel, as [Agarwal] B.1 has it."""


CASES: Final = {
    "wheel, rft2d": Case(GROUSER_WHEEL, 60.0, "rft2d", 1.0, True),
    "wheel, drft2d": Case(GROUSER_WHEEL, 60.0, "drft2d", 1.0, True),
    "wheel, drft3d": Case(GROUSER_WHEEL, 60.0, "drft3d", 1.0, True),
    "runner, drft2d": Case(FOUR_FLAP_RUNNER, 150.0, "drft2d", 4.0, False),
}
ONE: Final = Scale(1.0, 1.0, 1.0)
SCALES: Final = {
    "on the Moon": Scale(0.165, 1.0, 1.0),
    "half size": Scale(1.0, 0.5, 0.125),
    "thrice as large on Mars": Scale(0.38, 3.0, 27.0),
}


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """A job for every case at every scale, and at none."""
    chosen = [("", ONE), *SCALES.items()][:: 3 if request.quick else 1]
    return {
        f"{case}/{scale}": functools.partial(simulate, CASES[case], factors)
        for case in CASES
        for scale, factors in chosen
    }


def simulate(case: Case, scale: Scale) -> dict[str, float]:
    """Steady speed [m/s], sinkage [m] and power [W] of a case at a scale, each over what the law scales it by."""
    q, r, s = scale
    base = case.wheel
    wheel = dataclasses.replace(
        base,
        **{name: r * getattr(base, name) for name in ("radius", "lug_height", "lug_width")},
        width=s / r**2 * base.width,
        **{name: s * getattr(base, name) for name in ("vertical_mass", "horizontal_mass")},
        forward_force=q * s * base.forward_force,
        gravity=q * base.gravity,
    )
    time = float(np.sqrt(r / q))
    spec = build_wheel(wheel, case.rpm / time, gain=SERVO * q * s * r * time)
    spec.option.timestep = TIMESTEP * time
    sand = POPPY.replace(g=q * POPPY.g, lambda_=case.lambda_)
    wheels = {WHEEL: Wheel((0, 1, 0), (0, 0, 0), wheel.outer_radius)} if case.structural else {}
    bed = add_sand(spec, sand, case.law, max_edge=2 * wheel.width, wheels=wheels, **WHOLE)
    duration = TURNS * 60.0 / case.rpm / STEADY * time
    done = run(Staged(spec.compile(), bed, MeasuredBy(WHEEL, wheel.outer_radius), duration))
    last = slice(int(len(done.history.time) * (1 - STEADY)), None)
    return {
        "speed": done.steady.speed / np.sqrt(q * r),
        "sinkage": done.steady.sinkage / r,
        "power": float(done.history.power[last].mean()) / (q**1.5 * r**0.5 * s),
    }


def rows(measured: Measured) -> list[Row]:
    """The rows of each case's largest deviation from the scaling law."""
    source = "exact, [Slonaker2017]"
    found = []
    for case in CASES:
        off = max(max(_deviations(measured, case, name).values()) for name in NAMES)
        found.append(at_most(f"{case}: speed, sinkage, power, largest deviation", off, LIMIT, source, unit="%"))
    return found


def _deviations(measured: Measured, case: str, name: str) -> dict[str, float]:
    """Deviation of a quantity of a case from the unscaled one, by scale [%]."""
    base = measured[f"{case}/"][name]
    names = [scale for scale in SCALES if f"{case}/{scale}" in measured]
    return {scale: 100.0 * abs(measured[f"{case}/{scale}"][name] / base - 1.0) for scale in names}


def draw(measured: Measured, figure: Any) -> None:
    """Draw the deviation of each case at each scale, against the limit."""
    panels = figure.subplots(1, 3, sharey=True)
    for axis, name in zip(panels, NAMES, strict=True):
        for k, case in enumerate(CASES):
            off = _deviations(measured, case, name)
            places = np.arange(len(off)) + 0.15 * (k - 1.5)
            axis.semilogy(places, np.maximum(list(off.values()), 1e-9), "o", color=f"C{k}", label=case)
        axis.axhline(LIMIT, color="r", linestyle="--", label="limit")
        axis.set_xticks(range(len(off)), [label.replace(" on Mars", "\non Mars") for label in off])
        axis.set_title(name)
        axis.grid(alpha=0.3)
    panels[0].set_ylabel("deviation from the scaling law [%]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(CASES) + 1)
