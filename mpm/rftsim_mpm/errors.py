"""The exception that rftsim_mpm raises, and the checks of settings that raise it."""

import math


class MpmError(Exception):
    """An input that cannot be: what was wrong, and what would have been right.

    Not a ValueError, which the command line would wrap in words of its own.
    """


def check_positive(settings: object, *names: str) -> None:
    """Refuse settings of these names that are not positive and finite; None, for a default, passes."""
    for name in names:
        value = getattr(settings, name)
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise MpmError(f"{name} must be positive and finite, not {value:g}")


def check_not_negative(settings: object, *names: str) -> None:
    """Refuse settings of these names that are negative or not finite."""
    for name in names:
        value = getattr(settings, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise MpmError(f"{name} must be zero or positive, not {value:g}")
