"""The commands `rftsim-mpm footprint`, `rftsim-mpm blade` and `rftsim-mpm rut`: sand that remembers."""

from pathlib import Path
from typing import Any

from rftsim_mpm.blade import SHARES, Blade, Heap, plow
from rftsim_mpm.cli.study import StudyCommand
from rftsim_mpm.footprint import Footprint, Prints, press
from rftsim_mpm.rut import Passes, Rut, follow_rut
from rftsim_mpm.simulation import Watch


class FootprintCommand(StudyCommand[Footprint, Prints]):
    """Press a foot twice into the same place.

    Example: rftsim-mpm footprint --depth 0.02 --plot footprint.png
    """

    title = "footprint"

    def _quicker(self) -> Footprint:
        return self.study.quick

    def _run(self, study: Footprint, watch: Watch) -> Prints:
        return press(study, watch)

    def _report(self, study: Footprint, found: Prints) -> dict[str, Any]:
        return found.report

    def _lines(self, study: Footprint, found: Prints) -> list[str]:
        said = found.report
        pairs = zip(said["depths_m"], said["ratios"], strict=True)
        return [
            *(f"base {1e3 * z:.0f} mm deep: the second push is {ratio:.2f} times the first" for z, ratio in pairs),
            f"the print is {1e3 * said['print_m']:.1f} mm deep, its walls {said['wall_deg']:.0f} degrees steep, "
            f"its rims {1e3 * said['rim_m']:.1f} mm high and of {said['rim_over_print']:.2f} times its volume",
        ]

    def _draw(self, study: Footprint, found: Prints, path: Path) -> None:
        from rftsim_mpm.plots import plot_surfaces

        pushes = (("first push", found.first), ("second push", found.second))
        lines = [(name, 1e3 * depth, force) for name, (depth, force) in pushes]
        surfaces = [("foot in", found.pressed), ("foot out", found.left), ("foot in again", found.end)]
        plot_surfaces(lines, ("depth of the base [mm]", "force [N/m]"), surfaces, path)


class BladeCommand(StudyCommand[Blade, Heap]):
    """Drag an upright blade at constant depth, and heap up sand ahead of it.

    Example: rftsim-mpm blade --travel 0.1 --plot blade.png
    """

    title = "blade"

    def _quicker(self) -> Blade:
        return self.study.quick

    def _run(self, study: Blade, watch: Watch) -> Heap:
        return plow(study, watch)

    def _report(self, study: Blade, found: Heap) -> dict[str, Any]:
        return found.report

    def _lines(self, study: Blade, found: Heap) -> list[str]:
        said = found.report
        columns = (said["travel_m"], said["drag_N_m"], said["heap_m"], said["raised_m2"])
        return [
            f"drag without a heap {said['start_N_m']:.1f} N/m, growing by {1e-3 * said['growth_N_m2']:.2f} N/m per mm",
            *(
                f"after {1e3 * way:.0f} mm: drag {drag:.1f} N/m, heap {1e3 * heap:.1f} mm high, "
                f"holding {raised / (way * study.depth):.2f} of what was swept"
                for way, drag, heap, raised in zip(*columns, strict=True)
            ),
        ]

    def _draw(self, study: Blade, found: Heap, path: Path) -> None:
        from rftsim_mpm.plots import plot_surfaces

        lines = [("drag", 1e3 * found.travel, -found.force[:, 0]), ("lift", 1e3 * found.travel, found.force[:, 1])]
        ways = zip(SHARES, found.reliefs, strict=True)
        surfaces = [(f"after {1e3 * share * study.travel:.0f} mm", relief) for share, relief in ways]
        plot_surfaces(lines, ("travel [mm]", "force [N/m]"), surfaces, path)


class RutCommand(StudyCommand[Rut, Passes]):
    """Let a driven grousered wheel roll twice over the same sand.

    Example: rftsim-mpm rut --rpm 20 --plot rut.png
    """

    title = "rut"

    def _quicker(self) -> Rut:
        return self.study.quick

    def _run(self, study: Rut, watch: Watch) -> Passes:
        return follow_rut(study, watch)

    def _report(self, study: Rut, found: Passes) -> dict[str, Any]:
        return found.report

    def _lines(self, study: Rut, found: Passes) -> list[str]:
        said = found.report
        columns = (said["slip"], said["sinkage_m"], said["rut_m"])
        return [
            f"{name} pass: slip {slip:.3f}, sinkage {1e3 * sunk:.1f} mm; it leaves a rut {1e3 * rut:.1f} mm deep"
            for name, slip, sunk, rut in zip(("first", "second"), *columns, strict=True)
        ]

    def _draw(self, study: Rut, found: Passes, path: Path) -> None:
        from rftsim_mpm.plots import plot_surfaces

        passes = (("first pass", found.first), ("second pass", found.second))
        lines = [(name, 1e3 * one.travel, 1e3 * one.sinkage) for name, one in passes]
        surfaces = [("after the first pass", found.left), ("after the second pass", found.end)]
        plot_surfaces(lines, ("travel [mm]", "sinkage [mm]"), surfaces, path)
