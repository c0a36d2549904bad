"""The commands `rftsim-mpm case ...`: the verification cases of the source."""

import dataclasses
from pathlib import Path
from typing import Any, Final

from rftsim_mpm.cases import (
    CylinderDrag,
    CylinderForces,
    Plates,
    PlatesForces,
    Plowing,
    PlowingForces,
    ShearZone,
    Wedge,
    cylinder_drag,
    plates,
    plowing,
    shear_zone,
)
from rftsim_mpm.cli.commands import Group
from rftsim_mpm.cli.study import StudyCommand
from rftsim_mpm.simulation import Watch


class CaseOne(StudyCommand[CylinderDrag, CylinderForces]):
    """Case 1, a cylinder dragged: drag grows with depth, lift levels off (NDPM).

    Example: rftsim-mpm case 1 --plot case.png
    """

    title = "case 1"

    def _quicker(self) -> CylinderDrag:
        return dataclasses.replace(self.study, cells=4.0, travel=1.5, depths=self.study.depths[::3])

    def _run(self, study: CylinderDrag, watch: Watch) -> CylinderForces:
        return cylinder_drag(study, watch)

    def _report(self, study: CylinderDrag, found: CylinderForces) -> dict[str, Any]:
        return {
            "drag_over_unit": found.drag.tolist(),
            "lift_over_unit": found.lift.tolist(),
            "r_squared": found.r_squared,
        }

    def _lines(self, study: CylinderDrag, found: CylinderForces) -> list[str]:
        each = [
            f"depth {1e3 * z:g} mm: drag {d:.1f}, lift {lift:.1f} times pi (D/2)^2 rho g"
            for z, d, lift in zip(found.depth, found.drag, found.lift, strict=True)
        ]
        return [*each, f"a line through the drag has R^2 {found.r_squared:.4f}"]

    def _draw(self, study: CylinderDrag, found: CylinderForces, path: Path) -> None:
        from rftsim_mpm.plots import plot_lines

        curves = [(name, found.depth / study.diameter, f) for name, f in (("drag", found.drag), ("lift", found.lift))]
        some = [
            (f"depth {1e3 * found.depth[i]:g} mm", found.frames[i], field)
            for i in (0, -1)
            for field in ("rate", "pressure")
        ]
        plot_lines(curves, ("depth / D", "force / π(D/2)²ρg"), some, path)


class CaseTwo(StudyCommand[Plates, PlatesForces]):
    """Case 2, plates pushed down: peak ~ L^2, deeper force ~ z L, and a pair helps itself at a small gap (NDPM).

    Example: rftsim-mpm case 2 --plot case.png
    """

    title = "case 2"

    def _quicker(self) -> Plates:
        few, gaps = self.study.lengths[1::2], self.study.gaps[::3]
        return dataclasses.replace(self.study, dx=0.01, depth=0.05, lengths=few, gaps=gaps, bed=(0.8, 0.4))

    def _run(self, study: Plates, watch: Watch) -> PlatesForces:
        return plates(study, watch)

    def _report(self, study: Plates, found: PlatesForces) -> dict[str, Any]:
        return {
            "peak_N_m": found.peak.tolist(),
            "deep_N_m": found.deep.tolist(),
            "peak_exponent": found.peak_exponent,
            "deep_exponent": found.deep_exponent,
            "pair_N_m": found.pair.tolist(),
        }

    def _lines(self, study: Plates, found: PlatesForces) -> list[str]:
        return [
            *(
                f"L {length:g} m: first peak {p:.0f} N/m, deep {d:.0f} N/m"
                for length, p, d in zip(study.lengths, found.peak, found.deep, strict=True)
            ),
            f"first peak ~ L^{found.peak_exponent:.2f}, deep force ~ L^{found.deep_exponent:.2f}",
            *(f"gap {g:g} L: {f:.0f} N/m on each of two plates" for g, f in zip(study.gaps, found.pair, strict=True)),
        ]

    def _draw(self, study: Plates, found: PlatesForces, path: Path) -> None:
        from rftsim_mpm.plots import plot_lines

        curves = [(f"L {1e3 * n:g} mm", 1e3 * z, f) for n, (z, f) in zip(study.lengths, found.curves, strict=True)]
        some = [("the pair with the widest gap", found.frame, field) for field in ("rate", "strain")]
        plot_lines(curves, ("depth [mm]", "force [N/m]"), some, path)


class CaseThree(StudyCommand[Plowing, PlowingForces]):
    """Case 3, plowing: smooth drag in loose sand, fluctuating in dense sand (DPM).

    Example: rftsim-mpm case 3 --plot case.png
    """

    title = "case 3"

    def _quicker(self) -> Plowing:
        some = self.study.packings[::3]
        return dataclasses.replace(self.study, dx=0.01, travel=0.1, bed=(0.6, 0.15), packings=some)

    def _run(self, study: Plowing, watch: Watch) -> PlowingForces:
        return plowing(study, watch)

    def _report(self, study: Plowing, found: PlowingForces) -> dict[str, Any]:
        return {"mean_drag_N_m": found.mean.tolist(), "fluctuation": found.fluctuation.tolist()}

    def _lines(self, study: Plowing, found: PlowingForces) -> list[str]:
        return [
            f"packing {phi:g}: mean drag {mean:.0f} N/m, fluctuation {mean * part:.1f} N/m, {100 * part:.1f} %"
            for phi, mean, part in zip(study.packings, found.mean, found.fluctuation, strict=True)
        ]

    def _draw(self, study: Plowing, found: PlowingForces, path: Path) -> None:
        from rftsim_mpm.plots import plot_lines

        drags = zip(study.packings, found.drag, strict=True)
        some = [
            (f"initial packing {study.packings[i]:g}", found.frames[i], field)
            for i in (0, -1)
            for field in ("packing", "strain")
        ]
        curves = [(f"packing {phi:g}", found.travel[: len(f)], f) for phi, f in drags]
        plot_lines(curves, ("travel [m]", "drag [N/m]"), some, path)


class CaseFour(StudyCommand[ShearZone, Wedge]):
    """Case 4, the zone under a plate that moves with it: blunt at first, then a wedge (DPM).

    Example: rftsim-mpm case 4 --plot case.png
    """

    title = "case 4"

    def _quicker(self) -> ShearZone:
        return dataclasses.replace(self.study, dx=0.004)

    def _run(self, study: ShearZone, watch: Watch) -> Wedge:
        return shear_zone(study, watch)

    def _report(self, study: ShearZone, found: Wedge) -> dict[str, Any]:
        return {
            "time_v_over_L": found.time.tolist(),
            "wedge_height_over_L": found.height.tolist(),
            "bluntness": found.bluntness.tolist(),
        }

    def _lines(self, study: ShearZone, found: Wedge) -> list[str]:
        return [
            f"t v/L {t:.2f}: the zone is {h:.2f} L high, half way down {b:.2f} times as wide as at the plate"
            for t, h, b in zip(found.time, found.height, found.bluntness, strict=True)
        ]

    def _draw(self, study: ShearZone, found: Wedge, path: Path) -> None:
        from rftsim_mpm.plots import plot_lines

        track = found.track
        curve = [("force", track.time * study.speed / 0.04, track.force[:, 0, 1])]
        some = [(f"t v/L {t:.2f}", frame, "rate") for t, frame in zip(found.time, track.frames, strict=True)]
        plot_lines(curve, ("t v / L", "force [N/m]"), some, path)


CASES: Final = Group(
    "The verification cases of [Agarwal] section 2.4.\n\nExample: rftsim-mpm case 1 --plot case.png",
    {"1": CaseOne, "2": CaseTwo, "3": CaseThree, "4": CaseFour},
)
