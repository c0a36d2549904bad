"""Measurements of a study that are remembered in a file, so that the study can be stopped and taken up again."""

from pathlib import Path
from types import ModuleType

import mujoco

from rftsim.files import Kept
from rftsim.machine.sources import source_of


def remember(path: Path, *modules: ModuleType) -> Kept:
    """Open the measurements in a file; they are forgotten where they were made otherwise.

    Args:
        path: The file, JSON.
        *modules: The modules that a study measures with, besides what is compiled, and MuJoCo.
    """
    own = b"".join(Path(str(module.__file__)).read_bytes() for module in modules)
    return Kept(path, source_of("engine") + own + mujoco.__version__.encode())
