"""3D-RFT against the continuum that ships with it: flat plates, the map over plates, and solids.

Computes no continuum: reads the campaigns in `rftsim_mpm/data`, which say by what commands they were made.
"""

import functools
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rftsim_mpm.campaign import DATA
from rftsim_mpm.intruders import intruder
from rftsim_mpm.reading import limit as limit_of

from rftsim.fit.generic import Settings
from rftsim.fit.plates import read_campaign
from rftsim.fit.report import report
from rftsim.law.laws import Law, fitted_law, get_law
from rftsim.law.rigid import surface_force
from rftsim.sand.medium import ALPHA_Z_PLATE, Sand
from rftsim.sand.strength import xi_n_from_table
from rftsim.surface.triangles import Array, make_surface
from rftsim.validation.shipped import Results, outcome, shipped
from rftsim.validation.study import Measured, Request, Row, at_most, near

MAPS: Final = ("plates", "deep")
"""Campaigns of plates over their angles, near the surface and as deep as the solids."""
RHO: Final = 3000.0
"""Density of the sand of Table C.1 and of the campaigns [kg/m^3]."""
REASON: Final = "Table C.1 has contact a cell early, see the rows below"
"""Note on the rows that are off, for a reason that other rows show."""


def jobs(request: Request) -> dict[str, Callable[[], Any]]:
    """A job for each campaign that is there, which reads it."""
    known = shipped("flat", flat) | shipped("solids", solids)
    for name in MAPS:
        known |= shipped(name, functools.partial(plates, name))
    return known


def flat(results: Results) -> list[dict[str, float]]:
    """Flat plates pushed down: mu_int [-], contact early by so many cells, cells [-], and alpha_z [N/m^3] of each."""
    keys = ("mu_int", "early", "cells")
    return [{name: one["plate"][name] for name in keys} | {"alpha_z": one["alpha_N_m3"][2]} for one in results]


def plates(name: str, _: Results) -> dict[str, Any]:
    """Fit 3D-RFT's cubic to a map of plates, and tell what it and the source's table miss."""
    fit = _fitted(name)
    return {
        "n": fit.plates.n,
        "depth": float(fit.plates.depth.mean()),
        "xi_n": fit.generic.xi_n,
        "power": fit.power,
        "fitted": fit.fitted.relative,
        "held_back": fit.held_back.relative,
        "source": fit.source.relative,
        "measured": (fit.plates.alpha / fit.generic.xi_n).tolist(),
        "predicted": (fit.predicted_held_back / fit.generic.xi_n).tolist(),
    }


@functools.cache
def _fitted(name: str) -> Any:
    campaign = read_campaign(DATA / name, {"mu_int": 0.4, "mu_surf": 0.4})
    return report(campaign.plates, Settings(3, dissipative=True), 0.4, choose_prior=True)


def solids(results: Results) -> list[dict[str, Any]]:
    """Solids in deep sand: the continuum's force on each, and that of four laws [N]."""
    own, deep = (_fitted(name) for name in MAPS)
    laws: dict[str, tuple[Law, float]] = {
        "own": (fitted_law(own.generic.table), own.generic.xi_n),
        "deep": (fitted_law(deep.generic.table), deep.generic.xi_n),
        "scaled": (get_law("rft3d"), own.generic.xi_n),
        "source": (get_law("rft3d"), xi_n_from_table(RHO, 0.4)),
    }
    table = []
    for one in results:
        push = one["push"]
        shape = intruder(push["shape"])
        theta = np.radians(push["theta"])
        surface = make_surface(shape.vertices, shape.faces, name=push["shape"]).refined(0.01)
        forces = {}
        for name, (law, xi_n) in laws.items():
            sand, motion = Sand(xi_n=xi_n, mu_surf=push["mu_surf"]), (np.cos(theta), 0.0, -np.sin(theta))
            state = surface_force(surface, sand, law, position=(0, 0, -push["depth"]), velocity=motion)
            forces[name] = state.force.tolist()
        kept = {name: push[name] for name in ("shape", "theta", "dx")}
        table.append({**kept, "continuum": one["force"], **forces})
    return table


def _by_cells(solids: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Divide solids into those in the coarsest cells, and those in finer ones."""
    coarse = max(one["dx"] for one in solids)
    return [one for one in solids if one["dx"] == coarse], [one for one in solids if one["dx"] < coarse]


def missed(solids: list[dict[str, Any]], law: str) -> dict[str, list[float]]:
    """A law's error |F - F'| of each solid over the largest |F| of its shape [-], by shape."""
    off: dict[str, list[float]] = {}
    for shape in dict.fromkeys(one["shape"] for one in solids):
        own = [one for one in solids if one["shape"] == shape]
        largest = max(float(np.linalg.norm(one["continuum"])) for one in own)
        off[shape] = [float(np.linalg.norm(np.subtract(one[law], one["continuum"]))) / largest for one in own]
    return off


def rows(measured: Measured) -> list[Row]:
    """The rows of the source's tables against the continuum, and of fits to the continuum."""
    table = _flat_rows(outcome(measured, "flat") or [])
    for name in MAPS:
        if one := outcome(measured, name):
            what = f"{one['n']} plates {one['depth']:.1f} L deep"
            table += [
                Row(f"{what}: error of Table C.3, scaled", 100 * one["source"], "our continuum", unit="%"),
                at_most(f"{what}: of our cubic, held back", 100 * one["held_back"], 10.0, "our continuum", unit="%"),
                at_most(f"{what}: largest power α·v over ξ_n", one["power"], 0.0, "dissipative by constraint"),
            ]
    if pushed := outcome(measured, "solids"):
        table += _solid_rows(*_by_cells(pushed))
    return table


def _solid_rows(solids: list[dict[str, Any]], finer: list[dict[str, Any]]) -> list[Row]:
    table = []
    names = {
        "own": "our cubic",
        "deep": "our cubic of deep plates",
        "scaled": "Table C.3, our ξ_n",
        "source": "Table C.3, Table C.1's ξ_n",
    }
    for law, name in names.items():
        off = missed(solids, law)
        every = [x for own in off.values() for x in own]
        worst = max(off, key=lambda shape: float(np.median(off[shape])))
        source = f"our continuum, {len(off)} solids, {len(every)} directions"
        for what, some, limit in (
            ("median error over the largest force", every, 15.0),
            (f"the same of the worst, {worst}", off[worst], 25.0),
        ):
            table.append(at_most(f"solids: {name}: {what}", 100 * float(np.median(some)), limit, source, unit="%"))
    coarse = {(one["shape"], one["theta"]): np.array(one["continuum"]) for one in solids}
    for one in finer:
        fine, before, ratio = (
            np.array(one["continuum"]),
            coarse[one["shape"], one["theta"]],
            solids[0]["dx"] / one["dx"],
        )
        off_limit = np.linalg.norm(before - limit_of(before, fine, ratio)) / np.linalg.norm(before)
        what = f"continuum: {one['shape']} at θ {one['theta']:g}°: force's distance to the limit of vanishing cells"
        table.append(Row(what, 100 * float(off_limit), f"its force in cells {ratio:g} times smaller", unit="%"))
    return table


def _alpha(flats: list[dict[str, float]], mu: float, early: float) -> tuple[Array, Array]:
    """Cells [-] and alpha_z [N/m^3] of the flat plates with a friction and a contact, from coarse to fine."""
    own = sorted((one["cells"], one["alpha_z"]) for one in flats if (one["mu_int"], one["early"]) == (mu, early))
    cells, alpha = np.array(own).T
    return cells, alpha


def _limit(cells: Array, alpha: Array) -> float:
    return float(limit_of(alpha[-2], alpha[-1], cells[-1] / cells[-2]))


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
    """Draw flat plates over the size of cells, and predicted over measured: the map of plates, and the solids."""
    pushed = outcome(measured, "solids")
    axes = figure.subplots(1, 3 if pushed else 2)
    if flats := outcome(measured, "flat"):
        _draw_flat(axes[0], flats)
    if one := outcome(measured, "plates"):
        for k, name in enumerate("xyz"):
            axes[1].plot(
                np.array(one["measured"])[:, k], np.array(one["predicted"])[:, k], ".", label=f"$\\alpha_{name}$"
            )
        _diagonal(axes[1], "α/ξ_n of the continuum [-]", "of our cubic, each plate held back [-]")
    if pushed:
        solids, _ = _by_cells(pushed)
        for k, name in enumerate("xz"):
            for law, mark, said in (("deep", "o", "cubic of deep plates"), ("source", "x", "Tables C.1, C.3")):
                some = [(one["continuum"][2 * k], one[law][2 * k]) for one in solids]
                label = f"$F_{name}$, {said}"
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
