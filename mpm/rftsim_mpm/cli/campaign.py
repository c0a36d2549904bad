"""The commands `rftsim-mpm campaign ...`: grids of plates, pushes, wheels and slopes."""

import dataclasses
import os
import sys
from pathlib import Path
from typing import Any, Final

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rftsim_mpm.campaign import Status, alone, begin, manifest, read_jobs, results, run, run_on_ray, status
from rftsim_mpm.cli.commands import Group
from rftsim_mpm.cli.options import File, Flag, Text
from rftsim_mpm.cli.report import print_json
from rftsim_mpm.errors import MpmError
from rftsim_mpm.output import check_writable, replacing

Folder = tyro.conf.Positional[Path]


@dataclasses.dataclass(frozen=True)
class Work:
    """How the jobs that are not there yet are computed."""

    processes: int = os.cpu_count() or 1
    """Jobs at a time, one thread each."""
    ray: Text = None
    """Use Ray instead: "local", or the address of a cluster."""
    json: Flag = False
    """Print JSON instead of lines for people."""

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise MpmError(f"processes must be at least 1, not {self.processes}")

    def __call__(self, folder: Path) -> None:
        """Compute what is missing, and say how it ended."""
        with alone(folder):
            found = status(folder)
            left = len(found.missing) + len(found.damaged)
            columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
            console = Console(stderr=True)
            with Progress(
                *columns,
                TextColumn("left"),
                TimeRemainingColumn(),
                console=console,
                disable=self.json or not console.is_terminal,
            ) as bar:
                task = bar.add_task("jobs", total=left)
                if self.ray is None:
                    failed = run(folder, self.processes, lambda name: bar.advance(task))
                else:
                    failed = run_on_ray(
                        folder, None if self.ray == "local" else self.ray, lambda name: bar.advance(task)
                    )
        _say(folder, status(folder), self.json, {"computed": left - len(failed), "failed": failed})
        if failed:
            sys.exit(1)


@dataclasses.dataclass(frozen=True)
class CampaignRun:
    """Compute the plates, pushes, wheels and slopes of a TOML file; what is there already is kept.

    Example: rftsim-mpm campaign run plates.toml out/plates
    """

    file: Folder
    """TOML: [[plates]], [[pushes]], [[wheels]] or [[slopes]] with lists for the axes of a grid, and [defaults]."""
    folder: Folder
    """Where manifest.json and results/ go."""
    work: tyro.conf.OmitArgPrefixes[Work] = dataclasses.field(default_factory=Work)
    quick: Flag = False
    """Coarser cells and less sand: a look, not a measurement."""

    def __call__(self) -> None:
        """Make the campaign's folder and compute what it lacks."""
        jobs = read_jobs(self.file)
        if self.quick:
            jobs = [job.quick for job in jobs]
        begin(self.folder, jobs)
        self.work(self.folder)


@dataclasses.dataclass(frozen=True)
class CampaignResume:
    """Compute what a campaign lacks: unfinished jobs, and results that are damaged.

    Example: rftsim-mpm campaign resume out/plates
    """

    folder: Folder
    """The campaign's folder."""
    work: tyro.conf.OmitArgPrefixes[Work] = dataclasses.field(default_factory=Work)

    def __call__(self) -> None:
        """Compute what the campaign in the folder lacks."""
        manifest(self.folder)
        self.work(self.folder)


@dataclasses.dataclass(frozen=True)
class CampaignStatus:
    """Say how far a campaign is; with --plot, draw the forces that it has.

    Example: rftsim-mpm campaign status out/plates --plot forces.png
    """

    folder: Folder
    """The campaign's folder."""
    plot: File = None
    """Draw force per area and depth against the direction of motion, .png, .pdf or .svg."""
    json: Flag = False
    """Print JSON instead of lines for people."""

    def __call__(self) -> None:
        """Say how far the campaign is, and draw."""
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
        found = status(self.folder)
        if self.plot:
            from rftsim_mpm.plots import plot_campaign  # matplotlib is an extra

            drawn = [one for one in results(self.folder) if "plate" in one or "push" in one]
            if not drawn:
                raise MpmError(f"the campaign in {self.folder} has no result to draw yet: plates and pushes are drawn")
            with replacing(self.plot) as temporary:
                plot_campaign(drawn, temporary)
        _say(self.folder, found, self.json, {})


@dataclasses.dataclass(frozen=True)
class CampaignVerify:
    """Check every result against its checksum and its job; exits with 1 where one is damaged.

    Example: rftsim-mpm campaign verify out/plates
    """

    folder: Folder
    """The campaign's folder."""
    json: Flag = False
    """Print JSON instead of lines for people."""

    def __call__(self) -> None:
        """Check every result and say which are damaged."""
        found = status(self.folder)
        _say(self.folder, found, self.json, {})
        if found.damaged:
            sys.exit(1)


CAMPAIGNS: Final = Group(
    "A grid of plates, pushes, wheels or slopes as independent processes; stop it in any way, and resume.\n\n"
    "Example: rftsim-mpm campaign run plates.toml out/plates",
    {"run": CampaignRun, "resume": CampaignResume, "status": CampaignStatus, "verify": CampaignVerify},
)


def _say(folder: Path, found: Status, json: bool, more: dict[str, Any]) -> None:
    if json:
        print_json({**found._asdict(), **more})
        return
    console = Console(highlight=False, soft_wrap=True)
    counts = ", ".join(f"{len(keys)} {name}" for name, keys in found._asdict().items())
    console.print(f"{folder}: {counts}" + (f"; {more['computed']} computed now" if "computed" in more else ""))
    for name in found.damaged:
        console.print(f"[red]damaged:[/red] {folder / 'results' / name}.json; `campaign resume` computes it again")
    for line in more.get("failed", []):
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"[red]failed:[/red] {line}")
