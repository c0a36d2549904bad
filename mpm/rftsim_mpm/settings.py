"""Settings of a study as results keep them, which must not change where a study learns something new."""

import dataclasses
from typing import Any

_LATER = "later"


def later(default: Any) -> Any:
    """Make a field of a study that results from before it do not have: at its default they hold as they were."""
    return dataclasses.field(default=default, metadata={_LATER: True})


def settings_of(study: Any) -> dict[str, Any]:
    """Return a study's settings by name, without fields made by `later` that have their default."""
    left_out = {
        f.name for f in dataclasses.fields(study) if f.metadata.get(_LATER) and getattr(study, f.name) == f.default
    }
    return {name: value for name, value in dataclasses.asdict(study).items() if name not in left_out}
