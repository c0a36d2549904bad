"""How exactly the implicit force is solved for: bounds of what the user may ask for."""

import numbers
from typing import Any

from rftsim.engine.seal import COUNTS, TOLERANCES
from rftsim.errors import SceneError


def check_solution(tolerance: Any, iterations: Any, error: type[Exception] = SceneError) -> None:
    """Refuse a tolerance of the implicit force, or a cap on its iterations, that cannot be.

    Args:
        tolerance: Error of a body's velocity, relative, to which each solution iterates.
        iterations: Most iterations of one solution.
        error: The kind of error.

    Raises:
        error: One is not such a number, or lies out of bounds.
    """
    (low, high), (fewest, most) = TOLERANCES, COUNTS
    if not (_is_number(tolerance, numbers.Real) and low <= tolerance <= high):
        raise error(f"tolerance is that of the implicit force, {low:.0e} to {high:g}, not {tolerance!r}")
    if not (_is_number(iterations, numbers.Integral) and fewest <= iterations <= most):
        raise error(f"iterations must be a whole number from {fewest} to {most}, not {iterations!r}")


def _is_number(value: Any, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)
