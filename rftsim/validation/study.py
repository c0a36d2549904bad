"""What a study is: measurements by name, and the rows and the figure that they amount to."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

Measured = Mapping[str, Any]
"""What was measured, by the names of the jobs."""


@dataclasses.dataclass(frozen=True)
class Row:
    """A line of a study's table.

    Attributes:
        what: The quantity.
        got: Its value; None where it could not be had.
        source: Where the expected value is from.
        unit: Of the values.
        expected: What it should be; None where only a bound, or nothing, is known.
        low: Smallest value that passes.
        high: Largest value that passes.
        note: What a reader should know, above all why it fails.
    """

    what: str
    got: float | None
    source: str
    unit: str = "-"
    expected: float | None = None
    low: float = -math.inf
    high: float = math.inf
    note: str = ""

    @property
    def passed(self) -> bool | None:
        """Whether it passes; None where there is nothing to pass."""
        if self.got is None or (math.isinf(self.low) and math.isinf(self.high)):
            return None
        return bool(self.low <= self.got <= self.high)

    @property
    def error(self) -> float | None:
        """Relative error; None where no value is expected."""
        if self.got is None or not self.expected:
            return None
        return self.got / self.expected - 1.0


def near(what: str, got: float, expected: float, within: float, source: str, **more: Any) -> Row:
    """A row that passes within an absolute distance of what is expected."""
    return Row(what, got, source, expected=expected, low=expected - within, high=expected + within, **more)


def at_most(what: str, got: float, limit: float, source: str, **more: Any) -> Row:
    """A row with an upper limit."""
    return Row(what, got, source, high=limit, **more)


def at_least(what: str, got: float, limit: float, source: str, **more: Any) -> Row:
    """A row with a lower limit."""
    return Row(what, got, source, low=limit, **more)


class Request(NamedTuple):
    """What a study is asked for."""

    quick: bool
    """Fewer measurements."""
    data: Path
    """Folder of measured data."""


@dataclasses.dataclass(frozen=True)
class Study:
    """A study.

    Attributes:
        says: What it compares with what.
        module: Its own source, for the cache.
        jobs: Its measurements by name, each a function to what JSON can hold; a name holds everything that the
            measurement depends on besides the source.
        rows: Its table, from what was measured.
        draw: Its figure, on a matplotlib Figure.
        size: Of the figure [inch].
    """

    says: str
    module: ModuleType
    jobs: Callable[[Request], dict[str, Callable[[], Any]]]
    rows: Callable[[Measured], list[Row]]
    draw: Callable[[Measured, Any], None]
    size: tuple[float, float] = (11.0, 4.8)
