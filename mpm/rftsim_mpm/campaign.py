"""A grid of plates, pushes, wheels, slopes or ruts as independent jobs: one result file each, whole or not at all.

A campaign is a folder: `manifest.json` says what belongs to it, `results/KEY.json` holds one job's result with its
own checksum, KEY being made from the job. What is there and whole is never computed again, so a campaign that was
stopped in any way, SIGKILL included, goes on where it was.
"""

import dataclasses
import fcntl
import hashlib
import itertools
import json
import math
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rftsim_mpm import blade, footprint, plate, push, rut, slope, testbed, wheel
from rftsim_mpm.blade import Blade
from rftsim_mpm.errors import MpmError
from rftsim_mpm.footprint import Footprint
from rftsim_mpm.output import replacing
from rftsim_mpm.plate import Plate
from rftsim_mpm.push import Push
from rftsim_mpm.rut import Rut
from rftsim_mpm.settings import settings_of
from rftsim_mpm.simulation import Watch
from rftsim_mpm.slope import Slope
from rftsim_mpm.testbed import HeldWheel
from rftsim_mpm.wheel import Wheel

Job = Plate | Push | Wheel | Slope | Footprint | Blade | Rut | HeldWheel
KINDS: dict[str, type[Job]] = {
    "plates": Plate,
    "pushes": Push,
    "wheels": Wheel,
    "slopes": Slope,
    "footprints": Footprint,
    "blades": Blade,
    "ruts": Rut,
    "held": HeldWheel,
}
"""The kinds of jobs by their names in files."""
MEASURES: dict[type[Job], Callable[[Any, Watch | None], Any]] = {
    Plate: plate.measure,
    Push: push.measure,
    Wheel: wheel.roll,
    Slope: slope.measure,
    Footprint: footprint.press,
    Blade: blade.plow,
    Rut: rut.follow_rut,
    HeldWheel: testbed.hold,
}
"""What measures each kind of job; its outcome has a `report` and a `series`."""

MOST_JOBS = 100_000
"""Most jobs of one file."""
DATA = Path(__file__).parent / "data"
"""Campaigns that are shipped: `plates`, `flat`, `solids`, `deep`, `rates`, `speeds`, `wheels`, `slopes`, `ruts`,
`held`, `loaded` and `drum`."""


class Status(NamedTuple):
    """Keys of a campaign's jobs, by what is on the disk of their results."""

    finished: list[str]
    """Keys of the jobs whose result is there and whole."""
    missing: list[str]
    """Keys of the jobs that have no result yet."""
    damaged: list[str]
    """Keys of the jobs whose result is not as it was written."""


def read_jobs(path: Path) -> list[Job]:
    """Return the jobs of a TOML file: each list in a table of one of KINDS, as `[[plates]]`, is an axis of a grid.

    Settings under `[defaults]` hold for all.

    Raises:
        MpmError: The file is missing, is no TOML, names what a job does not have, or a job cannot be.
    """
    try:
        text = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise MpmError(f"cannot read {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MpmError(f"{path} is not TOML: {error}") from error
    except (RecursionError, ValueError) as error:  # brackets within brackets, and numbers of thousands of digits
        raise MpmError(f"{path} is nested too deeply, or has a number too long to be read") from error
    defaults = text.pop("defaults", {})
    grids = [(name, grid) for name in KINDS if isinstance(text.get(name), list) for grid in text[name]]
    tables = isinstance(defaults, dict) and all(isinstance(grid, dict) for _, grid in grids)
    if not tables or not grids or set(text) - set(KINDS):
        raise MpmError(
            f"{path} must have one or more [[{']] or [['.join(KINDS)}]], and may have [defaults], and nothing else"
        )
    found: dict[str, Job] = {}
    for name, grid in grids:
        known = {field.name for field in dataclasses.fields(KINDS[name])}
        if unknown := (set(grid) | set(defaults)) - known:
            raise MpmError(
                f"{path}: one of [[{name}]] has no {', '.join(sorted(unknown))}; it has {', '.join(sorted(known))}"
            )
        axes = {name: value if isinstance(value, list) else [value] for name, value in (defaults | grid).items()}
        if len(found) + math.prod(map(len, axes.values())) > MOST_JOBS:
            raise MpmError(f"{path} asks for more than {MOST_JOBS} jobs")
        for values in itertools.product(*axes.values()):
            job = _job(KINDS[name], dict(zip(axes, values, strict=True)), str(path))
            found[key(job)] = job
    return list(found.values())


def _job(kind: type[Job], values: dict[str, Any], where: str) -> Job:
    types = {field.name: field.type for field in dataclasses.fields(kind)}
    for name, value in values.items():
        wanted: Any = types[name] if types[name] in (int, bool, str) else float
        numbers = isinstance(value, int if wanted is int else (int, float)) and isinstance(value, bool) == (
            wanted is bool
        )
        if not (isinstance(value, str) if wanted is str else numbers):
            raise MpmError(f"{where}: {name} cannot be {value!r}")
        if wanted is not str and abs(value) > sys.float_info.max:
            raise MpmError(f"{where}: {name} is too large for a number")
        values[name] = float(value) if wanted is float else value
    try:
        return kind(**values)
    except MpmError as error:
        raise MpmError(f"{where}: {error}") from error


def key(job: Job) -> str:
    """Return the name of a job's result: the beginning of the hash of everything that defines it."""
    return hashlib.sha256(_canonical(settings_of(job)).encode()).hexdigest()[:16]


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def begin(folder: Path, jobs: list[Job]) -> None:
    """Make a campaign's folder, or add jobs to one that is there."""
    try:
        (folder / "results").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MpmError(f"cannot make the folder {folder}: {error.strerror}") from error
    known = {key(job): job for job in (manifest(folder) if (folder / "manifest.json").exists() else [])}
    known |= {key(job): job for job in jobs}
    text = {
        name: {own: settings_of(job) for own, job in known.items() if type(job) is kind} for name, kind in KINDS.items()
    }
    with replacing(folder / "manifest.json") as temporary:
        temporary.write_text(json.dumps({name: jobs for name, jobs in text.items() if jobs}, indent=1) + "\n")


def manifest(folder: Path) -> list[Job]:
    """Return the jobs that belong to a campaign, as its `manifest.json` has them."""
    path = folder / "manifest.json"
    try:
        text = json.loads(path.read_text())
        jobs = [
            _job(KINDS[name], {field: value for field, value in values.items() if value is not None}, str(path))
            for name in text
            for values in text[name].values()
        ]
    except OSError as error:
        raise MpmError(f"{folder} is no campaign: cannot read {path.name} ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise MpmError(f"{path} is damaged: {error}; run the campaign's TOML file again") from error
    except RecursionError as error:
        raise MpmError(f"{path} is damaged: it is nested too deeply; run the campaign's TOML file again") from error
    if not jobs:
        raise MpmError(f"{path} has no jobs: run the campaign's TOML file again")
    return jobs


def status(folder: Path) -> Status:
    """Return which jobs of a campaign have a result on the disk, and which of these are damaged."""
    found = Status([], [], [])
    for job in manifest(folder):
        name = key(job)
        path = folder / "results" / f"{name}.json"
        (found.missing if not path.exists() else found.finished if is_intact(path, job) else found.damaged).append(name)
    return found


def is_intact(path: Path, job: Job) -> bool:
    """Whether a result is what was once written, and is of this job."""
    try:
        text = json.loads(path.read_text())
        checksum = text.pop("sha256")
        return bool(checksum == _checksum(text) and text[_name(job)] == settings_of(job))
    except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError):
        return False


def _name(job: Job) -> str:
    return type(job).__name__.lower()


def results(folder: Path) -> list[dict[str, Any]]:
    """Return every finished result: its job, by its kind, and what the command of that name reports of it."""
    names = set(status(folder).finished)
    return [json.loads((folder / "results" / f"{name}.json").read_text()) for name in sorted(names)]


def _checksum(value: Any) -> str:
    return hashlib.sha256(_canonical(value).encode()).hexdigest()


def compute(job: Job, beat: Callable[[], None] | None = None) -> dict[str, Any]:
    """Compute the result of one job; `beat` is called at every step."""
    watch = None if beat is None else lambda sim, share: beat()
    found = MEASURES[type(job)](job, watch)
    result = {_name(job): settings_of(job), **found.report, **found.series}
    return {**result, "sha256": _checksum(result)}


def write(folder: Path, name: str, result: dict[str, Any]) -> None:
    """Put a result in its place in the campaign's folder, whole or not at all."""
    with replacing(folder / "results" / f"{name}.json") as temporary:
        temporary.write_text(json.dumps(result, indent=None) + "\n")


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Refuse to run a campaign that is running; a process that dies lets go."""
    with (folder / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise MpmError(f"the campaign in {folder} is running already") from error
        yield


def run(folder: Path, processes: int, done: Callable[[str], None]) -> list[str]:
    """Compute what is not there, or is damaged, each job in a process of its own with one thread.

    Args:
        folder: The campaign.
        processes: How many run at a time.
        done: Called with each key as its result appears.

    Returns:
        One line for each job that failed.
    """
    now = status(folder)
    waiting, failed = [*now.damaged, *now.missing], []
    running: dict[str, subprocess.Popen[str]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < processes:
                name = waiting.pop(0)
                running[name] = _worker(folder, name)
            time.sleep(0.1)
            for name in [name for name, process in running.items() if process.poll() is not None]:
                process = running.pop(name)
                _, said = process.communicate()
                if process.returncode:
                    failed.append(f"{name}: {said.strip().splitlines()[-1] if said.strip() else process.returncode}")
                else:
                    done(name)
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            process.wait()
    return failed


def _worker(folder: Path, name: str) -> "subprocess.Popen[str]":
    """Start the process of one job, with one thread."""
    command = [sys.executable, "-m", "rftsim_mpm.worker", str(folder), name, str(os.getpid())]
    environment = os.environ | {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)


def run_on_ray(folder: Path, address: str | None, done: Callable[[str], None]) -> list[str]:
    """Compute as `run` does, on the cores of a Ray cluster; `address` None starts one here."""
    try:
        import ray
    except ImportError as error:
        raise MpmError("--ray needs Ray: pip install ray") from error
    try:
        ray.init(address=address, include_dashboard=False, log_to_driver=False)
    except Exception as error:  # Ray raises no class of its own where a cluster is not there or does not start
        raise MpmError(f"Ray at {address or 'this machine'} does not answer: {error}") from error
    try:
        now = status(folder)
        wanted = {*now.damaged, *now.missing}
        remote = ray.remote(num_cpus=1, max_retries=2)(compute)
        running = {remote.remote(job): key(job) for job in manifest(folder) if key(job) in wanted}
        failed = []
        while running:
            (done_now,), _ = ray.wait(list(running), num_returns=1)
            name = running.pop(done_now)
            try:
                write(folder, name, ray.get(done_now))
            except ray.exceptions.RayError as error:
                failed.append(f"{name}: {str(error).strip().splitlines()[-1]}")
            else:
                done(name)
        return failed
    finally:
        ray.shutdown()
