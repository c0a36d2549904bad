"""What `rftsim_mpm` ships of its own computations, as jobs of a study: read, never computed."""

import hashlib
from collections.abc import Callable
from typing import Any

from rftsim_mpm.campaign import DATA, results

from rftsim.validation.study import Measured

Results = list[dict[str, Any]]


def shipped(name: str, read: Callable[[Results], Any]) -> dict[str, Callable[[], Any]]:
    """The job that reads a campaign, its name holding the hash of the content; none where nothing is shipped.

    Args:
        name: Of the campaign, a folder of `rftsim_mpm.campaign.DATA`.
        read: From its results to what the study keeps.
    """
    folder = DATA / name
    texts = [path.read_bytes() for path in sorted((folder / "results").glob("*.json"))]
    if not texts:
        return {}
    return {f"{name}/{hashlib.sha256(b''.join(texts)).hexdigest()[:12]}": lambda: read(results(folder))}


def found(measured: Measured, name: str) -> Any:
    """What such a job gave; None where there was none."""
    return next((value for job, value in measured.items() if job.partition("/")[0] == name), None)
