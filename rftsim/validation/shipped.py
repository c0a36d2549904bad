"""Computations that ship with `rftsim_mpm`, as jobs of a study: they are read, never computed."""

import hashlib
from collections.abc import Callable
from typing import Any

from rftsim_mpm.campaign import DATA, results

from rftsim.validation.study import Measured

Results = list[dict[str, Any]]
"""The results of a campaign, one for each of its cases."""


def shipped(name: str, read: Callable[[Results], Any]) -> dict[str, Callable[[], Any]]:
    """Make the job that reads a campaign, its name holding the hash of the content; none where nothing is shipped.

    Args:
        name: The campaign's name, a folder of `rftsim_mpm.campaign.DATA`.
        read: Turns its results into what the study keeps.
    """
    folder = DATA / name
    texts = [path.read_bytes() for path in sorted((folder / "results").glob("*.json"))]
    if not texts:
        return {}
    return {f"{name}/{hashlib.sha256(b''.join(texts)).hexdigest()[:12]}": lambda: read(results(folder))}


def outcome(measured: Measured, name: str) -> Any:
    """The measurement of the job that read a campaign; None where there was no such job."""
    return next((value for job, value in measured.items() if job.partition("/")[0] == name), None)
