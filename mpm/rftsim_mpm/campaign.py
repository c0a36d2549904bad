"""A grid of plates as independent jobs: one result file each, written whole or not at all.

A campaign is a folder: `manifest.json` says what belongs to it, `results/KEY.json` holds one plate's result with its
own checksum, KEY being made from the plate. What is there and whole is never computed again, so a campaign that was
stopped in any way, SIGKILL included, goes on where it was.
"""

import dataclasses
import fcntl
import hashlib
import itertools
import json
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rftsim_mpm.errors import MpmError
from rftsim_mpm.output import replacing
from rftsim_mpm.plate import Plate, PlateForce, measure

POINTS = 100
"""Points of the force's history that a result keeps."""


class Status(NamedTuple):
    """Keys of a campaign's plates, by what is on the disk."""

    finished: list[str]
    missing: list[str]
    damaged: list[str]


def read_plates(path: Path) -> list[Plate]:
    """The plates of a TOML file: under `[[plates]]`, each list is an axis of a grid; `[defaults]` holds for all.

    Raises:
        MpmError: The file is missing, is no TOML, names what a plate does not have, or a plate cannot be.
    """
    try:
        text = tomllib.loads(path.read_text())
    except OSError as error:
        raise MpmError(f"cannot read {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MpmError(f"{path} is not TOML: {error}") from error
    known = {field.name for field in dataclasses.fields(Plate)}
    defaults, grids = text.get("defaults", {}), text.get("plates", [])
    if not isinstance(defaults, dict) or not isinstance(grids, list) or not grids or set(text) - {"defaults", "plates"}:
        raise MpmError(f"{path} must have one or more [[plates]], and may have [defaults], and nothing else")
    found: dict[str, Plate] = {}
    for grid in grids:
        if unknown := (set(grid) | set(defaults)) - known:
            raise MpmError(f"{path}: a plate has no {', '.join(sorted(unknown))}; it has {', '.join(sorted(known))}")
        axes = {name: value if isinstance(value, list) else [value] for name, value in (defaults | grid).items()}
        for values in itertools.product(*axes.values()):
            plate = _plate(dict(zip(axes, values, strict=True)), str(path))
            found[key(plate)] = plate
    return list(found.values())


def _plate(values: dict[str, Any], where: str) -> Plate:
    types = {field.name: field.type for field in dataclasses.fields(Plate)}
    for name, value in values.items():
        kind = types[name] if types[name] in (int, bool) else float
        if isinstance(value, bool) != (kind is bool) or not isinstance(value, int if kind is int else (int, float)):
            raise MpmError(f"{where}: {name} cannot be {value!r}")
        values[name] = float(value) if kind is float else value
    try:
        return Plate(**values)
    except MpmError as error:
        raise MpmError(f"{where}: {error}") from error


def key(plate: Plate) -> str:
    """Name of a plate's result: the beginning of the hash of everything that defines it."""
    return hashlib.sha256(_canonical(dataclasses.asdict(plate)).encode()).hexdigest()[:16]


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def begin(folder: Path, plates: list[Plate]) -> None:
    """Make a campaign's folder, or add plates to one."""
    try:
        (folder / "results").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MpmError(f"cannot make the folder {folder}: {error.strerror}") from error
    known = {key(plate): plate for plate in (manifest(folder) if (folder / "manifest.json").exists() else [])}
    known |= {key(plate): plate for plate in plates}
    text = {"plates": {name: dataclasses.asdict(plate) for name, plate in known.items()}}
    with replacing(folder / "manifest.json") as temporary:
        temporary.write_text(json.dumps(text, indent=1) + "\n")


def manifest(folder: Path) -> list[Plate]:
    """The plates that belong to a campaign."""
    path = folder / "manifest.json"
    try:
        plates = [_plate(values, str(path)) for values in _dropped(json.loads(path.read_text())["plates"])]
    except OSError as error:
        raise MpmError(f"{folder} is no campaign: cannot read {path.name} ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise MpmError(f"{path} is damaged: {error}; run the campaign's TOML file again") from error
    return plates


def _dropped(plates: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """The plates' settings without those that are not given, so that they are what a TOML file can say."""
    return [{name: value for name, value in plate.items() if value is not None} for plate in plates.values()]


def status(folder: Path) -> Status:
    """What is on the disk."""
    found = Status([], [], [])
    for plate in manifest(folder):
        name = key(plate)
        path = folder / "results" / f"{name}.json"
        (found.missing if not path.exists() else found.finished if whole(path, plate) else found.damaged).append(name)
    return found


def whole(path: Path, plate: Plate) -> bool:
    """Whether a result is what was written, and of this plate."""
    try:
        text = json.loads(path.read_text())
        checksum = text.pop("sha256")
    except (OSError, ValueError, KeyError, AttributeError):
        return False
    return bool(checksum == _checksum(text) and text["plate"] == dataclasses.asdict(plate))


def results(folder: Path) -> list[dict[str, Any]]:
    """Every finished result: `plate`, and what `rftsim-mpm plate` reports of it."""
    names = set(status(folder).finished)
    return [json.loads((folder / "results" / f"{name}.json").read_text()) for name in sorted(names)]


def _checksum(value: Any) -> str:
    return hashlib.sha256(_canonical(value).encode()).hexdigest()


def compute(plate: Plate, beat: Callable[[], None] | None = None) -> dict[str, Any]:
    """One result; `beat` is called at every step."""
    return _result(plate, measure(plate, None if beat is None else lambda sim, share: beat()))


def _result(plate: Plate, found: PlateForce) -> dict[str, Any]:
    history = found.history
    some = np.linspace(0, len(history.travel) - 1, min(POINTS, len(history.travel))).astype(int)
    result = {
        "plate": dataclasses.asdict(plate),
        "young_Pa": plate.material.young,
        "force": found.force.tolist(),
        "alpha_N_m3": found.alpha.tolist(),
        "alpha_face_N_m3": (found.face / (plate.area * plate.z)).tolist(),
        "depth_m": found.depth,
        "noise": found.noise,
        "heave_m": found.heave,
        "travel_m": [float(f"{x:.6g}") for x in history.travel[some]],
        "history": [[float(f"{x:.5g}") for x in row] for row in history.force[some]],
        "particles": found.particles,
        "steps": found.steps,
        "seconds": round(found.seconds, 1),
    }
    return {**result, "sha256": _checksum(result)}


def write(folder: Path, name: str, result: dict[str, Any]) -> None:
    """Put a result in its place, whole."""
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
    """Compute what is not there, or is damaged, each plate in a process of its own with one thread.

    Args:
        folder: The campaign.
        processes: At a time.
        done: Called with each key as its result appears.

    Returns:
        What failed, one line for each plate.
    """
    now = status(folder)
    waiting, failed = [*now.damaged, *now.missing], []
    running: dict[str, subprocess.Popen[str]] = {}
    environment = os.environ | {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        while waiting or running:
            while waiting and len(running) < processes:
                name = waiting.pop(0)
                command = [sys.executable, "-m", "rftsim_mpm.worker", str(folder), name, str(os.getpid())]
                running[name] = subprocess.Popen(
                    command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
                )
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


def run_on_ray(folder: Path, address: str | None, done: Callable[[str], None]) -> list[str]:
    """As `run`, on the cores of a Ray cluster; `address` None starts one here."""
    try:
        import ray
    except ImportError as error:
        raise MpmError("--ray needs Ray: pip install ray") from error
    ray.init(address=address, include_dashboard=False, log_to_driver=False)
    try:
        now = status(folder)
        wanted = {*now.damaged, *now.missing}
        remote = ray.remote(num_cpus=1, max_retries=2)(compute)
        jobs = {remote.remote(plate): key(plate) for plate in manifest(folder) if key(plate) in wanted}
        failed = []
        while jobs:
            (job,), _ = ray.wait(list(jobs), num_returns=1)
            name = jobs.pop(job)
            try:
                write(folder, name, ray.get(job))
            except ray.exceptions.RayError as error:
                failed.append(f"{name}: {str(error).strip().splitlines()[-1]}")
            else:
                done(name)
        return failed
    finally:
        ray.shutdown()
