"""Measured wheels and plates in dry sand: Pavlov and Johnson, CMU "3d-terramechanics" (MIT licence).

A grousered wheel at imposed slip and slip angle, with its measured sinkage as input, against drawbar, side force and
load; and circular plates pushed into the same sand. Strength and friction of the sand come from its density and its
friction angle alone; nothing is fitted to the wheel.
"""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from rftsim.sand.medium import ALPHA_Z_PLATE, Sand
from rftsim.sand.strength import xi_n_cubic
from rftsim.validation import pockets, terramechanics
from rftsim.validation.cmu import PLATE_FILE, SMOOTH_FILE, WHEEL_FILE, Runs, digest, read_plates, read_runs
from rftsim.validation.pockets import Grousers, Motion, Shaded
from rftsim.validation.study import Measured, Request, Row, at_least, at_most, near
from rftsim.validation.terramechanics import Soil

WHEEL: Final = Grousers(hub=0.0575, tip=0.0625, width=0.060, number=24, thickness=0.002)
"""The measured wheel; its grousers' thickness is not published: 1 to 3 mm change an RMSE by less than 0.2 N."""
SAND: Final = Sand(rho_c=1330.0, mu_int=math.tan(math.radians(29)), mu_surf=0.35)
"""The sand of the measurements, its strength from Table C.1."""
CUBIC: Final = xi_n_cubic(1330.0, math.tan(math.radians(29))) / float(SAND.xi_n or math.nan)
"""Strength by the cubic of Fig. C-2 over that of Table C.1 [-]."""
PHASES: Final = 4
"""Phases of the wheel, within the angle between grousers, that forces are averaged over."""
MOST_SLIP, MOST_ANGLE_DEG = 0.55, 60.0
"""Largest slip [-] and slip angle [deg] of the runs that are compared."""
FORCES: Final = ("drawbar", "side", "load")
"""Components of the force, in the order of the data."""
SHARES: Final = {"full grousers": 1.0, "one third": 1.0 / 3.0, "no grousers": 0.0}
"""Shares of their height that grousers keep, by rule."""
KNOWN: Final = {
    "full grousers": (6.0, 2.7, 6.2),
    "one third": (2.4, 3.7, 6.3),
    "no grousers": (3.2, 4.3, 6.7),
}
"""RMSE of each force by another implementation of 3D-RFT with the cubic strength [N], by rule."""
LEAST, SMOOTH = "least power", "smooth wheel"
"""The rule by which each pocket is cheapest, and the wheel that has no grousers."""
LITERATURE, OWN = "terramechanics, dry sand", "terramechanics, the plates"
"""The rules of terramechanics: with a soil of the literature, and with that of the plates."""
SOILS: Final = {
    LITERATURE: "Wong-Reece; dry sand of [Wong2008]",
    OWN: "Wong-Reece; n, k_c, k_φ of the plates, φ 29°, K 25 mm [Wong2008]",
}
"""Sources of the soils' numbers, by rule."""
COLOURS: Final = dict(zip((*SHARES, LEAST, *SOILS), ("C3", "C0", "0.6", "C2", "C1", "C4"), strict=True))
"""Colour of each rule."""
ABSENT: Final = "data not here"
"""Words for data that are missing."""
DATA: Final = Path("../shared/data/cmu")
"""Folder in which the data are looked for."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """A job for each rule on all runs, and for the plates; none where the data are missing."""
    found: dict[str, Callable[[], Any]] = {}
    wheel, plates = request.data / WHEEL_FILE, request.data / PLATE_FILE
    if wheel.is_file():
        mark = digest(wheel)
        for rule in (*SHARES, LEAST):
            found[f"wheel {mark}/{rule}"] = functools.partial(by_force_law, rule, wheel)
        soils = {LITERATURE: (terramechanics.DRY_SAND, "")}
        if plates.is_file():
            soils[OWN] = soil_of_plates(plates), f" {digest(plates)}"
        for name, (soil, of) in soils.items():
            found[f"wheel {mark}{of}/{name}"] = functools.partial(by_terramechanics, soil, wheel)
    smooth = request.data / SMOOTH_FILE
    if smooth.is_file():
        found[f"smooth {digest(smooth)}/{SMOOTH}"] = functools.partial(by_force_law, SMOOTH, smooth)
    if plates.is_file():
        found[f"plates {digest(plates)}"] = functools.partial(plate_stiffness, plates)
    return found


def by_force_law(rule: str, wheel: Path) -> dict[str, Any]:
    """Forces of every run that is compared [N], (n, 3), by 3D-RFT and a rule for the grousers."""
    runs = read_runs(wheel)
    shaded = Shaded(WHEEL)
    solid = WHEEL.disc() if rule == SMOOTH else WHEEL.with_height(SHARES[rule]) if rule in SHARES else None
    found = []
    for k in np.flatnonzero(_judged(runs)):
        velocity = np.array([*runs.velocity(int(k)), 0.0])
        height, rate = WHEEL.tip - float(runs.sinkage[k]), float(runs.rim[k]) / WHEEL.tip
        total = np.zeros(3)
        for phase in range(PHASES):
            motion = Motion(height, WHEEL.pitch * phase / PHASES, velocity, rate)
            force = (
                shaded.force(SAND, motion, "rft3d") if solid is None else pockets.force(solid, SAND, motion, "rft3d")
            )
            total += force / PHASES
        found.append([float(total[0]), -float(total[1]), float(total[2])])
    return {"force": found} | _compared(runs)


def by_terramechanics(soil: Soil, wheel: Path) -> dict[str, Any]:
    """Forces of the same runs [N], (n, 3), by terramechanics under the measured load, and the sinkage [m]."""
    runs = read_runs(wheel)
    found, sunk = [], []
    for k in np.flatnonzero(_judged(runs)):
        shape = WHEEL.tip, WHEEL.width
        motion = float(runs.rim[k]), runs.velocity(int(k))
        sinkage = terramechanics.sinkage_under(soil, float(runs.force[k, 2]), *shape, *motion)
        force = terramechanics.wheel_force(soil, *shape, sinkage, *motion)
        found.append([force.drawbar, -force.side, force.load])
        sunk.append(sinkage)
    return {"force": found, "sinkage": sunk} | _compared(runs)


def _judged(runs: Runs) -> Any:
    """Whether each run is compared, (n,): those of moderate slips and slip angles are."""
    return (np.abs(runs.slip) <= MOST_SLIP) & (runs.angle <= math.radians(MOST_ANGLE_DEG + 1e-6))


def _compared(runs: Runs) -> dict[str, Any]:
    """The measured forces [N], sinkages [m], slips [-] and slip angles of the runs that are compared."""
    judged = _judged(runs)
    return {
        "measured": runs.force[judged].tolist(),
        "measured_sinkage": runs.sinkage[judged].tolist(),
        "slip": runs.slip[judged].tolist(),
        "angle_deg": np.degrees(runs.angle[judged]).tolist(),
    }


def plate_stiffness(path: Path) -> dict[str, list[float]]:
    """Stress over depth of each test of a plate, through the origin [N/m^3], by diameter in mm."""
    found: dict[str, list[float]] = {}
    for test in read_plates(path):
        slope = float(test.depth @ test.force / (test.depth @ test.depth))
        found.setdefault(f"{1e3 * test.diameter:g}", []).append(slope / test.area)
    return found


def soil_of_plates(path: Path) -> Soil:
    """Fit Bekker's soil to the plates in the same sand, [Agarwal] eq. (1.4).

    ln p = ln(k_c / b + k_phi) + n ln z by least squares, b the plate's radius, less than 5 mm of depth left out.
    """
    rows, right = [], []
    tests = read_plates(path)
    sizes = sorted({test.diameter for test in tests})
    for test in tests:
        deep = (test.depth > 0.005) & (test.force > 0.0)
        one_hot = [float(test.diameter == size) for size in sizes]
        rows += [[*one_hot, z] for z in np.log(test.depth[deep])]
        right += np.log(test.force[deep] / test.area).tolist()
    *logs, exponent = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    radii = np.array(sizes) / 2
    k_c, k_phi = np.polyfit(1.0 / radii, np.exp(logs), 1)
    return Soil(
        k_c=float(k_c),
        k_phi=float(k_phi),
        exponent=float(exponent),
        friction=float(SAND.mu_int or math.nan),
        shear=terramechanics.SHEAR_LOOSE,
        tested=(float(radii[0]), float(radii[-1])),
    )


def _by_rule(measured: Measured, wheel: str = "wheel") -> dict[str, dict[str, Any]]:
    """The measurements of a wheel, by rule."""
    return {name.partition("/")[2]: value for name, value in measured.items() if name.startswith(f"{wheel} ")}


def _plates(measured: Measured) -> dict[str, list[float]] | None:
    """The stiffness of the plates, as `plate_stiffness` gives it; None where there are no data."""
    return next((value for name, value in measured.items() if name.startswith("plates ")), None)


def rmse(found: dict[str, Any], factor: float = 1.0) -> dict[str, float]:
    """Root of the mean square error of each force [N], the prediction taken times a factor."""
    error = factor * np.array(found["force"]) - np.array(found["measured"])
    return dict(zip(FORCES, np.sqrt((error**2).mean(axis=0)).tolist(), strict=True))


def rows(measured: Measured) -> list[Row]:
    """The rows of the wheel by each rule, and those of the plates."""
    smooth = [
        Row(f"{SMOOTH}: {name} RMSE", value, "measured; ξ_n by Table C.1", unit="N", note="radius taken as 62.5 mm")
        for found in _by_rule(measured, "smooth").values()
        for name, value in rmse(found).items()
    ]
    return [*_wheel_rows(_by_rule(measured)), *smooth, *_plate_rows(_plates(measured))]


def _wheel_rows(found: dict[str, dict[str, Any]]) -> list[Row]:
    if not found:
        return [Row("grousered wheel", None, f"{ABSENT}; --data DIR with {WHEEL_FILE}")]
    rows = []
    demand = "measured; ξ_n by Table C.1"
    for rule, known in KNOWN.items():
        own = rmse(found[rule], CUBIC)
        off = max(abs(own[name] - value) for name, value in zip(FORCES, known, strict=True))
        what = f"{rule}: RMSE less another program's {' / '.join(map(str, known))} N, largest"
        rows.append(at_most(what, off, 0.3, "another 3D-RFT program; ξ_n by the cubic", unit="N"))
    full = rmse(found["full grousers"])
    heavy = "as with full grousers: too much load at large slip angles"
    for rule in ("one third", LEAST):
        own = rmse(found[rule])
        note = "each pocket flows or is carried along, whichever costs less" if rule == LEAST else ""
        gain = full["drawbar"] / own["drawbar"]
        rows += [
            Row(f"{rule}: drawbar RMSE", own["drawbar"], demand, unit="N", note=note),
            at_least(f"{rule}: drawbar RMSE with full grousers over that", gain, 2.0, demand),
            at_most(f"{rule}: side RMSE", own["side"], 4.0, demand, unit="N"),
            at_most(f"{rule}: load RMSE", own["load"], 6.5, demand, unit="N", note=heavy if rule == LEAST else ""),
        ]
    for rule, source in SOILS.items():
        if rule in found:
            one, own = found[rule], rmse(found[rule])
            sunk = 1e3 * (np.array(one["sinkage"]) - np.array(one["measured_sinkage"]))
            rows += [
                *(Row(f"{rule}, load given: {name} RMSE", own[name], source, unit="N") for name in FORCES[:2]),
                Row(f"{rule}, load given: sinkage RMSE", float(np.sqrt((sunk**2).mean())), source, unit="mm"),
            ]
    return rows


def _plate_rows(found: dict[str, list[float]] | None) -> list[Row]:
    if found is None:
        return [Row("circular plates", None, f"{ABSENT}; --data DIR with {PLATE_FILE}")]
    predicted = 1e-6 * ALPHA_Z_PLATE * float(SAND.xi_n or math.nan)
    reason = "near the surface sand stiffens with the plate's size, which RFT cannot show"
    rows = []
    for diameter, values in sorted(found.items(), key=lambda item: float(item[0])):
        mean = 1e-6 * float(np.mean(values))
        note = reason if abs(predicted - mean) > 0.15 * mean else ""
        what = f"plate of {diameter} mm: α_z"
        source = f"measured, {len(values)} tests"
        rows.append(near(what, predicted, mean, 0.15 * mean, source, unit="MN/m³", note=note))
    return rows


def draw(measured: Measured, figure: Any) -> None:
    """Draw forces over slip at each slip angle, measured and by rule, with the RMSE of each rule."""
    found = _by_rule(measured)
    if not found:
        figure.text(0.5, 0.5, f"{ABSENT}: --data DIR", ha="center")
        return
    some = next(iter(found.values()))
    angles = sorted(set(np.round(some["angle_deg"], 6)))
    panels = figure.subplots(3, len(angles), sharex=True, sharey="row")
    for column, angle in enumerate(angles):
        own = np.isclose(some["angle_deg"], angle)
        for row, name in enumerate(FORCES):
            axis = panels[row, column]
            _draw_rules(axis, found, own, row)
            axis.plot(np.array(some["slip"])[own], np.array(some["measured"])[own, row], "k.", label="measured")
            axis.grid(alpha=0.3)
            if column == 0:
                axis.set_ylabel(f"{name} [N]")
        panels[0, column].set_title(f"slip angle {angle:g}°", fontsize=10)
        panels[2, column].set_xlabel("slip [-]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle("Grousered wheel in sand, nothing fitted to it; RMSE of drawbar / side force / load")


def _draw_rules(axis: Any, found: dict[str, dict[str, Any]], own: Any, component: int) -> None:
    """Draw one component of the force by every rule over the slip of some runs, averaged over runs of like slip."""
    for rule, predicted in found.items():
        if rule in SOILS and FORCES[component] == "load":
            continue
        slip, values = np.array(predicted["slip"])[own], np.array(predicted["force"])[own, component]
        rounded = np.round(slip, 1)
        groups = [np.isclose(rounded, step) for step in np.unique(rounded)]
        points = [slip[group].mean() for group in groups], [values[group].mean() for group in groups]
        line = "--" if rule in SOILS else "-"
        axis.plot(*points, line, color=COLOURS[rule], linewidth=1.4, label=_label(rule, predicted))


def _label(rule: str, predicted: dict[str, Any]) -> str:
    """A rule's name with its RMSE [N], of the forces that it predicts."""
    given = rule in SOILS
    errors = list(rmse(predicted).values())[: 2 if given else 3]
    return f"{rule}{', load given' if given else ''}: {' / '.join(f'{error:.1f}' for error in errors)} N"
