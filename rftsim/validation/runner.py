"""The four-flap runner of [Agarwal] section 4.7: sinkage and slip over the imposed rate and lambda."""

import functools
from collections.abc import Callable
from typing import Any, Final

from rftsim.run.rate_sweep import measure
from rftsim.validation.study import Measured, Request, Row, at_least, near

RATES: Final = (20.0, 40.0, 60.0, 80.0, 100.0, 150.0, 200.0, 250.0, 300.0)
"""Imposed rates [1/min]."""
QUICK_RATES: Final = (60.0, 100.0, 300.0)
"""Imposed rates where fewer will do [1/min]."""
LAMBDAS: Final = (0.0, 2.0, 4.0)
"""Inertial factors lambda [-]."""
EXPECTED: Final = {0.0: {100.0: 0.279, 300.0: 0.247}, 4.0: {100.0: 0.269, 300.0: 0.204}}
"""Sinkage over l of an independent program [-], by lambda and rate [1/min]."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """A job for every lambda and every rate."""
    lambdas, rates = (tuple(EXPECTED), QUICK_RATES) if request.quick else (LAMBDAS, RATES)
    return {f"{lambda_:g}/{rpm:g}": functools.partial(_point, lambda_, rpm) for lambda_ in lambdas for rpm in rates}


def _point(lambda_: float, rpm: float) -> dict[str, Any]:
    sand = f"preset=poppy-seeds,lambda_={lambda_}"
    return measure("four-flap-runner", "drft2d", rpm, sand)._asdict() | {"lambda": lambda_}


def _curve(measured: Measured, lambda_: float) -> dict[float, dict[str, Any]]:
    """The points of a lambda in the order of their rate, by rate [1/min]."""
    return {p["rpm"]: p for p in sorted(measured.values(), key=lambda p: float(p["rpm"])) if p["lambda"] == lambda_}


def rows(measured: Measured) -> list[Row]:
    """The rows of an independent program's sinkage, and of the turnover."""
    found = []
    for lambda_, expected in EXPECTED.items():
        own = _curve(measured, lambda_)
        for rpm, sinkage in expected.items():
            what = f"λ = {lambda_:g}: sinkage/ℓ at {rpm:g} RPM"
            found.append(near(what, own[rpm]["sinkage"], sinkage, 0.003, "independent planar program"))
    turnover = "[Agarwal] Fig. 4-9: turnover near 100 RPM"
    for lambda_ in EXPECTED:
        sunk = {rpm: point["sinkage"] for rpm, point in _curve(measured, lambda_).items()}
        peak = sunk[100.0] / max(sunk[60.0], sunk[300.0])
        found.append(at_least(f"λ = {lambda_:g}: sinkage at 100 over that at 60 and 300 RPM", peak, 1.0, turnover))
    strong, none = (_curve(measured, lambda_) for lambda_ in (4.0, 0.0))
    rise = (strong[100.0]["sinkage"] - strong[300.0]["sinkage"]) / (none[100.0]["sinkage"] - none[300.0]["sinkage"])
    faster = strong[100.0]["slip"] - strong[300.0]["slip"]
    return [
        *found,
        at_least("rise from 100 to 300 RPM at λ = 4 over that at 0", rise, 1.0, "[Agarwal] Fig. 4-9"),
        at_least("λ = 4: slip at 100 less slip at 300 RPM", faster, 0.0, "[Agarwal] Fig. 4-9: it slips less"),
    ]


def draw(measured: Measured, figure: Any) -> None:
    """Draw rolling and sinkage over spin, dimensionless as in [Agarwal] Fig. 4-9."""
    left, right = figure.subplots(1, 2)
    spin_of: dict[float, float] = {}
    for k, lambda_ in enumerate(dict.fromkeys(point["lambda"] for point in measured.values())):
        own = _curve(measured, lambda_)
        spin_of |= {rpm: point["spin"] for rpm, point in own.items()}
        spin = [point["spin"] for point in own.values()]
        style = {"color": f"C{k}", "marker": "o", "label": f"λ = {lambda_:g}"}
        left.plot(spin, [1.0 - point["slip"] for point in own.values()], **style)
        right.plot(spin, [point["sinkage"] for point in own.values()], **style)
        expected = EXPECTED.get(lambda_, {})
        star = {"color": f"C{k}", "markersize": 13, "markeredgecolor": "k", "linestyle": "none"}
        label = f"independent program, λ = {lambda_:g}" if expected else None
        right.plot([spin_of[rpm] for rpm in expected], list(expected.values()), "*", **star, label=label)
    right.legend()
    left.legend()
    left.set_ylabel("rolling  $v/(R\\omega)$ [-]")
    right.set_ylabel("sinkage  $z/\\ell$ [-]")
    for axis in (left, right):
        axis.set_xlabel("spin  $\\omega/\\sqrt{g/\\ell}$ [-]")
        axis.grid(alpha=0.3)
    figure.suptitle("Four-flap runner on loose poppy seeds, drft2d, [Agarwal] Table 4.3")
