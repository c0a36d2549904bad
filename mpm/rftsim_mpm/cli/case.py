"""`rftsim-mpm case`: the verification cases of the source."""

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from rftsim_mpm.cases import CylinderDrag, Plates, Plowing, ShearZone, cylinder_drag, plates, plowing, shear_zone
from rftsim_mpm.cli.study import Outputs


@dataclasses.dataclass(frozen=True)
class CaseOne:
    """Case 1, a cylinder dragged: drag grows with depth, lift levels off (NDPM)."""

    study: tyro.conf.OmitArgPrefixes[CylinderDrag] = dataclasses.field(default_factory=CylinderDrag)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(study, cells=4.0, travel=1.5, depths=study.depths[::3])
        with self.out.watching("case 1") as watch:
            found = cylinder_drag(study, watch)
        report = {
            **dataclasses.asdict(study),
            "drag_over_unit": found.drag.tolist(),
            "lift_over_unit": found.lift.tolist(),
            "r_squared": found.r_squared,
        }
        lines = [
            f"depth {1e3 * z:g} mm: drag {d:.1f}, lift {lift:.1f} times pi (D/2)^2 rho g"
            for z, d, lift in zip(found.depth, found.drag, found.lift, strict=True)
        ]
        lines.append(f"a line through the drag has R^2 {found.r_squared:.4f}")

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_lines  # matplotlib is an extra

            curves = [
                ("drag", found.depth / study.diameter, found.drag),
                ("lift", found.depth / study.diameter, found.lift),
            ]
            some = [
                (f"depth {1e3 * found.depth[i]:g} mm", found.frames[i], field)
                for i in (0, -1)
                for field in ("rate", "pressure")
            ]
            plot_lines(curves, ("depth / D", "force / π(D/2)²ρg"), some, path)

        self.out.finish(report, lines, draw)


@dataclasses.dataclass(frozen=True)
class CaseTwo:
    """Case 2, plates pushed down: peak ~ L^2, deeper force ~ z L, and a pair helps itself at a small gap (NDPM)."""

    study: tyro.conf.OmitArgPrefixes[Plates] = dataclasses.field(default_factory=Plates)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(
                study, dx=0.01, depth=0.05, lengths=study.lengths[1::2], gaps=study.gaps[::3], bed=(0.8, 0.4)
            )
        with self.out.watching("case 2") as watch:
            found = plates(study, watch)
        report = {
            **dataclasses.asdict(study),
            "peak_N_m": found.peak.tolist(),
            "deep_N_m": found.deep.tolist(),
            "peak_exponent": found.peak_exponent,
            "deep_exponent": found.deep_exponent,
            "pair_N_m": found.pair.tolist(),
        }
        lines = [
            f"L {length:g} m: first peak {p:.0f} N/m, deep {d:.0f} N/m"
            for length, p, d in zip(study.lengths, found.peak, found.deep, strict=True)
        ]
        lines.append(f"first peak ~ L^{found.peak_exponent:.2f}, deep force ~ L^{found.deep_exponent:.2f}")
        lines += [
            f"gap {g:g} L: {f:.0f} N/m on each of two plates" for g, f in zip(study.gaps, found.pair, strict=True)
        ]

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_lines  # matplotlib is an extra

            curves = [(f"L {1e3 * n:g} mm", 1e3 * z, f) for n, (z, f) in zip(study.lengths, found.curves, strict=True)]
            some = [("the pair with the widest gap", found.frame, field) for field in ("rate", "strain")]
            plot_lines(curves, ("depth [mm]", "force [N/m]"), some, path)

        self.out.finish(report, lines, draw)


@dataclasses.dataclass(frozen=True)
class CaseThree:
    """Case 3, plowing: smooth drag in loose sand, fluctuating in dense sand (DPM)."""

    study: tyro.conf.OmitArgPrefixes[Plowing] = dataclasses.field(default_factory=Plowing)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study
        if self.out.quick:
            study = dataclasses.replace(study, dx=0.01, travel=0.1, bed=(0.6, 0.15), packings=study.packings[::3])
        with self.out.watching("case 3") as watch:
            found = plowing(study, watch)
        report = {
            **dataclasses.asdict(study),
            "mean_drag_N_m": found.mean.tolist(),
            "fluctuation": found.fluctuation.tolist(),
        }
        lines = [
            f"packing {phi:g}: mean drag {mean:.0f} N/m, fluctuation {100 * part:.1f} %"
            for phi, mean, part in zip(study.packings, found.mean, found.fluctuation, strict=True)
        ]

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_lines  # matplotlib is an extra

            curves = [
                (f"packing {phi:g}", found.travel[: len(f)], f)
                for phi, f in zip(study.packings, found.drag, strict=True)
            ]
            some = [
                (f"initial packing {study.packings[i]:g}", found.frames[i], field)
                for i in (0, -1)
                for field in ("packing", "strain")
            ]
            plot_lines(curves, ("travel [m]", "drag [N/m]"), some, path)

        self.out.finish(report, lines, draw)


@dataclasses.dataclass(frozen=True)
class CaseFour:
    """Case 4, the zone under a plate that moves with it: blunt at first, then a wedge (DPM)."""

    study: tyro.conf.OmitArgPrefixes[ShearZone] = dataclasses.field(default_factory=ShearZone)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = dataclasses.replace(self.study, dx=0.004) if self.out.quick else self.study
        with self.out.watching("case 4") as watch:
            found = shear_zone(study, watch)
        report = {
            **dataclasses.asdict(study),
            "time_v_over_L": found.time.tolist(),
            "wedge_height_over_L": found.height.tolist(),
            "bluntness": found.bluntness.tolist(),
        }
        lines = [
            f"t v/L {t:.2f}: the zone is {h:.2f} L high, half way down {b:.2f} times as wide as at the plate"
            for t, h, b in zip(found.time, found.height, found.bluntness, strict=True)
        ]

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_lines  # matplotlib is an extra

            track = found.track
            curve = [("force", track.time * study.speed / 0.04, track.force[:, 0, 1])]
            some = [(f"t v/L {t:.2f}", frame, "rate") for t, frame in zip(found.time, track.frames, strict=True)]
            plot_lines(curve, ("t v / L", "force [N/m]"), some, path)

        self.out.finish(report, lines, draw)


Case = (
    Annotated[CaseOne, tyro.conf.subcommand("1")]
    | Annotated[CaseTwo, tyro.conf.subcommand("2")]
    | Annotated[CaseThree, tyro.conf.subcommand("3")]
    | Annotated[CaseFour, tyro.conf.subcommand("4")]
)


@dataclasses.dataclass(frozen=True)
class CaseCommand:
    """The verification cases of [Agarwal] section 2.4."""

    case: Case

    def __call__(self) -> None:
        """Run the case."""
        self.case()
