"""Studies: measurements by name, and the rows and the figure that they amount to."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from rftsim.view.figure import make_figure, save_figure

Measured = Mapping[str, Any]
"""The measurements of a study, by the names of its jobs."""


@dataclasses.dataclass(frozen=True)
class Row:
    """A line of a study's table.

    Attributes:
        what: The quantity that is compared.
        got: Its value; None where it could not be had.
        source: Where the expected value is from.
        unit: Unit of the values.
        expected: The value that it should have; None where only a bound, or nothing, is known.
        low: Smallest value that passes.
        high: Largest value that passes.
        note: A remark for the reader, above all why it fails.
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
        """Whether the value lies within its bounds; None where it has none, or is not there."""
        if self.got is None or (math.isinf(self.low) and math.isinf(self.high)):
            return None
        return bool(self.low <= self.got <= self.high)

    @property
    def error(self) -> float | None:
        """Relative error of the value; None where no value is expected."""
        if self.got is None or not self.expected:
            return None
        return self.got / self.expected - 1.0


def near(what: str, got: float, expected: float, within: float, source: str, **more: Any) -> Row:
    """Make a row that passes within an absolute distance of what is expected."""
    return Row(what, got, source, expected=expected, low=expected - within, high=expected + within, **more)


def at_most(what: str, got: float, limit: float, source: str, **more: Any) -> Row:
    """Make a row that passes where the value is at most a limit."""
    return Row(what, got, source, high=limit, **more)


def at_least(what: str, got: float, limit: float, source: str, **more: Any) -> Row:
    """Make a row that passes where the value is at least a limit."""
    return Row(what, got, source, low=limit, **more)


class Request(NamedTuple):
    """The wishes that a study's measurements follow."""

    quick: bool
    """Whether fewer measurements will do."""
    data: Path
    """Folder of measured data, which need not be there."""


@dataclasses.dataclass(frozen=True)
class Study:
    """A comparison of the laws with something: its measurements, its table and its figure.

    Attributes:
        says: A line that says what it compares.
        module: The module that it measures with, whose source is part of the measurements' identity.
        jobs: Its measurements by name, each a function to what JSON can hold; a name holds everything that the
            measurement depends on besides the sources.
        rows: Its table, from what was measured.
        draw: Its figure, on a matplotlib Figure.
        size: Width and height of the figure [inch].
    """

    says: str
    module: ModuleType
    jobs: Callable[[Request], dict[str, Callable[[], Any]]]
    rows: Callable[[Measured], list[Row]]
    draw: Callable[[Measured, Any], None]
    size: tuple[float, float] = (11.0, 4.8)


def plot_study(study: Study, measured: Measured, path: Path) -> None:
    """Draw the figure of a study, from what it measured, into a file."""
    figure = make_figure(study.size)
    study.draw(measured, figure)
    save_figure(figure, path)
