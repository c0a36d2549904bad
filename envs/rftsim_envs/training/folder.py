"""The folder of a training run: what was asked, how far it is, and what came out; whole at every moment.

config.json      what was asked, resolved; `done` says whether it is finished
progress.csv     a row per update
checkpoint.zip   where to go on from
policy.zip       the trained policy, when it is finished
tensorboard/     if it was asked for
"""

import contextlib
import csv
import dataclasses
import fcntl
import hashlib
import importlib.metadata
import json
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from rftsim.errors import RftsimWarning
from rftsim.files import replacing
from rftsim.sand.presets import make_sand
from rftsim_envs import tasks
from rftsim_envs.recipe import Training, TrainingError

ALGORITHMS: Final = ("ppo",)
DIGITS: Final = 12
"""Number of digits of a file's digest."""
PACKAGES: Final = ("rftsim", "mujoco", "stable-baselines3", "torch", "numpy")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """A training run as it is asked for, every default resolved.

    Attributes:
        task: The task's reference, see `rftsim_envs.tasks.reference`.
        settings: Every field of the task's Config.
        training: Settings of PPO.
        seed: Seed of everything that is drawn.
        algo: One of `ALGORITHMS`.
    """

    task: str
    settings: dict[str, Any]
    training: Training
    seed: int = 0
    algo: str = "ppo"

    @property
    def env(self) -> str:
        """The id of its environment, or the reference of a task of one's own."""
        return self.task if ":" in self.task else f"rftsim/{self.task}-v0"

    def as_json(self) -> dict[str, Any]:
        """The plan as config.json has it."""
        plain: dict[str, Any] = json.loads(
            json.dumps(
                {
                    "env": self.env,
                    "settings": self.settings,
                    "sand": dataclasses.asdict(make_sand(self.settings["sand"])),
                    "algo": self.algo,
                    "training": dataclasses.asdict(self.training),
                    "seed": self.seed,
                }
            )
        )
        return plain


def make_plan(
    env: str,
    settings: Mapping[str, Any] | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    algo: str = "ppo",
) -> Plan:
    """Make a plan from what differs from the defaults.

    Args:
        env: `rftsim/NAME-v0`, NAME, FILE.py:CLASS or MODULE:CLASS, see `rftsim_envs.tasks.find`.
        settings: Settings of the task that differ from its own.
        changes: Settings of the training that differ from the task's.
        seed: Seed of everything that is drawn.
        algo: One of `ALGORITHMS`.

    Raises:
        ConfigError: No such task or setting.
        TrainingError: No such algorithm or setting of it.
    """
    if algo not in ALGORITHMS:
        raise TrainingError(f"no algorithm {algo!r}; algorithms are {', '.join(ALGORITHMS)}")
    if seed < 0:
        raise TrainingError(f"seed must be zero or more, not {seed}")
    name = tasks.reference(env)
    task = tasks.make(name, dict(settings or {}))
    training = task.training.replace(changes or {})
    return Plan(task=name, settings=dataclasses.asdict(task.config), training=training, seed=seed, algo=algo)


def of_seed(seed: int) -> str:
    """Name of the folder of one of several runs, that with this seed."""
    return f"seed-{seed}"


class Folder:
    """The folder of a training run, and the paths in it.

    Args:
        path: Path of the folder; nothing is made yet.
    """

    def __init__(self, path: "str | Path") -> None:
        self.path = Path(path)
        self.config, self.progress = self.path / "config.json", self.path / "progress.csv"
        self.checkpoint, self.policy = self.path / "checkpoint.zip", self.path / "policy.zip"
        self.tensorboard = self.path / "tensorboard"

    @property
    def exists(self) -> bool:
        """Whether a run was begun here."""
        return self.config.is_file()

    @property
    def done(self) -> bool:
        """Whether a run was begun here and is finished."""
        return self.exists and bool(self._read()["done"])

    def plan(self) -> Plan:
        """Read the plan of the run from config.json.

        Raises:
            TrainingError: No run was begun here, or its config.json cannot be read.
        """
        kept = self._read()
        try:
            settings, training = dict(kept["settings"]), Training(**kept["training"])
            return Plan(
                task=tasks.reference(kept["env"]),
                settings=settings,
                training=training,
                seed=kept["seed"],
                algo=kept["algo"],
            )
        except (KeyError, TypeError) as error:
            raise TrainingError(f"{self.config} is not that of a training run: {error}") from error

    def _read(self) -> dict[str, Any]:
        if not self.exists:
            raise TrainingError(f"{self.path} holds no training run: it has no {self.config.name}")
        try:
            kept = json.loads(self.config.read_text())
        except (OSError, ValueError) as error:
            raise TrainingError(f"cannot read {self.config}: {error}") from error
        if not isinstance(kept, dict) or not {"env", "settings", "training", "seed", "algo", "done"} <= set(kept):
            raise TrainingError(f"{self.config} is not that of a training run")
        return kept

    @contextlib.contextmanager
    def opened(self, plan: Plan) -> Iterator[None]:
        """Keep the folder for this plan, and for nobody else, until the block ends.

        Raises:
            TrainingError: It belongs to another plan or to another process, or it cannot be written.
        """
        with contextlib.ExitStack() as stack:
            try:
                self.path.mkdir(parents=True, exist_ok=True)
                lock = stack.enter_context((self.path / ".lock").open("a"))
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                lock.truncate(0)
                lock.write(str(os.getpid()))
                lock.flush()
            except BlockingIOError:
                raise TrainingError(f"another process trains in {self.path}") from None
            except OSError as error:
                raise TrainingError(f"cannot write to {self.path}: {error.strerror}") from error
            self.check(plan)
            if not self.exists:
                self.write_config(plan, done=False)
            yield

    def check(self, plan: Plan) -> None:
        """Refuse a folder in which another run was begun; versions that changed since are warned about.

        Raises:
            TrainingError: Another run was begun here, or its config.json cannot be read.
        """
        asked = plan.as_json()
        if not self.exists:
            return
        kept = self._read()
        differing = [
            f"{name} is {there} there and {here} here"
            for name, there, here in _differences({key: kept.get(key) for key in asked}, asked)
        ]
        if differing:
            raise TrainingError(f"{self.path} holds another run: {'; '.join(differing)}. Take another folder.")
        now = versions(plan)
        if not kept["done"] and kept.get("versions") != now:
            changes = [f"{name} {there} to {here}" for name, there, here in _differences(kept["versions"], now)]
            warnings.warn(f"versions changed since {self.path} was begun: {', '.join(changes)}", RftsimWarning, 2)

    def write_config(self, plan: Plan, *, done: bool) -> None:
        """Write config.json, which says whether the run is finished."""
        text = json.dumps(plan.as_json() | {"versions": versions(plan), "done": done}, indent=2)
        write_whole(self.config, f"{text}\n".encode())


def versions(plan: Plan) -> dict[str, str]:
    """Versions of the packages, and digests of the user's own files, on which a run's numbers depend, by name.

    Those files are that of the task, and those that settings name: a robot's model, or a sand.
    """
    named = [plan.task.rpartition(":")[0], *(value for value in plan.settings.values() if isinstance(value, str))]
    files = {Path(name).name: Path(name) for name in named if name and Path(name).is_file()}
    digests = {name: hashlib.sha256(path.read_bytes()).hexdigest()[:DIGITS] for name, path in files.items()}
    return {name: importlib.metadata.version(name) for name in PACKAGES} | digests


def _differences(there: Any, here: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(there, dict) and isinstance(here, dict):
        for key in {**there, **here}:
            yield from _differences(there.get(key), here.get(key), f"{name}.{key}" if name else key)
    elif there != here:
        yield name, there, here


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that at any moment either the old or the new one is there, whole.

    Raises:
        RftsimError: It cannot be written; what was there is left.
    """
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise TrainingError(f"cannot write {path}: {error.strerror}") from error


class Progress:
    """The file progress.csv, which has a row per update.

    Args:
        path: Path of the file.
        kept: Number of rows to keep of the file that is there; later ones came after the checkpoint.

    Attributes:
        rows: Rows of the file, texts by column.
    """

    def __init__(self, path: Path, kept: int) -> None:
        self._path = path
        self.rows = read_progress(path)[:kept] if path.is_file() else []
        if self.rows:
            write_whole(
                path, ("\n".join(map(_line, [self.rows[0], *(row.values() for row in self.rows)])) + "\n").encode()
            )

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row, and a head before the first one.

        Raises:
            TrainingError: It cannot be written.
        """
        lines = [_line(row.values())] if self.rows else [_line(row), _line(row.values())]
        if not self.rows:
            write_whole(self._path, b"")
        self.rows.append({name: str(value) for name, value in row.items()})
        try:
            with self._path.open("a") as file:
                file.write("".join(f"{line}\n" for line in lines))
        except OSError as error:
            raise TrainingError(f"cannot write {self._path}: {error.strerror}") from error


def _line(values: Any) -> str:
    return ",".join(str(value) for value in values)


def read_progress(path: Path) -> list[dict[str, str]]:
    """Read the rows of a progress.csv, texts by column."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
