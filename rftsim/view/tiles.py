"""The ground as a recording keeps it: square tiles around the bodies, each again only when it has changed."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim.model.ground import Ground
from rftsim.surface.triangles import Array

CELLS: Final = 24
"""Cells along each side of a tile."""
AROUND: Final = 3.0
"""Distance from the bodies within which the ground is kept, over the extent of what can move."""
NEAR: Final = 0.3
"""Distance from the bodies within which it is looked at again, over the same."""
SEEN: Final = 0.01
"""Change of a height that is kept, over the cell."""

Place = tuple[int, int]
"""Number of a tile along x and y: its first corner over its width."""


class Moment(NamedTuple):
    """A tile from a time on."""

    time: float
    """Time of the recording [s]."""
    heights: "NDArray[np.float32]"
    """Heights of its vertices [m], shape (CELLS + 1, CELLS + 1): rows along y."""
    marks: "NDArray[np.float32]"
    """The same over the undisturbed ground."""


class Tiles:
    """The ground of one bed, in tiles.

    Args:
        cell: Side of a cell [m].
        extent: The extent of what can move [m].

    Attributes:
        kept: The moments of each tile, by its place.
    """

    def __init__(self, cell: float, extent: float) -> None:
        self.cell, self._extent = cell, extent
        self.kept: dict[Place, list[Moment]] = {}

    def note(self, bodies: Array, ground: Ground, time: float) -> None:
        """Keep the ground around bodies, where it is new, and near them, where it has changed.

        Args:
            bodies: Their places [m], shape (n, 2).
            ground: The ground as it is.
            time: Time of the recording [s].
        """
        wanted = sorted(self._around(bodies, AROUND) - self.kept.keys() | self._around(bodies, NEAR))
        if not wanted:
            return
        x, y = np.moveaxis(self.vertices(np.array(wanted)), -1, 0)
        heights = np.asarray(ground.height_at(x, y))
        marks = (heights - ground.undisturbed_at(x, y)).astype(np.float32)
        for place, *found in zip(wanted, heights.astype(np.float32), marks, strict=True):
            before, now = self.kept.setdefault(place, []), Moment(time, *found)
            if not before or np.abs(before[-1].heights - now.heights).max() > SEEN * self.cell:
                before.append(now)

    def vertices(self, places: NDArray[np.integer[Any]]) -> Array:
        """X and y [m] of the vertices of tiles, (n, 2), shape (n, CELLS + 1, CELLS + 1, 2)."""
        along = np.arange(CELLS + 1)
        grid = np.stack(np.meshgrid(along, along), axis=-1)
        return np.asarray(self.cell * (CELLS * places[:, None, None] + grid))

    def _around(self, bodies: Array, distance: float) -> set[Place]:
        """Places of the tiles within a distance from any of some bodies, over the extent, along x and y."""
        reach, width = distance * self._extent, CELLS * self.cell
        first = np.floor((bodies - reach) / width).astype(int)
        last = np.floor((bodies + reach) / width).astype(int)
        boxes = zip(*first.T.tolist(), *last.T.tolist(), strict=True)
        return {(i, j) for i0, j0, i1, j1 in boxes for i in range(i0, i1 + 1) for j in range(j0, j1 + 1)}


def tile_triangles() -> NDArray[np.uint32]:
    """Vertices of the triangles of a tile, counted row by row, shape (2 CELLS^2, 3), anticlockwise from above."""
    first = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).ravel()
    beside, above = first + 1, first + CELLS + 1
    triangles = np.stack([first, beside, above + 1, first, above + 1, above], axis=-1).reshape(-1, 3)
    return triangles.astype(np.uint32)
