"""Pictures of fits: a table against its plates, and a trial against its line."""

from pathlib import Path
from typing import Any

import numpy as np

from rftsim.fit.plates import Plates
from rftsim.fit.report import Report, predict
from rftsim.fit.trials import Found


def plot_map(report: Report, title: str, path: Path) -> None:
    """Draw the law against the plates into a file: everything at once, and in plane over the direction of motion."""
    from matplotlib.figure import Figure  # not before it is needed: it takes a second

    figure = Figure(figsize=(15, 5.5), layout="constrained")
    parity, *sections = figure.subplots(1, 3)
    xi_n, plates = report.generic.xi_n, report.plates
    for k, name in enumerate("xyz"):
        measured, colour = plates.alpha[:, k] / xi_n, f"C{k}"
        parity.plot(measured, report.predicted[:, k] / xi_n, ".", color=colour, label=f"$\\alpha_{name}$")
        parity.plot(measured, report.predicted_held_back[:, k] / xi_n, "o", color=colour, fillstyle="none", alpha=0.4)
    ends = np.array([plates.alpha.min(), plates.alpha.max()]) / xi_n
    parity.plot(ends, ends, color="0.6", linewidth=1, zorder=0)
    parity.set_xlabel("measured  $\\alpha/\\xi_n$ [-]")
    parity.set_ylabel("law  $\\alpha/\\xi_n$ [-]  (rings: held back)")
    parity.set_title(f"error {report.fitted.relative:.1%}, held back {report.held_back.relative:.1%}")
    for axis, k in zip(sections, (0, 2), strict=True):
        _section(axis, report, k)
        axis.set_ylabel(f"$\\alpha_{'xyz'[k]}/\\xi_n$ [-]")
        axis.set_xlabel("direction of motion $\\gamma$ [deg]")
        axis.set_title("in plane, $\\psi$ = 0: law (lines), plates (dots)")
    for axis in (parity, *sections):
        axis.grid(alpha=0.3)
        axis.legend(fontsize="small")
    figure.suptitle(f"{title}: $\\xi_n$ = {xi_n:.4g} N/m³")
    figure.savefig(path, dpi=110)


def _section(axis: Any, report: Report, k: int) -> None:
    """One component at psi = 0 over gamma, a curve for each beta that was measured often."""
    angles, xi_n = report.plates.angles, report.generic.xi_n
    in_plane = angles[:, 2] == 0.0
    gamma = np.linspace(-89.99, 89.99, 181)  # aside of edge-on, where both faces lead
    for colour, beta in enumerate(_often(angles[in_plane, 0])):
        lines = np.stack([np.full_like(gamma, beta), gamma, np.zeros_like(gamma)], axis=1)
        own = in_plane & (angles[:, 0] == beta)
        like = [np.full(len(lines), column[own].mean()) for column in (report.plates.thickness, report.plates.depth)]
        made = Plates(lines, np.zeros_like(lines), *like)
        law = predict(report.generic.table, xi_n, report.mu_surf, made)[:, k] / xi_n
        axis.plot(gamma, law, color=f"C{colour}", linewidth=1, label=f"$\\beta$ = {beta:g}°")
        axis.plot(angles[own, 1], report.plates.alpha[own, k] / xi_n, "o", color=f"C{colour}")


def _often(tilts: Any, most: int = 7) -> list[float]:
    """Up to seven tilts with three plates or more, evenly chosen."""
    values, counts = np.unique(tilts, return_counts=True)
    values = values[counts > 2]
    chosen = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return [float(x) for x in values[chosen]]


def plot_trial(found: Found, title: str, path: Path) -> None:
    """Draw a trial's readings and what was fitted to them, into a file."""
    from matplotlib.figure import Figure  # not before it is needed: it takes a second

    figure = Figure(figsize=(7, 5), layout="constrained")
    axis = figure.subplots()
    order = np.argsort(found.x)
    axis.plot(found.x, found.measured, "o", fillstyle="none", label="measured")
    axis.plot(found.x[order], found.fitted[order], ".", color="C1", label="fitted")
    axis.set_xlabel(found.labels[0])
    axis.set_ylabel(found.labels[1])
    lines = [f"{name} = {one.value:.4g} ({one.low:.4g} to {one.high:.4g})" for name, one in found.estimates.items()]
    axis.set_title("\n".join(lines), fontsize="small")
    axis.set_xlim(left=0.0)
    axis.set_ylim(bottom=0.0)
    axis.grid(alpha=0.3)
    axis.legend()
    figure.suptitle(title)
    figure.savefig(path, dpi=110)
