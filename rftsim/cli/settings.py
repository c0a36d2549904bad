"""Settings of a scene or a task on the command line, as words `key=value`."""

from typing import Annotated

import tyro

Settings = Annotated[
    tuple[tuple[str, ...], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="KEY=VALUE ..", help_behavior_hint=""),
]
"""Words of an option that takes several and may be repeated."""


def read_settings(groups: Settings) -> dict[str, str]:
    """Read settings from words `key=value`; of a key that comes twice, the last counts.

    Raises:
        ValueError: A word is not key=value.
    """
    found = {}
    for pair in (pair for group in groups for pair in group):
        key, separator, value = pair.partition("=")
        if not separator or not key:
            raise ValueError(f"--set takes key=value, not {pair!r}")
        found[key] = value
    return found
