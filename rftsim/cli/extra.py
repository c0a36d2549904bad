"""Needs that are installed only on request: the extras of rftsim."""

import contextlib
from collections.abc import Iterator
from typing import Final

from rftsim.errors import RftsimError

OURS: Final = ("rftsim", "rftsim_envs", "rftsim_models", "rftsim_mpm")
"""Packages that no extra brings, so that one that is missing is a mistake of ours."""


@contextlib.contextmanager
def needing(extra: str) -> Iterator[None]:
    """Import within this block what needs an extra of rftsim.

    Raises:
        RftsimError: The extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in OURS:
            raise
        raise RftsimError(f"this needs {error.name}: pip install 'rftsim[{extra}]'") from error
