"""Pictures of sand."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from rftsim_mpm.fields import Frame
from rftsim_mpm.reading import History

PANELS = {
    "strain": ("equivalent plastic strain [-]", "magma", 99.0),
    "rate": ("its rate [1/s]", "inferno", 98.0),
    "pressure": ("pressure [Pa]", "viridis", 99.5),
    "packing": ("packing fraction [-]", "cividis", None),
    "velocity": ("speed [m/s]", "turbo", 99.5),
}
"""Each field's label, colours, and the percentile that the colours end at."""


def draw_field(axes: Axes, frame: Frame, field: str) -> Any:
    """Draw the particles coloured by a field, the free surface and the bodies."""
    label, colours, percentile = PANELS[field]
    values = getattr(frame, field)
    if field == "velocity":
        values = np.linalg.norm(values, axis=1)
    low, high = (
        (0.0, max(float(np.percentile(values, percentile)), 1e-12)) if percentile else np.percentile(values, [2, 98])
    )
    spacing = np.sqrt(np.ptp(frame.place[:, 0]) * max(np.ptp(frame.place[:, 1]), 1e-9) / len(frame.place))
    axes.set_aspect("equal")
    axes.set_xlim(frame.place[:, 0].min(), frame.place[:, 0].max())
    tops = [frame.place[:, 1].max(), *(outline[:, 1].max() for outline in frame.outlines)]
    axes.set_ylim(frame.place[:, 1].min(), max(tops) + 2 * spacing)
    width = axes.get_window_extent().width / np.ptp(axes.get_xlim()) * 72.0 / axes.figure.dpi
    shown = axes.scatter(
        frame.place[:, 0],
        frame.place[:, 1],
        c=values,
        s=(1.1 * spacing * width) ** 2,
        cmap=colours,
        vmin=low,
        vmax=high if high > low else low + 1e-6,
        linewidths=0,
        marker="s",
        rasterized=True,
    )
    jumps = np.abs(np.diff(frame.surface[:, 0])) > 3.0 * np.median(np.diff(frame.surface[:, 0]))
    pieces = np.split(frame.surface, np.flatnonzero(jumps) + 1)
    axes.add_collection(LineCollection([piece for piece in pieces if len(piece) > 1], colors="0.3", linewidths=0.8))
    for outline in frame.outlines:
        axes.fill(*_hull(outline).T, facecolor="0.75", edgecolor="0.1", linewidth=0.8)
    axes.figure.colorbar(shown, ax=axes, label=label, shrink=0.8)
    return shown


def _hull(outline: Any) -> Any:
    """A polygon as it is; the corners of a solid, seen from the side, by their convex hull."""
    if len(np.unique(outline.round(12), axis=0)) == len(outline):
        return outline
    from scipy.spatial import ConvexHull

    return outline[ConvexHull(outline).vertices]


def plot_frame(
    frame: Frame, title: str, path: Path, fields: tuple[str, ...] = ("strain", "rate", "pressure", "packing")
) -> None:
    """Draw some of the fields of one moment."""
    rows = (len(fields) + 1) // 2
    aspect = np.ptp(frame.place[:, 1]) / np.ptp(frame.place[:, 0])
    figure = Figure(figsize=(13, rows * max(2.2, 6.0 * aspect + 0.8)), dpi=110, layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False)
    for axis, field in zip(axes.flat, fields, strict=False):
        draw_field(axis, frame, field)
    for axis in axes.flat[len(fields) :]:
        axis.set_axis_off()
    figure.suptitle(f"{title}, {frame.time:.3g} s")
    figure.savefig(path)


def plot_history(history: History, title: str, path: Path, frame: Frame | None = None, per: str = "N") -> None:
    """Draw force against travel, and beside it the sand."""
    figure = Figure(figsize=(13, 8) if frame else (8, 5), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2) if frame else np.array([[figure.subplots()]])
    names = "xyz" if history.force.shape[1] == 3 else "xz"
    for component, name in enumerate(names):
        axes[0, 0].plot(1e3 * history.travel, history.force[:, component], label=f"F{name}", linewidth=1.0)
    axes[0, 0].set_xlabel("travel [mm]")
    axes[0, 0].set_ylabel(f"force of the sand [{per}], averages of 0.5 ms")
    axes[0, 0].grid(alpha=0.3)
    axes[0, 0].legend()
    if frame:
        for axis, field in zip(axes.flat[1:], ("strain", "rate", "pressure"), strict=True):
            draw_field(axis, frame, field)
    figure.suptitle(title)
    figure.savefig(path)


def plot_campaign(found: list[dict[str, Any]], path: Path) -> None:
    """Draw force against the direction of motion, by component: of plates per area and depth, of pushes as it is."""
    plates = [result for result in found if "plate" in result] or None
    lines: dict[str, list[tuple[float, list[float]]]] = {}
    for result in plates or found:
        if plates:
            job, value = result["plate"], [1e-6 * a for a in result["alpha_N_m3"]]
            label, angle = f"β {job['beta']:g}°, ψ {job['psi']:g}°, μ {job['mu_int']:g}", job["gamma"]
        else:
            job, value = result["push"], result["force"]
            label, angle = job["shape"], job["theta"]
        lines.setdefault(label, []).append((angle, value))
    dim = max(len(value) for line in lines.values() for _, value in line)
    names = "xyz" if dim == 3 else "xz"
    figure = Figure(figsize=(5 * dim, 5.5), dpi=110, layout="constrained")
    axes = figure.subplots(1, dim, squeeze=False)[0]
    for label, points in sorted(lines.items()):
        angles, values = zip(*sorted(points), strict=True)
        for component, axis in enumerate(axes):
            axis.plot(angles, np.array(values)[:, component], marker="o", markersize=4, label=label)
    for axis, name in zip(axes, names, strict=True):
        axis.set_xlabel(f"direction of motion {'γ' if plates else 'θ'} [°]")
        axis.set_ylabel(f"α_{name} [MN/m³]" if plates else f"F_{name} [N]")
        axis.grid(alpha=0.3)
    axes[-1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path)


def plot_drag(depth: Any, speed: Any, drag: Any, fit: Any, path: Path) -> None:
    """Draw drag against speed, a colour for each depth, and the fit K z + lambda rho L v^2 as lines."""
    figure = Figure(figsize=(7, 5), dpi=110, layout="constrained")
    axes = figure.subplots()
    fine = np.linspace(0.0, speed.max(), 100)
    for colour, z in enumerate(sorted(set(depth.tolist()))):
        own = depth == z
        axes.plot(speed[own], drag[own], "o", color=f"C{colour}", label=f"{1e3 * z:g} mm")
        axes.plot(fine, fit(z, fine), ":", color=f"C{colour}")
    axes.set_xlabel("speed [m/s]")
    axes.set_ylabel("drag [N/m]")
    axes.grid(alpha=0.3)
    axes.legend(title="depth")
    figure.savefig(path)


def plot_wheel(time: Any, velocity: Any, height: Any, frame: Frame, title: str, path: Path) -> None:
    """Draw speed and height of a wheel against time, and the sand at the end."""
    figure = Figure(figsize=(13, 9), dpi=110, layout="constrained")
    grid = figure.add_gridspec(3, 2)
    axes = [figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])]
    axes[0].plot(time, velocity)
    axes[0].set_ylabel("speed [m/s]")
    axes[1].plot(time, 1e3 * height)
    axes[1].set_ylabel("sinkage [mm]")
    for axis in axes:
        axis.set_xlabel("time [s]")
        axis.grid(alpha=0.3)
    for row, field in enumerate(("rate", "velocity"), start=1):
        draw_field(figure.add_subplot(grid[row, :], anchor="W"), frame, field)
    figure.suptitle(title)
    figure.savefig(path)


def plot_lines(
    lines: list[tuple[str, Any, Any]], labels: tuple[str, str], frames: list[tuple[str, Frame, str]], path: Path
) -> None:
    """Draw some curves, and below them some frames, each with its title and its field."""
    rows = (len(frames) + 1) // 2
    figure = Figure(figsize=(13, 4.5 + 3.2 * rows), dpi=110, layout="constrained")
    grid = figure.add_gridspec(1 + rows, 2)
    axes = figure.add_subplot(grid[0, :])
    for name, x, y in lines:
        axes.plot(x, y, label=name, marker="o" if len(x) < 30 else None, linewidth=1.0)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    for i, (title, frame, field) in enumerate(frames):
        axis = figure.add_subplot(grid[1 + i // 2, i % 2])
        draw_field(axis, frame, field)
        axis.set_title(title, fontsize=9)
    figure.savefig(path)
