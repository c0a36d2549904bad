"""Commands that run a study: its settings, a bar, a picture, a recording, and JSON."""

import abc
import contextlib
import dataclasses
import importlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import tyro
from rich.console import Console

from rftsim_mpm.cli.options import File, Flag
from rftsim_mpm.cli.report import print_json, progress
from rftsim_mpm.errors import MpmError
from rftsim_mpm.fields import Camera, Frame
from rftsim_mpm.output import check_writable, replacing
from rftsim_mpm.simulation import Simulation, Watch

Study = TypeVar("Study")
Found = TypeVar("Found")


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Where a study's results go, and whether it is run quickly."""

    quick: Flag = False
    """Coarser and shorter: a look, not a measurement."""
    json: Flag = False
    """Print JSON instead of lines for people."""
    plot: File = None
    """Draw the result, .png, .pdf or .svg."""
    record: File = None
    """Write a Rerun recording of the first run, .rrd."""

    def check(self) -> None:
        """Refuse what cannot be written, or drawn for want of an extra, before anything runs."""
        if self.plot:
            check_writable(self.plot, ".png", ".pdf", ".svg")
            _needs("plots", "--plot", "matplotlib")
        if self.record:
            check_writable(self.record, ".rrd")
            _needs("record", "--record", "rerun-sdk")

    @contextlib.contextmanager
    def watching(self, title: str) -> Iterator[Watch]:
        """Give a watch that moves a bar with the time left, and records the first run."""
        with contextlib.ExitStack() as stack:
            show = stack.enter_context(progress(title, quiet=self.json))
            recorder: Any = None
            if self.record:
                from rftsim_mpm.record import Recorder  # rerun is an extra

                recorder = Recorder(self.record)
                stack.callback(recorder.close)
            first: list[Simulation] = []

            def watch(sim: Simulation, share: float) -> None:
                if not first:
                    first.append(sim)
                if sim.steps % 20 == 0:
                    show(share)
                if recorder is not None and sim is first[0]:
                    recorder.log(sim)

            yield watch

    def finish(self, report: dict[str, Any], lines: list[str], draw: Callable[[Path], None]) -> None:
        """Print, so that nothing is lost whatever becomes of the picture, and draw."""
        console = Console(highlight=False, soft_wrap=True)
        if self.json:
            print_json(report)
        else:
            for line in lines:
                console.print(line)
        if self.plot:
            with replacing(self.plot) as temporary:
                draw(temporary)
        if self.json:
            return
        for path in (self.plot, self.record):
            if path:
                console.print(f"wrote {path}")


def _needs(module: str, option: str, package: str) -> None:
    try:
        importlib.import_module(f"rftsim_mpm.{module}")
    except ImportError as error:
        raise MpmError(f"{option} needs {package}: pip install {package}") from error


@dataclasses.dataclass(frozen=True)
class StudyCommand(abc.ABC, Generic[Study, Found]):
    """A study's settings, where its results go, and what is said of them."""

    title: ClassVar[str]
    """Title of the bar that shows how far the study is."""
    study: tyro.conf.OmitArgPrefixes[Study]
    out: Annotated[tyro.conf.OmitArgPrefixes[Outputs], tyro.conf.arg(help="")]

    def __call__(self) -> None:
        """Run the study, print what it found and draw it."""
        self.out.check()
        study = self._quicker() if self.out.quick else self.study
        with self.out.watching(self.title) as watch:
            found = self._run(study, watch)
        report = {**dataclasses.asdict(study), **self._report(study, found)}  # type: ignore[call-overload]
        self.out.finish(report, self._lines(study, found), lambda path: self._draw(study, found, path))

    @abc.abstractmethod
    def _quicker(self) -> Study:
        """Return the study as `--quick` runs it."""

    @abc.abstractmethod
    def _run(self, study: Study, watch: Watch) -> Found:
        """Run the study and return what it found."""

    @abc.abstractmethod
    def _report(self, study: Study, found: Found) -> dict[str, Any]:
        """Return what JSON says besides the study's settings."""

    @abc.abstractmethod
    def _lines(self, study: Study, found: Found) -> list[str]:
        """Return the lines that say the same to people."""

    @abc.abstractmethod
    def _draw(self, study: Study, found: Found, path: Path) -> None:
        """Write the picture; matplotlib is an extra, so it is imported here."""


def with_last_frame(watch: Watch) -> tuple[Watch, list[Frame]]:
    """Return a watch that also takes a frame at the end, and that frame; rates are over the last twentieth."""
    cameras: list[Camera] = []
    frames: list[Frame] = []

    def shoot(sim: Simulation, share: float) -> None:
        watch(sim, share)
        if not cameras and share > 0.95:
            cameras.append(Camera(sim))
        if cameras and share >= 1.0 and not frames:
            frames.append(cameras[0].shoot(sim))

    return shoot, frames
