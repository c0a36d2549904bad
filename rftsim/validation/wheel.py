"""The grousered wheel of [Agarwal] chapter 4 and its half-size twin: speed and sinkage over the imposed rate."""

import functools
import math
from collections.abc import Callable
from typing import Any, Final

from rftsim_models.wheels import GROUSER_WHEEL

from rftsim.run.rate_sweep import measure
from rftsim.run.scenes import POPPY
from rftsim.validation import balance, terramechanics
from rftsim.validation.study import Measured, Request, Row, at_least, at_most, near

WHEELS: Final = ("grouser-wheel", "half-grouser-wheel")
"""Scenes of the wheel and of its twin."""
LAWS: Final = ("rft2d", "drft2d")
RATES: Final = (2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0)
"""Imposed rates [1/min]."""
QUICK_RATES: Final = (10.0, 30.0, 90.0)
"""Imposed rates where fewer will do [1/min]."""
RULES: Final = {"one third": 1.0 / 3.0, "full grousers": 1.0, "least power": None}
"""Shares of their height that grousers keep, by rule; None where the cheaper flow decides."""
TWIN: Final = 90.0 / math.sqrt(2.0)
"""Rate of the wheel at which it must do as its half-size twin does at 90: r omega^2 / g is then the same [1/min]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """A job for every wheel, law and rate, and for every balance of forces."""
    rates = QUICK_RATES if request.quick else RATES
    found: dict[str, Callable[[], Any]] = {
        f"{scene}/{law}/{rpm:g}": functools.partial(_point, scene, law, rpm)
        for scene in WHEELS
        for law in LAWS
        for rpm in (*rates, *([TWIN] if (scene, law) == ("grouser-wheel", "drft2d") else []))
    }
    for rule, share in RULES.items():
        found[f"static/{rule}"] = functools.partial(balance.grousered, GROUSER_WHEEL, POPPY, rule, share)
    return found | {"terramechanics": terramechanics.free_wheel}


def _point(scene: str, law: str, rpm: float) -> dict[str, Any]:
    return measure(scene, law, rpm)._asdict()


def _curve(measured: Measured, scene: str, law: str) -> list[dict[str, Any]]:
    own = [p for p in measured.values() if p.get("scene") == scene and p["law"] == law]
    return sorted(own, key=lambda point: float(point["rpm"]))


def _rolling(points: list[dict[str, Any]]) -> list[float]:
    """The ratio v / (R omega) of each point [-]."""
    return [1.0 - point["slip"] for point in points]


def _spread(values: list[float]) -> float:
    return (max(values) - min(values)) / (sum(values) / len(values))


def rows(measured: Measured) -> list[Row]:
    """The rows of published trends, an independent program's numbers, and the exact ones of appendix B."""
    static, dynamic = (_curve(measured, "grouser-wheel", law) for law in LAWS)
    half_static, half = (_curve(measured, "half-grouser-wheel", law) for law in LAWS)
    at = {f"{point['rpm']:g}": point for point in dynamic}
    ratio = dict(zip(at, _rolling(dynamic), strict=True))
    sunk = {rpm: point["sinkage"] for rpm, point in at.items()}
    fall = (ratio["10"] - ratio["30"]) / (ratio["30"] - ratio["90"])
    program, exact = "independent planar program", "[Agarwal] B.2: no speed in the law"
    trend, twin = "[Agarwal] Fig. 4-7", "[Agarwal] B.1: δh = r (r ω²/g)"
    mean = sum(_rolling(static)) / len(static)
    plain = measured["terramechanics"]
    third, full, least = (measured[f"static/{rule}"] for rule in RULES)
    names = [f"{point['rpm']:g}" for point in static]
    span = f"{names[0]} to {names[-1]} RPM"
    return [
        near("RFT: v/(Rω), mean", mean, 0.85, 0.01, program),
        at_most(f"RFT: spread of v/(Rω), {span}", 100 * _spread(_rolling(static)), 0.5, exact, unit="%"),
        at_most("RFT: the same with the half-size wheel", 100 * _spread(_rolling(half_static)), 0.5, exact, unit="%"),
        near("DRFT: v/(Rω) at 10 RPM", ratio["10"], 0.85, 0.01, program),
        near("DRFT: v/(Rω) at 90 RPM", ratio["90"], 0.77, 0.01, program),
        at_most(
            "DRFT: fall of v/(Rω) from 10 to 30 over that from 30 to 90 RPM", fall, 1.0, f"{trend}: v ∝ ω below 30"
        ),
        at_least("DRFT: sinkage at 90 over at 30 RPM", sunk["90"] / sunk["30"], 1.0, f"{trend}: it rises"),
        near("DRFT: v/(Rω) of the half-size wheel at 90 RPM", _rolling(half)[-1], ratio[f"{TWIN:g}"], 1e-3, twin),
        near("DRFT: its sinkage/ℓ", half[-1]["sinkage"], sunk[f"{TWIN:g}"], 2e-4, twin),
        near("RFT: v/(Rω) by static balance, one third", third["rolling"], mean, 0.002, "our simulation, its mean"),
        Row("the same, full grousers", full["rolling"], "no shadow"),
        Row("the same, least power", least["rolling"], "by the upper bound theorem; nothing fitted"),
        Row("terramechanics: v/(Rω)", plain["rolling"], terramechanics.POPPY_SOURCE, note="smooth"),
        Row("terramechanics: sinkage/ℓ", plain["sinkage"], terramechanics.POPPY_SOURCE),
    ]


def draw(measured: Measured, figure: Any) -> None:
    """Draw speed and sinkage over spin, dimensionless as in [Agarwal] Fig. 4-7."""
    left, right = figure.subplots(1, 2)
    for scene, colour in zip(WHEELS, ("C0", "0.2"), strict=True):
        for law, line in zip(LAWS, ("--", "-"), strict=True):
            points = _curve(measured, scene, law)
            spin = [point["spin"] for point in points]
            size = "half size, " if scene != WHEELS[0] else ""
            style = {"color": colour, "linestyle": line, "marker": "ox"[size != ""], "markersize": 5}
            left.plot(spin, _rolling(points), **style, label=f"{size}{law}")
            right.plot(spin, [point["sinkage"] for point in points], **style, label=f"{size}{law}")
    spins = {f"{point['rpm']:g}": point["spin"] for point in _curve(measured, WHEELS[0], "drft2d")}
    left.plot([spins["10"], spins["90"]], [0.85, 0.77], "r*", markersize=11, label="independent program, drft2d")
    left.axhline(measured["terramechanics"]["rolling"], color="C2", linestyle=":", label="terramechanics, smooth wheel")
    right.axhline(
        measured["terramechanics"]["sinkage"], color="C2", linestyle=":", label="terramechanics, smooth wheel"
    )
    left.set_ylabel("rolling  $v/(R\\omega)$ [-]")
    right.set_ylabel("sinkage  $z/\\ell$ [-]")
    for axis in (left, right):
        axis.set_xlabel("spin  $\\omega/\\sqrt{g/\\ell}$ [-]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.suptitle("Grousered wheel on loose poppy seeds, [Agarwal] Table 4.1")
