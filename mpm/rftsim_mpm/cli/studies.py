"""`rftsim-mpm drag`, `wheel` and `collapse`."""

import dataclasses
from pathlib import Path

import numpy as np
import tyro

from rftsim_mpm.cli.study import Outputs
from rftsim_mpm.collapse import Collapse, exponent, fall
from rftsim_mpm.drag import Drag, drag
from rftsim_mpm.wheel import Wheel, roll


@dataclasses.dataclass(frozen=True)
class DragCommand:
    """Drag an upright plate at several depths and speeds, and fit K z + lambda rho L v^2.

    Example: rftsim-mpm drag --plot drag.png
    """

    study: tyro.conf.OmitArgPrefixes[Drag] = dataclasses.field(default_factory=Drag)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(study, cells=6.0, depths=study.depths[::2], speeds=study.speeds[-2:])
        with self.out.watching("drag") as watch:
            found = drag(study, watch)
        report = {
            **dataclasses.asdict(study),
            "runs": [
                {"depth_m": z, "speed_m_s": v, "drag_N_m": f, "lift_N_m": lift, "noise": run.noise}
                for z, v, f, lift, run in zip(
                    found.depth.tolist(),
                    found.speed.tolist(),
                    found.drag.tolist(),
                    found.lift.tolist(),
                    found.runs,
                    strict=True,
                )
            ],
            "K_N_m2": found.stiffness,
            "lambda": found.inertia,
        }
        lines = [
            f"depth {1e3 * z:g} mm, {v:g} m/s: drag {f:.2f} N/m, lift {lift:.2f} N/m"
            for z, v, f, lift in zip(found.depth, found.speed, found.drag, found.lift, strict=True)
        ]
        lines.append(f"F = {found.stiffness:.0f} z + {found.inertia:.2f} rho L v^2 per metre of width")

        def fit(z: float, v: np.ndarray) -> np.ndarray:
            return found.stiffness * z + found.inertia * study.rho * study.length * v**2

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_drag  # matplotlib is an extra

            plot_drag(found.depth, found.speed, found.drag, fit, path)

        self.out.finish(report, lines, draw)


@dataclasses.dataclass(frozen=True)
class WheelCommand:
    """Let a driven grousered wheel travel and sink.

    Example: rftsim-mpm wheel --rpm 60 --plot wheel.png
    """

    study: tyro.conf.OmitArgPrefixes[Wheel] = dataclasses.field(default_factory=Wheel)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(study, dx=0.005, duration=min(study.time, 0.5))
        with self.out.watching("wheel") as watch:
            found = roll(study, watch)
        root = (study.gravity * 2.0 * study.outer) ** 0.5
        report = {
            **dataclasses.asdict(study),
            "speed_m_s": found.speed,
            "speed_over_sqrt_gl": found.speed / root,
            "sinkage_m": found.sinkage,
            "slip": found.slip,
            "surface_drop_m": found.drop,
        }
        lines = [
            f"{study.rpm:g} RPM: {found.speed:.4f} m/s, {found.speed / root:.3f} sqrt(g l), slip {found.slip:.3f}",
            f"sinkage {1e3 * found.sinkage:.1f} mm; behind, the surface is {1e3 * found.drop:.1f} mm lower than ahead",
        ]

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_wheel  # matplotlib is an extra

            track = found.track
            level = found.sinkage + float(track.after(0.6 * study.time).position[:, 0, 1].mean())
            height = level - track.position[:, 0, 1]
            plot_wheel(track.time, track.velocity[:, 0, 0], height, track.frames[-1], f"wheel, {study.rpm:g} RPM", path)

        self.out.finish(report, lines, draw)


@dataclasses.dataclass(frozen=True)
class CollapseCommand:
    """Let columns collapse and give the exponents of their run-out.

    Example: rftsim-mpm collapse --plot collapse.png
    """

    study: tyro.conf.OmitArgPrefixes[Collapse] = dataclasses.field(default_factory=Collapse)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(study, cells=8)
        found = []
        with self.out.watching("collapse") as watch:
            for i, aspect in enumerate(study.aspects):
                found.append(
                    fall(study, aspect, lambda sim, share, i=i: watch(sim, (i + share) / len(study.aspects)))  # type: ignore[misc]
                )
        aspects, runouts = np.array([f.aspect for f in found]), np.array([f.runout for f in found])
        report: dict[str, object] = {
            **dataclasses.asdict(study),
            "runs": [{"aspect": f.aspect, "runout": f.runout} for f in found],
        }
        lines = [f"aspect {f.aspect:.3g}: run-out {f.runout:.3f} L0" for f in found]
        for name, own in (("squat", aspects <= 2.0), ("tall", aspects >= 3.0)):
            if own.sum() >= 2:
                report[f"exponent_{name}"] = exponent(aspects[own], runouts[own])
                lines.append(f"{name} columns: run-out ~ aspect^{report[f'exponent_{name}']:.2f}")

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_lines  # matplotlib is an extra

            frames = [(f"aspect {f.aspect:.3g}", f.frame, "strain") for f in found]
            plot_lines([("run-out", aspects, runouts)], ("aspect H/L0", "(L - L0)/L0"), frames, path)

        self.out.finish(report, lines, draw)
