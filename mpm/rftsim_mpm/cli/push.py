"""`rftsim-mpm push`."""

import dataclasses
from pathlib import Path

import tyro

from rftsim_mpm.cli.study import Outputs
from rftsim_mpm.fields import Camera, Frame
from rftsim_mpm.push import Push, measure
from rftsim_mpm.simulation import Simulation


@dataclasses.dataclass(frozen=True)
class PushCommand:
    """Push a solid through deep sand and read its force and moment.

    Example: rftsim-mpm push --shape cube-60-45 --theta 30 --plot push.png
    """

    study: tyro.conf.OmitArgPrefixes[Push] = dataclasses.field(default_factory=Push)
    out: tyro.conf.OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)

    def __call__(self) -> None:
        """Run and report."""
        self.out.check()
        study = self.study.quick if self.out.quick else self.study
        camera: Camera | None = None
        frames: list[Frame] = []
        with self.out.watching(study.shape) as show:

            def watch(sim: Simulation, share: float) -> None:
                nonlocal camera
                show(sim, share)
                if camera is None and share > 0.95:
                    camera = Camera(sim)
                if camera is not None and share >= 1.0 and not frames:
                    frames.append(camera.shoot(sim))

            found = measure(study, watch)
        names = "xyz"
        lines = [
            ", ".join(f"F{n} {f:.4g} N" for n, f in zip(names, found.force, strict=True)),
            ", ".join(f"M{n} {m:.4g} N m" for n, m in zip(names, found.moment, strict=True)) + " about the centroid",
            f"noise of 0.5 ms averages {100 * found.noise:.1f} %",
        ]

        def draw(path: Path) -> None:
            from rftsim_mpm.plots import plot_history  # matplotlib is an extra

            plot_history(found.history, f"{study.shape}, θ {study.theta:g}°", path, frames[-1], "N")

        self.out.finish({**dataclasses.asdict(study), **found.report}, lines, draw)
