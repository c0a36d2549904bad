"""All tasks by name, tasks of one's own, and how to make one."""

import hashlib
import importlib
import importlib.util
import inspect
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from rftsim_envs.c_leg_hexapod import CLegHexapod
from rftsim_envs.four_flap_runner import FourFlapRunner
from rftsim_envs.grouser_wheel import GrouserWheel
from rftsim_envs.hopper import Hopper
from rftsim_envs.locomotion import Locomotion
from rftsim_envs.quadruped import Quadruped
from rftsim_envs.rover import Rover
from rftsim_envs.task import ConfigError, Task, make_config

TASKS: Final[dict[str, type[Task]]] = {
    task.__name__: task for task in (GrouserWheel, FourFlapRunner, CLegHexapod, Rover, Hopper, Quadruped)
}
"""Tasks with a robot of ours, by name."""
NAMED: Final[dict[str, type[Task]]] = TASKS | {Locomotion.__name__: Locomotion}
"""Every task that has a name: those, and the one whose robot comes from a file."""
FORMS: Final = "FILE.py:CLASS or MODULE:CLASS"
"""How a task of one's own is named."""


def make(task: "str | type[Task]", settings: dict[str, Any]) -> Task:
    """A task, with these settings in place of its own.

    Args:
        task: As of `find`.
        settings: Fields of its Config.

    Raises:
        ConfigError: No such task or setting, a value that cannot be, or a class of one's own that is not whole.
    """
    kind = find(task)
    if inspect.isabstract(kind):
        raise ConfigError(f"{kind.__name__} is not whole: it needs {', '.join(sorted(kind.__abstractmethods__))}")
    made = kind(make_config(kind, settings))
    if not hasattr(made, "length"):
        raise ConfigError(f"{kind.__name__} has no `length`: state the robot's length along its heading [m]")
    return made


def find(task: "str | type[Task]") -> type[Task]:
    """Find the class of a task by what names it.

    Args:
        task: The class; or its name, NAME or rftsim/NAME-v0; or of one's own FILE.py:CLASS, FILE.py if that has one
            task alone, or MODULE:CLASS.

    Raises:
        ConfigError: There is none, or it is no `Task`.
    """
    if not isinstance(task, str):
        return _checked(task, "a task")
    name = task.removeprefix("rftsim/").removesuffix("-v0")
    if name in NAMED:
        return NAMED[name]
    place, separator, wanted = task.rpartition(":")
    if task.endswith(".py"):
        return _only(_module_of(Path(task)), task)
    if not separator:
        raise ConfigError(f"no task {task!r}; tasks are {', '.join(NAMED)}, and {FORMS}")
    module = _module_of(Path(place)) if place.endswith(".py") else _module_named(place)
    if not hasattr(module, wanted):
        raise ConfigError(f"{place} has no {wanted!r}; its tasks are {', '.join(_own(module)) or 'none'}")
    return _checked(getattr(module, wanted), task)


def reference(task: "str | type[Task]") -> str:
    """The text by which `find` gives a task in any folder and process: its name, or FILE.py:CLASS or MODULE:CLASS.

    Raises:
        ConfigError: There is no such task, or it is in no file.
    """
    kind = find(task)
    if NAMED.get(kind.__name__) is kind:
        return kind.__name__
    module = sys.modules[kind.__module__]
    if module.__spec__ is not None and not module.__name__.startswith(_PREFIX) and module.__name__ != "__main__":
        return f"{module.__name__}:{kind.__qualname__}"
    if getattr(module, "__file__", None) is None:
        raise ConfigError(f"{kind.__name__} is in no file: put it in one, and name it {FORMS}")
    return f"{Path(str(module.__file__)).resolve()}:{kind.__qualname__}"


def title(task: str) -> str:
    """The name of a task's class, from its reference."""
    return task.rpartition(":")[2]


_PREFIX: Final = "rftsim_task_"
"""Beginning of the names of the modules that files of one's own become."""


def _checked(found: Any, name: str) -> type[Task]:
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise ConfigError(f"{name} must be a subclass of rftsim_envs.Task, not {found!r}")
    return found


def _own(module: ModuleType) -> dict[str, type[Task]]:
    """The tasks that a module defines itself, by name."""
    kinds = {name: one for name, one in vars(module).items() if isinstance(one, type) and issubclass(one, Task)}
    return {name: one for name, one in kinds.items() if one.__module__ == module.__name__}


def _only(module: ModuleType, name: str) -> type[Task]:
    own = _own(module)
    if len(own) != 1:
        names = " or ".join(f"{name}:{one}" for one in own)
        raise ConfigError(f"{name} has {len(own)} tasks: name one of them, {names}" if own else f"{name} has no task")
    return next(iter(own.values()))


def _module_of(path: Path) -> ModuleType:
    """The module that a file is, whose neighbours it can import."""
    path = path.resolve()
    name = f"{_PREFIX}{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    if not path.is_file():
        raise ConfigError(f"no file {path}")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise ConfigError(f"cannot import {path}: {type(error).__name__}: {error}") from error
    return module


def _module_named(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except (ImportError, ValueError) as error:
        raise ConfigError(f"cannot import {name!r}: {error}; a task is {', '.join(NAMED)}, or {FORMS}") from error
