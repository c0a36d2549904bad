"""3D-RFT against the continuum that ships with it: flat plates, the map over plates, and solids.

Computes no continuum: reads the campaigns in `rftsim_mpm/data`, which say by what commands they were made.
"""

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from rftsim_mpm.campaign import DATA, results
from rftsim_mpm.intruders import intruder
from rftsim_mpm.reading import limit

from rftsim.fit.generic import Settings
from rftsim.fit.plates import read_campaign
from rftsim.fit.report import report
from rftsim.laws import Law, fitted_law, get_law
from rftsim.rigid import surface_force
from rftsim.sand import ALPHA_Z_PLATE, Sand, xi_n_from_table
from rftsim.surface import Array, make_surface
from rftsim.validation.study import Measured, Request, Row, at_most, near

RHO: Final = 3000.0
"""Of Table C.1 and of the campaigns [kg/m^3]."""
REASON: Final = "Table C.1 has contact a cell early, see the rows below"


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """One for each campaign that is there."""
    known: dict[str, Callable[[Path], Any]] = {
        "flat": flat,
        "plates": plates,
        "solids": functools.partial(solids, DATA / "plates"),
    }
    return {
        f"{name}/{_content(DATA / name)}": functools.partial(job, DATA / name)
        for name, job in known.items()
        if (DATA / name / "manifest.json").exists()
    }


def _content(folder: Path) -> str:
    """A hash of a campaign's results."""
    texts = [path.read_bytes() for path in sorted((folder / "results").glob("*.json"))]
    return hashlib.sha256(b"".join(texts)).hexdigest()[:12]


def flat(folder: Path) -> list[dict[str, float]]:
    """Flat plates pushed down: mu_int, early, cells, alpha_z."""
    found = results(folder)
    keys = ("mu_int", "early", "cells")
    return [{name: one["plate"][name] for name in keys} | {"alpha_z": one["alpha_N_m3"][2]} for one in found]


def plates(folder: Path) -> dict[str, Any]:
    """3D-RFT's cubic fitted to the map, and what it and the source's table miss."""
    found = _fitted(folder)
    return {
        "n": found.plates.n,
        "xi_n": found.generic.xi_n,
        "power": found.power,
        "fitted": found.fitted.relative,
        "held_back": found.held_back.relative,
        "source": found.source.relative,
        "measured": (found.plates.alpha / found.generic.xi_n).tolist(),
        "predicted": (found.predicted_held_back / found.generic.xi_n).tolist(),
    }


@functools.cache
def _fitted(folder: Path) -> Any:
    campaign = read_campaign(folder, {"mu_int": 0.4, "mu_surf": 0.4})
    return report(campaign.plates, Settings(3, dissipative=True), 0.4, choose_prior=True)


def solids(map_: Path, folder: Path) -> list[dict[str, Any]]:
    """Solids in deep sand: measured force, and that of three laws [N]."""
    own = _fitted(map_)
    laws: dict[str, tuple[Law, float]] = {
        "own": (fitted_law(own.generic.table), own.generic.xi_n),
        "scaled": (get_law("rft3d"), own.generic.xi_n),
        "source": (get_law("rft3d"), xi_n_from_table(RHO, 0.4)),
    }
    found = []
    for one in results(folder):
        push = one["push"]
        shape = intruder(push["shape"])
        theta = np.radians(push["theta"])
        surface = make_surface(shape.vertices, shape.faces, name=push["shape"]).refined(0.01)
        forces = {}
        for name, (law, xi_n) in laws.items():
            sand, motion = Sand(xi_n=xi_n, mu_surf=push["mu_surf"]), (np.cos(theta), 0.0, -np.sin(theta))
            state = surface_force(surface, sand, law, position=(0, 0, -push["depth"]), velocity=motion)
            forces[name] = state.force.tolist()
        found.append({"shape": push["shape"], "theta": push["theta"], "continuum": one["force"], **forces})
    return found


def missed(found: list[dict[str, Any]], law: str) -> dict[str, list[float]]:
    """|F - F'| over the largest |F| of the shape, by shape."""
    off: dict[str, list[float]] = {}
    for shape in dict.fromkeys(one["shape"] for one in found):
        own = [one for one in found if one["shape"] == shape]
        largest = max(float(np.linalg.norm(one["continuum"])) for one in own)
        off[shape] = [float(np.linalg.norm(np.subtract(one[law], one["continuum"]))) / largest for one in own]
    return off


def rows(measured: Measured) -> list[Row]:
    """What the source's tables are against the continuum, and what a fit to the continuum is."""
    found = {name.partition("/")[0]: value for name, value in measured.items()}
    table: list[Row] = []
    if "flat" in found:
        table += _flat_rows(found["flat"])
    if "plates" in found:
        one = found["plates"]
        what = f"{one['n']} plates over β, γ, ψ"
        table += [
            Row(f"{what}: error of Table C.3, scaled", 100 * one["source"], "our continuum", unit="%"),
            at_most(f"{what}: of our cubic, held back", 100 * one["held_back"], 10.0, "our continuum", unit="%"),
            at_most("our cubic: largest power α·v over ξ_n", one["power"], 0.0, "dissipative by constraint"),
        ]
    names = {"own": "our cubic", "scaled": "Table C.3, our ξ_n", "source": "Table C.3, Table C.1's ξ_n"}
    for law, name in names.items():
        if not found.get("solids"):
            break
        off = missed(found["solids"], law)
        every = [x for own in off.values() for x in own]
        worst = max(off, key=lambda shape: float(np.median(off[shape])))
        source = f"our continuum, {len(off)} of 10 solids, {len(every)} directions so far"
        table += [
            at_most(
                f"solids: {name}: median error over the largest force",
                100 * float(np.median(every)),
                15.0,
                source,
                unit="%",
            ),
            at_most(
                f"solids: {name}: the same of the worst, {worst}",
                100 * float(np.median(off[worst])),
                25.0,
                source,
                unit="%",
            ),
        ]
    return table


def _alpha(flats: list[dict[str, float]], mu: float, early: float) -> tuple[Array, Array]:
    """Cells and alpha_z, from coarse to fine."""
    own = sorted((one["cells"], one["alpha_z"]) for one in flats if (one["mu_int"], one["early"]) == (mu, early))
    cells, alpha = np.array(own).T
    return cells, alpha


def _limit(cells: Array, alpha: Array) -> float:
    return float(limit(alpha[-2], alpha[-1], cells[-1] / cells[-2]))


def _flat_rows(flats: list[dict[str, float]]) -> list[Row]:
    table = []
    for mu in sorted({one["mu_int"] for one in flats}):
        printed = 1e-6 * xi_n_from_table(RHO, mu)
        xi_n = _limit(*_alpha(flats, mu, 0.0)) / ALPHA_Z_PLATE * 1e-6
        cells, alpha = _alpha(flats, mu, 1.0)
        early = alpha[0] / ALPHA_Z_PLATE * 1e-6
        source = "[Agarwal] Table C.1"
        table += [
            near(f"ξ_n at μ_int {mu:g}, limit of vanishing cells", xi_n, printed, 0.2 * printed, source,
                 unit="MN/m³", note=REASON),
            near(f"the same, contact a cell early, {cells[0]:g} cells", early, printed, 0.1 * printed, source,
                 unit="MN/m³"),
            near("the same, contact a cell early, in its limit", _limit(cells, alpha) / ALPHA_Z_PLATE * 1e-6, xi_n,
                 0.15 * xi_n, "the limit above", unit="MN/m³"),
        ]  # fmt: skip
    return table


def draw(measured: Measured, figure: Any) -> None:
    """Flat plates over cell size, the map, and the solids: predicted over measured."""
    found = {name.partition("/")[0]: value for name, value in measured.items()}
    axes = figure.subplots(1, 3 if found.get("solids") else 2)
    if "flat" in found:
        _draw_flat(axes[0], found["flat"])
    if "plates" in found:
        one = found["plates"]
        for k, name in enumerate("xyz"):
            axes[1].plot(
                np.array(one["measured"])[:, k], np.array(one["predicted"])[:, k], ".", label=f"$\\alpha_{name}$"
            )
        _diagonal(axes[1], "α/ξ_n of the continuum [-]", "of our cubic, each plate held back [-]")
    if found.get("solids"):
        for k, name in enumerate("xz"):
            for law, mark in (("own", "o"), ("source", "x")):
                some = [(one["continuum"][2 * k], one[law][2 * k]) for one in found["solids"]]
                label = f"$F_{name}$, {'our cubic' if law == 'own' else 'Tables C.1, C.3'}"
                axes[2].plot(*np.array(some).T, mark, color=f"C{k}", fillstyle="none", label=label)
        _diagonal(axes[2], "force of the continuum on solids [N]", "force of 3D-RFT [N]")


def _draw_flat(axis: Any, flats: list[dict[str, float]]) -> None:
    for k, mu in enumerate(sorted({one["mu_int"] for one in flats})):
        for early, mark in ((0.0, "o"), (1.0, "s")):
            cells, alpha = _alpha(flats, mu, early)
            style = {"color": f"C{k}", "fillstyle": "none" if early else "full"}
            label = f"μ_int {mu:g}" + (", contact a cell early" if early else "")
            axis.plot(1.0 / cells, 1e-6 * alpha / ALPHA_Z_PLATE, mark, label=label, **style)
            ends = np.array([_limit(cells, alpha), alpha[0]]) / ALPHA_Z_PLATE
            axis.plot([0.0, 1.0 / cells[0]], 1e-6 * ends, ":", color=f"C{k}")
        axis.axhline(1e-6 * xi_n_from_table(RHO, mu), color=f"C{k}", lw=0.8)
    axis.set_xlabel("cell over the plate's length [-]")
    axis.set_ylabel("ξ_n of a flat plate [MN/m³]; lines: Table C.1")
    axis.set_xlim(0.0)
    axis.set_ylim(0.0, 1.4 * axis.get_ylim()[1])
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7, ncols=2, loc="upper left")


def _diagonal(axis: Any, x: str, y: str) -> None:
    low, high = axis.get_xlim()
    axis.plot([low, high], [low, high], color="0.6", lw=0.8)
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
