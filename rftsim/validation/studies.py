"""Every study by name, and the loop over them."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import rftsim_models

import rftsim
from rftsim.errors import RftsimError
from rftsim.files import Kept
from rftsim.validation import continuum, drill, measured, motion, plates, runner, scaling, wheel
from rftsim.validation.study import Measured, Request, Row, Study

STUDIES: Final = {
    "wheel": Study("grousered wheel of [Agarwal] chapter 4 over its rate", wheel, wheel.jobs, wheel.rows, wheel.draw),
    "runner": Study("four-flap runner over its rate", runner, runner.jobs, runner.rows, runner.draw),
    "plates": Study("plates dragged, pushed and oblique", plates, plates.jobs, plates.rows, plates.draw, (13.0, 4.5)),
    "measured": Study(
        "wheel and plates measured in dry sand", measured, measured.jobs, measured.rows, measured.draw, (15.0, 9.0)
    ),
    "scaling": Study("scaling of whole simulations", scaling, scaling.jobs, scaling.rows, scaling.draw, (12.0, 4.5)),
    "drill": Study(
        "drilling cylinder of [Agarwal] section 5.10", drill, drill.jobs, drill.rows, drill.draw, (15.0, 4.5)
    ),
    "continuum": Study(
        "3D-RFT against the plates and solids of the material point method",
        continuum,
        continuum.jobs,
        continuum.rows,
        continuum.draw,
        (15.0, 5.0),
    ),
    "motion": Study(
        "dynamic laws against plates at speed and wheels of the material point method",
        motion,
        motion.jobs,
        motion.rows,
        motion.draw,
        (15.0, 4.8),
    ),
}
"""Every study by name."""


SHARED: Final = ("balance", "cmu", "plates", "pockets", "shipped", "terramechanics")
"""Modules that studies compute with."""


class Found(NamedTuple):
    """A finished study."""

    name: str
    study: Study
    measured: Measured
    rows: list[Row]


def choose(names: Iterable[str]) -> list[str]:
    """The named studies, or all.

    Raises:
        RftsimError: No such study.
    """
    names = list(dict.fromkeys(names))
    for name in names:
        if name not in STUDIES:
            raise RftsimError(f"no study {name!r}; studies are {', '.join(STUDIES)}")
    return names or list(STUDIES)


def run(names: list[str], request: Request, memory: Path, report: Callable[[str], Any]) -> Iterator[Found]:
    """Run studies, taking from the memory what was measured before; `report` is called with the name of each job."""
    for name in names:
        study = STUDIES[name]
        kept = Kept(memory / f"{name}.json", _inputs(study))
        results = {}
        for job, measure in study.jobs(request).items():
            results[job] = kept.get(job, measure)
            report(f"{name} {job}")
        yield Found(name, study, results, study.rows(results))


def _inputs(study: Study) -> bytes:
    """The source of everything that a study computes with."""
    ours = Path(rftsim.__file__).parent
    outside = {ours / name for name in ("cli", "bench", "validation")}
    files = [path for path in ours.rglob("*.py") if not outside & set(path.parents)]
    files += Path(rftsim_models.__file__).parent.rglob("*.py")
    files += [Path(str(study.module.__file__)), *(ours / "validation" / f"{name}.py" for name in SHARED)]
    return b"".join([*(path.read_bytes() for path in sorted(files)), str(mujoco.__version__).encode()])
