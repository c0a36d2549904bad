"""The commands `rftsim-mpm drag`, `rftsim-mpm wheel` and `rftsim-mpm collapse`."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from rftsim_mpm.cli.study import StudyCommand
from rftsim_mpm.collapse import Collapse, Runout, exponent, fall
from rftsim_mpm.drag import Drag, DragForces, drag
from rftsim_mpm.follow import part
from rftsim_mpm.simulation import Watch
from rftsim_mpm.testbed import Held, HeldWheel, hold
from rftsim_mpm.wheel import Rolling, Wheel, roll


class DragCommand(StudyCommand[Drag, DragForces]):
    """Drag an upright plate at several depths and speeds, and fit K z + lambda rho L v^2.

    Example: rftsim-mpm drag --plot drag.png
    """

    title = "drag"

    def _quicker(self) -> Drag:
        study = self.study
        return dataclasses.replace(study, cells=6.0, depths=study.depths[::2], speeds=study.speeds[-2:])

    def _run(self, study: Drag, watch: Watch) -> DragForces:
        return drag(study, watch)

    def _report(self, study: Drag, found: DragForces) -> dict[str, Any]:
        table = np.column_stack([found.depth, found.speed, found.drag, found.lift, [run.noise for run in found.runs]])
        names = "depth_m", "speed_m_s", "drag_N_m", "lift_N_m", "noise"
        return {
            "runs": [dict(zip(names, row, strict=True)) for row in table.tolist()],
            "K_N_m2": found.stiffness,
            "lambda": found.inertia,
        }

    def _lines(self, study: Drag, found: DragForces) -> list[str]:
        each = [
            f"depth {1e3 * z:g} mm, {v:g} m/s: drag {f:.2f} N/m, lift {lift:.2f} N/m"
            for z, v, f, lift in zip(found.depth, found.speed, found.drag, found.lift, strict=True)
        ]
        return [*each, f"F = {found.stiffness:.0f} z + {found.inertia:.2f} rho L v^2 per metre of width"]

    def _draw(self, study: Drag, found: DragForces, path: Path) -> None:
        from rftsim_mpm.plots import plot_drag

        def fit(z: float, v: np.ndarray) -> np.ndarray:
            return found.stiffness * z + found.inertia * study.rho * study.length * v**2

        plot_drag(found.depth, found.speed, found.drag, fit, path)


class WheelCommand(StudyCommand[HeldWheel, Rolling | Held]):
    """Let a driven grousered wheel travel and sink, or hold it at a slip, and a sinkage, and read the forces on it.

    Example: rftsim-mpm wheel --rpm 60 --plot wheel.png
    """

    title = "wheel"

    def _quicker(self) -> HeldWheel:
        return self.study.quick

    def _run(self, study: HeldWheel, watch: Watch) -> Rolling | Held:
        return hold(study, watch) if study.held else roll(study, watch)

    def _report(self, study: HeldWheel, found: Rolling | Held) -> dict[str, Any]:
        if isinstance(found, Held):
            return found.report
        return found.report | {"speed_over_sqrt_gl": found.speed / _unit_speed(study)}

    def _lines(self, study: HeldWheel, found: Rolling | Held) -> list[str]:
        if isinstance(found, Held):
            names, units = ("load", "drawbar", "torque", "sinkage"), ("N/m", "N/m", "N", "m")
            loads = zip(names, found.means, found.noise, units, strict=True)
            lines = [f"{name} {mean:.4g} ± {noise:.2g} {unit}" for name, mean, noise, unit in loads]
            lines.append(f"behind, the sand leaves the rim {1e3 * found.rear:.1f} mm below the level surface")
            return [*lines, f"over that time it sinks by {1e3 * found.sinking:.1f} mm"] if study.sinks else lines
        scaled = found.speed / _unit_speed(study)
        return [
            f"{study.rpm:g} RPM: {found.speed:.4f} m/s, {scaled:.3f} sqrt(g l), slip {found.slip:.3f}; "
            f"over that time the speed changes by {100 * found.drift:.0f} %",
            f"sinkage {1e3 * found.sinkage:.1f} mm; behind, the surface is {1e3 * found.drop:.1f} mm lower than ahead",
        ]

    def _draw(self, study: HeldWheel, found: Rolling | Held, path: Path) -> None:
        from rftsim_mpm.plots import plot_lines, plot_wheel

        if isinstance(found, Held):
            curves = [(name, found.time, found.forces[:, i]) for i, name in enumerate(("load", "drawbar"))]
            frames = [("", found.frame, field) for field in ("rate", "pressure")]
            plot_lines(curves, ("time [s]", "force [N/m]"), frames, path)
        else:
            frame = found.track.frames[-1]
            plot_wheel(found.time, found.speeds, found.sinkages, frame, f"wheel, {study.rpm:g} RPM", path)


def _unit_speed(study: Wheel) -> float:
    """Speed that the wheel's is scaled by, sqrt(g l) with l the outer diameter [m/s]."""
    return float((study.gravity * 2.0 * study.outer) ** 0.5)


class CollapseCommand(StudyCommand[Collapse, list[Runout]]):
    """Let columns collapse and give the exponents of their run-out.

    Example: rftsim-mpm collapse --plot collapse.png
    """

    title = "collapse"

    def _quicker(self) -> Collapse:
        return dataclasses.replace(self.study, cells=8)

    def _run(self, study: Collapse, watch: Watch) -> list[Runout]:
        count = len(study.aspects)
        return [fall(study, aspect, part(watch, i, count)) for i, aspect in enumerate(study.aspects)]

    def _report(self, study: Collapse, found: list[Runout]) -> dict[str, Any]:
        return {
            "runs": [{"aspect": one.aspect, "runout": one.runout} for one in found],
            **{f"exponent_{name}": power for name, power in _exponents(found).items()},
        }

    def _lines(self, study: Collapse, found: list[Runout]) -> list[str]:
        return [
            *(f"aspect {one.aspect:.3g}: run-out {one.runout:.3f} L0" for one in found),
            *(f"{name} columns: run-out ~ aspect^{power:.2f}" for name, power in _exponents(found).items()),
        ]

    def _draw(self, study: Collapse, found: list[Runout], path: Path) -> None:
        from rftsim_mpm.plots import plot_lines

        curve = [("run-out", *_arrays(found))]
        frames = [(f"aspect {one.aspect:.3g}", one.frame, "strain") for one in found]
        plot_lines(curve, ("aspect H/L0", "(L - L0)/L0"), frames, path)


def _arrays(found: list[Runout]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([one.aspect for one in found]), np.array([one.runout for one in found])


def _exponents(found: list[Runout]) -> dict[str, float]:
    """Exponents of the squat and of the tall columns' run-out, where there are two or more of them."""
    aspects, runouts = _arrays(found)
    parts = {"squat": aspects <= 2.0, "tall": aspects >= 3.0}
    return {name: exponent(aspects[own], runouts[own]) for name, own in parts.items() if own.sum() >= 2}
