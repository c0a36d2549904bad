"""Dynamic RFT against the continuum that ships with it: plates at speed, the wheel and the runner, free to move.

Computes no continuum: reads the campaigns in `rftsim_mpm/data`, which say by what commands they were made.
"""

import functools
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from rftsim.run.rate_sweep import measure
from rftsim.validation.plates import fit_terms
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, at_least, near

RATES: Final = {"grouser-wheel": (10.0, 30.0, 60.0, 90.0), "four-flap-runner": (60.0, 100.0, 300.0)}
"""Rates of the shipped wheels, by scene [1/min]."""
DRAG: Final = (580.0, 1.1)
"""K [N/m^2] and lambda of [Agarwal] section 4.7."""
TRENDS: Final = (
    ("the wheel's v/(Rω) at 10 over at 90 RPM", "grouser-wheel", "rolling", 10.0, 90.0, "[Agarwal] Fig. 4-7"),
    ("the wheel's sinkage at 90 over at 10 RPM", "grouser-wheel", "sinkage", 90.0, 10.0, "[Agarwal] Fig. 4-7"),
    ("the runner's sinkage at 100 over at 300 RPM", "four-flap-runner", "sinkage", 100.0, 300.0, "[Agarwal] Fig. 4-9"),
)
"""Ratios of a quantity at two rates that exceed one: description, scene, quantity, upper and lower rate, source."""
UNSTEADY: Final = 0.05
"""Relative change of the speed, over the time of the means, from which on a reader is told of it [-]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """Jobs that read what is shipped, and jobs that step the law at the same rates."""
    laws = {
        f"{scene}/drft2d/{rpm:g}": functools.partial(_law, scene, rpm) for scene, own in RATES.items() for rpm in own
    }
    return shipped("rates", _plates) | shipped("wheels", _wheels) | laws


def _law(scene: str, rpm: float) -> dict[str, float]:
    point = measure(scene, "drft2d", rpm)
    return {"rolling": 1.0 - point.slip, "sinkage": point.sinkage}


def _plates(results: Results) -> list[dict[str, float]]:
    kept = ("rho", "length", "depth", "speed", "buried")
    return [{name: one["plate"][name] for name in kept} | {"force": -one["force"][0]} for one in results]


def _wheels(results: Results) -> list[dict[str, Any]]:
    table = []
    for one in results:
        wheel = one["wheel"]
        outer, omega = wheel["radius"] + wheel["height"], wheel["rpm"] * np.pi / 30.0
        table.append(
            {
                "scene": "grouser-wheel" if wheel["grousers"] > 4 else "four-flap-runner",
                "rpm": wheel["rpm"],
                "rolling": 1.0 - one["slip"],
                "sinkage": one["sinkage_m"] / (2.0 * outer),
                "drift": one["drift"],
                "drop": one["surface_drop_m"],
                "expected_drop": float((outer * omega) ** 2 / wheel["gravity"]),
            }
        )
    return sorted(table, key=lambda one: (list(RATES).index(one["scene"]), one["rpm"]))


def rows(measured: Measured) -> list[Row]:
    """The rows of the continuum against the source's fits, and of the law against the continuum."""
    return [*_plate_rows(outcome(measured, "rates") or []), *_wheel_rows(measured, outcome(measured, "wheels") or [])]


def _fit(plates: list[dict[str, float]]) -> tuple[float, float]:
    """Fit K [N/m^2] and lambda [-] of F = K z + lambda rho L v^2."""
    rho, length, speed, depth, force = (
        np.array([one[name] for one in plates]) for name in ("rho", "length", "speed", "depth", "force")
    )
    return fit_terms(depth, rho * length * speed**2, force)


def _plate_rows(plates: list[dict[str, float]]) -> list[Row]:
    table = []
    for travel in sorted({one["buried"] for one in plates}):
        stiffness, inertia = _fit([one for one in plates if one["buried"] == travel])
        what, source = f"continuum: drag after {travel:g} L of travel", "[Agarwal] section 4.7"
        table += [
            near(f"{what}: K", stiffness, DRAG[0], 0.15 * DRAG[0], source, unit="N/m²", note="μ_int is not given: 0.4"),
            near(f"{what}: λ", inertia, DRAG[1], 0.3, source, note="a fast plate heaps up sand ahead of itself"),
        ]
    return table


def _wheel_rows(measured: Measured, wheels: list[dict[str, Any]]) -> list[Row]:
    table = []
    for one in wheels:
        law = measured[f"{one['scene']}/drft2d/{one['rpm']:g}"]
        what = f"{one['scene']} at {one['rpm']:g} RPM: DRFT's"
        note = f"not steady: {100 * one['drift']:+.0f} %" if abs(one["drift"]) > UNSTEADY else ""
        for name, said in (("rolling", "v/(Rω)"), ("sinkage", "sinkage/ℓ")):
            expected = one[name]
            table.append(near(f"{what} {said}", law[name], expected, 0.15 * expected, "our continuum", note=note))
        if one["scene"] == "grouser-wheel":
            drop = one["expected_drop"]
            what = f"continuum: δh behind the wheel at {one['rpm']:g} RPM"
            table.append(near(what, 1e3 * one["drop"], 1e3 * drop, 150.0 * drop, "[Agarwal]: r²ω²/g", unit="mm"))
    for what, scene, name, slow, fast, source in TRENDS:
        own = {one["rpm"]: one[name] for one in wheels if one["scene"] == scene}
        if slow in own and fast in own:
            table.append(at_least(f"continuum: {what}", own[slow] / own[fast], 1.0, source))
    return table


def draw(measured: Measured, figure: Any) -> None:
    """Draw drag over speed, and rolling and sinkage of both wheels over their rate."""
    left, middle, right = figure.subplots(1, 3)
    dragged = outcome(measured, "rates") or []
    for travel, fill in zip(sorted({one["buried"] for one in dragged}), ("none", "full"), strict=False):
        for k, depth in enumerate(sorted({one["depth"] for one in dragged})):
            some = sorted((o["speed"], o["force"]) for o in dragged if (o["buried"], o["depth"]) == (travel, depth))
            label = f"continuum, {1e3 * depth:g} mm, after {travel:g} L"
            left.plot(*np.array(some).T, "o", color=f"C{k}", fillstyle=fill, label=label)
    v = np.linspace(0.0, max((one["speed"] for one in dragged), default=1.0), 50)
    for k, (depth, unit) in enumerate(sorted({(one["depth"], one["rho"] * one["length"]) for one in dragged})):
        said = "$K|z|+\\lambda\\rho L v^2$, [Agarwal]" if k == 0 else None
        left.plot(v, DRAG[0] * depth + DRAG[1] * unit * v**2, "--", color=f"C{k}", label=said)
    left.set_xlabel("speed [m/s]")
    left.set_ylabel("drag per width [N/m]")
    wheels = outcome(measured, "wheels") or []
    for k, scene in enumerate(RATES):
        own = [one for one in wheels if one["scene"] == scene]
        rpm = [one["rpm"] for one in own]
        law = [measured[f"{scene}/drft2d/{rate:g}"] for rate in RATES[scene]]
        for axis, name in ((middle, "rolling"), (right, "sinkage")):
            axis.plot(rpm, [one[name] for one in own], "o", color=f"C{k}", label=f"{scene}, continuum")
            axis.plot(RATES[scene], [one[name] for one in law], "--", color=f"C{k}", label=f"{scene}, drft2d")
    middle.set_ylabel("rolling  $v/(R\\omega)$ [-]")
    right.set_ylabel("sinkage  $z/\\ell$ [-]")
    for axis in (middle, right):
        axis.set_xlabel("rate [1/min]")
        axis.set_ylim(0.0)
    for axis in (left, middle, right):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.suptitle("Dynamic RFT and the continuum in plane strain")
