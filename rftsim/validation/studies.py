"""Every study by name, and the loop over them."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

import mujoco
import rftsim_models

import rftsim
from rftsim.errors import RftsimError
from rftsim.files import Kept
from rftsim.validation import (
    continuum,
    drill,
    held,
    impact,
    measured,
    motion,
    plates,
    runner,
    ruts,
    scaling,
    slopes,
    smooth_wheel,
    wheel,
)
from rftsim.validation.study import Measured, Request, Row, Study


def _study(says: str, module: ModuleType, size: tuple[float, float] = (11.0, 4.8)) -> Study:
    """Make a study of what its module offers, with a figure of a size [inch]."""
    return Study(says, module, module.jobs, module.rows, module.draw, size)


STUDIES: Final = {
    "wheel": _study("grousered wheel of [Agarwal] chapter 4 over its rate", wheel),
    "runner": _study("four-flap runner over its rate", runner),
    "plates": _study("plates dragged, pushed and oblique", plates, (13.0, 4.5)),
    "measured": _study("wheel and plates measured in dry sand", measured, (15.0, 9.0)),
    "scaling": _study("scaling of whole simulations", scaling, (12.0, 4.5)),
    "drill": _study("drilling cylinder of [Agarwal] section 5.10", drill, (15.0, 4.5)),
    "continuum": _study("3D-RFT against the plates and solids of the material point method", continuum, (15.0, 5.0)),
    "motion": _study(
        "dynamic laws against plates at speed and wheels of the material point method", motion, (15.0, 4.8)
    ),
    "held": _study("a wheel held at a slip by the material point method", held, (15.0, 9.0)),
    "smooth-wheel": _study(
        "3D-RFT against a smooth wheel held by the material point method", smooth_wheel, (15.0, 4.8)
    ),
    "impact": _study("plates at speed by the material point method, and spheres dropped on sand", impact),
    "slope": _study("depth and up on slopes, against plates of the material point method", slopes, (15.0, 4.8)),
    "ruts": _study("prints, heaps and ruts against the material point method", ruts, (13.0, 9.0)),
}
"""Every study by name."""

SHARED: Final = ("balance", "cmu", "held", "plates", "played", "pockets", "shipped", "terramechanics")
"""Modules of this folder that the studies' modules compute with."""
PRESENTATION: Final = ("cli", "bench", "validation", "view")
"""Folders that no study computes with, except for its own modules."""


class Finished(NamedTuple):
    """A study that has run, with what it measured."""

    name: str
    """The study's name."""
    study: Study
    """The study itself."""
    measured: Measured
    """Its measurements, by the names of its jobs."""
    rows: list[Row]
    """Its table."""


def choose(names: Iterable[str]) -> list[str]:
    """The names of the studies that are named, or of all where none is.

    Raises:
        RftsimError: There is no study of such a name.
    """
    names = list(dict.fromkeys(names))
    for name in names:
        if name not in STUDIES:
            raise RftsimError(f"no study {name!r}; studies are {', '.join(STUDIES)}")
    return names or list(STUDIES)


def run(names: list[str], request: Request, memory: Path, report: Callable[[str], Any]) -> Iterator[Finished]:
    """Run studies, taking from the memory what was measured before; `report` is called with the name of each job."""
    for name in names:
        study = STUDIES[name]
        kept = Kept(memory / f"{name}.json", _inputs(study))
        results = {}
        for job, measure in study.jobs(request).items():
            results[job] = kept.get(job, measure)
            report(f"{name} {job}")
        yield Finished(name, study, results, study.rows(results))


def _inputs(study: Study) -> bytes:
    """The source of everything that a study computes with."""
    ours = Path(rftsim.__file__).parent
    outside = {ours / name for name in PRESENTATION}
    files = [path for path in ours.rglob("*.py") if not outside & set(path.parents)]
    files += Path(rftsim_models.__file__).parent.rglob("*.py")
    files += [Path(str(study.module.__file__)), *(ours / "validation" / f"{name}.py" for name in SHARED)]
    return b"".join([*(path.read_bytes() for path in sorted(files)), str(mujoco.__version__).encode()])
