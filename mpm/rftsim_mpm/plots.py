"""Pictures of sand, and diagrams of what the studies found."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.ndimage import binary_closing
from scipy.spatial import cKDTree

from rftsim_mpm.fields import Frame
from rftsim_mpm.reading import History

PANELS = {
    "strain": ("equivalent plastic strain [-]", "magma", 99.0),
    "rate": ("shear strain rate [1/s]", "inferno", 98.0),
    "pressure": ("pressure [Pa]", "viridis", 99.5),
    "packing": ("packing fraction [-]", "cividis", None),
    "velocity": ("speed [m/s]", "turbo", 99.5),
}
"""Each field's label, colours, and the percentile that the colours end at."""
MOST_PIXELS = 900
"""Pixels along the longer side of a picture of sand, at the most."""


def draw_field(axes: Axes, frame: Frame, field: str) -> Any:
    """Draw the sand coloured by a field, the free surface and the bodies."""
    label, colours, percentile = PANELS[field]
    values = getattr(frame, field)
    if field == "velocity":
        values = np.linalg.norm(values, axis=1)
    low, high = (
        (0.0, max(float(np.percentile(values, percentile)), 1e-12)) if percentile else np.percentile(values, [2, 98])
    )
    image, extent = _image(frame, values)
    shown = axes.imshow(
        image,
        extent=extent,
        origin="lower",
        interpolation="nearest",
        cmap=colours,
        vmin=low,
        vmax=high if high > low else low + 1e-6,
    )
    axes.add_collection(LineCollection(_open_surface(frame.surface, frame.outlines), colors="0.3", linewidths=0.8))
    for outline in frame.outlines:
        axes.fill(*outline.T, facecolor="0.75", edgecolor="0.1", linewidth=0.8)
    tops = [extent[3], *(outline[:, 1].max() for outline in frame.outlines)]
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], max(tops) + 2.0 * frame.spacing)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("z [m]")
    axes.figure.colorbar(shown, ax=axes, label=label, shrink=0.8)
    return shown


def _image(frame: Frame, values: Any) -> tuple[Any, tuple[float, float, float, float]]:
    """Each pixel in the sand has its nearest particle's value, the others are masked; and the edges (x, x, z, z)."""
    spacing = frame.spacing
    low, high = frame.place.min(axis=0) - 0.5 * spacing, frame.place.max(axis=0) + 0.5 * spacing
    pixel = max(spacing / 3.0, float((high - low).max()) / MOST_PIXELS)
    shape = np.maximum(np.rint((high - low) / pixel).astype(int), 1)
    x, z = (a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, shape, strict=True))
    distance, nearest = cKDTree(frame.place).query(np.stack(np.meshgrid(x, z), axis=-1))
    reach = math.ceil(1.5 * spacing / pixel)
    disc = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) <= reach
    sand = np.pad(distance <= 0.75 * spacing, reach)
    sand = binary_closing(sand, disc)[reach:-reach, reach:-reach]  # what is narrower than three particles is a pore
    return np.ma.masked_where(~sand, values[nearest]), (low[0], high[0], low[1], high[1])


def _open_surface(surface: Any, outlines: list[Any]) -> list[Any]:
    """The free surface in pieces, without what lies inside or under a body."""
    step = np.median(np.diff(surface[:, 0]))
    for outline in outlines:
        surface = surface[surface[:, 1] > _top(outline, surface[:, 0])]
    jumps = np.diff(surface[:, 0]) > 1.5 * step
    return [piece for piece in np.split(surface, np.flatnonzero(jumps) + 1) if len(piece) > 1]


def _top(outline: Any, x: Any) -> Any:
    """Height of a polygon's highest point over each x, minus infinity beside it."""
    (x0, z0), (x1, z1) = outline.T[..., None], np.roll(outline, -1, axis=0).T[..., None]
    share = (x - x0) / np.where(x1 == x0, 1.0, x1 - x0)
    height = np.where((x1 == x0) | (share < 0.0) | (share > 1.0), -np.inf, z0 + share * (z1 - z0))
    return height.max(axis=0)


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
    """Draw force against the direction of motion, by component: of plates per area and depth, of pushes as it is.

    A plate's angles on a slope are those from its surface.
    """
    plates = [result for result in found if "plate" in result or "slope" in result] or None
    lines: dict[str, list[tuple[float, list[float]]]] = {}
    for result in plates or found:
        if plates:
            job, value = result["plate" if "plate" in result else "slope"], [1e-6 * a for a in result["alpha_N_m3"]]
            place = f"slope {job['slope']:g}°" if "slope" in job else f"ψ {job['psi']:g}°"
            label, angle = f"β {job['beta']:g}°, {place}, μ {job['mu_int']:g}", job["gamma"]
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
    figure = Figure(figsize=(13, 7), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot(time, velocity)
    axes[0, 0].set_ylabel("speed [m/s]")
    axes[0, 1].plot(time, 1e3 * height)
    axes[0, 1].set_ylabel("sinkage [mm]")
    for axis in axes[0]:
        axis.set_xlabel("time [s]")
        axis.grid(alpha=0.3)
    for axis, field in zip(axes[1], ("rate", "velocity"), strict=True):
        draw_field(axis, frame, field)
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
