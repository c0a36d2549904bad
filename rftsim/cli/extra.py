"""What is installed only on request."""

import contextlib
from collections.abc import Iterator
from typing import Final

from rftsim.errors import RftsimError

OURS: Final = ("rftsim", "rftsim_envs", "rftsim_models", "rftsim_mpm")


@contextlib.contextmanager
def needing(extra: str) -> Iterator[None]:
    """Imports that need an extra of rftsim.

    Raises:
        RftsimError: It is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in OURS:
            raise
        raise RftsimError(f"this needs {error.name}: pip install 'rftsim[{extra}]'") from error
