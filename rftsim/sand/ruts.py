"""Sand that remembers: what a bed keeps of the marks that bodies leave in it."""

import dataclasses
import math
from typing import Final

BLOCK: Final = 8
"""Cells along the side of a block, whose mean the laws feel."""
SIDES: Final = (32, 1024)
"""Fewest and most cells along a side of the window; a power of two."""
FELT: Final = 2.0
"""Side of a block over the width of what presses: about how far beside it the sand's weight holds it."""


@dataclasses.dataclass(frozen=True)
class Ruts:
    """Marks in the sand: cells of a grid that fixed to the ground, in a window that goes with the bodies.

    Where a body passes, the sand is lowered to what it swept; what it displaced is piled up beside and ahead, and
    slides to the angle of repose. What leaves the window is forgotten.

    Raises:
        ValueError: A length that is none, or a window of fewer than 32 or more than 1024 cells along a side.
    """

    spacing: float
    """Side of a cell [m]; the laws feel the mean over 8 x 8 cells, which should be twice as wide as a foot."""
    window: tuple[float, float]
    """Lengths of the window along x and y [m]; rounded up to a power of two of cells."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.spacing) and self.spacing > 0.0):
            raise ValueError(f"the spacing of ruts must be positive, in metres, not {self.spacing}")
        if not all(math.isfinite(length) and length > 0.0 for length in self.window):
            raise ValueError(f"the window of ruts must be two positive lengths, in metres, not {self.window}")
        most = self.spacing * SIDES[1]
        if max(self.window) > most:
            raise ValueError(
                f"a window of {self.window[0]:g} m x {self.window[1]:g} m has more than {SIDES[1]} cells of "
                f"{self.spacing:g} m along a side: take one of {most:g} m at most, or a larger spacing"
            )

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of the window along x and y, powers of two."""
        x, y = (
            max(SIDES[0], 1 << (math.ceil(length / self.spacing - 1e-9) - 1).bit_length()) for length in self.window
        )
        return x, y


def ruts_for(width: float, extent: tuple[float, float]) -> Ruts:
    """The ruts of bodies of which the narrowest that presses has a width [m], and that extend so far along x and y [m].

    The window is twice as long as they, within 64 to 256 cells along a side.
    """
    spacing = FELT * width / BLOCK
    x, y = (min(256 * spacing, max(2.0 * length, 64 * spacing)) for length in extent)
    return Ruts(spacing, (x, y))
