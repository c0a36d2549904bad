"""The tiles of ground as Rerun's meshes over time, coloured by how far they are above or below the undisturbed."""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim.sand.free_surface import slope_normal
from rftsim.surface.triangles import Array
from rftsim.view.colours import packed
from rftsim.view.tiles import Place, Tiles

SHADES: Final = ((88, 66, 42), (196, 172, 130), (252, 246, 230))
"""Colours of ground as deep as the scale, undisturbed, and as high."""
LEAST: Final = 1e-3
"""Height of a mark that counts, over the cell."""


class TileRows(NamedTuple):
    """A tile at the times at which it changed."""

    place: Place
    """The tile."""
    time: Array
    """Times of the recording [s], shape (n,)."""
    fields: dict[str, NDArray[Any]]
    """Fields of Rerun's mesh, (n, vertices, ...)."""


def ground_scale(tiles: Tiles) -> float:
    """The height above or below the undisturbed ground that 99 % of the marks do not exceed [m]; zero without marks."""
    marks = [np.abs(moments[-1].marks) for moments in tiles.kept.values()]
    found = np.concatenate([one[one > LEAST * tiles.cell] for one in marks] or [np.empty(0)])
    return float(np.percentile(found, 99.0)) if found.size else 0.0


def tile_rows(tiles: Tiles, scale: float) -> Iterator[TileRows]:
    """The tiles of a bed, each with its vertices, normals and colours at the times at which it changed.

    Args:
        tiles: What was kept of the bed.
        scale: Height of the strongest colour [m].
    """
    for place, moments in tiles.kept.items():
        heights = np.array([moment.heights for moment in moments])
        (ground,) = tiles.vertices(np.array([place]))
        vertices = np.concatenate([np.broadcast_to(ground, (*heights.shape, 2)), heights[..., None]], axis=-1)
        along_y, along_x = np.gradient(heights, tiles.cell, axis=(1, 2))
        share = np.array([moment.marks for moment in moments]) / (scale or 1.0)
        fields = {
            "vertex_positions": vertices.reshape(len(heights), -1, 3).astype(np.float32),
            "vertex_normals": slope_normal(along_x, along_y).reshape(len(heights), -1, 3).astype(np.float32),
            "vertex_colors": ground_colours(share).reshape(len(heights), -1),
        }
        yield TileRows(place, np.array([moment.time for moment in moments]), fields)


def ground_colours(share: NDArray[np.floating[Any]]) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of ground at heights above the undisturbed, over the scale: dark below, light above."""
    return packed(np.stack([np.interp(share, (-1.0, 0.0, 1.0), channel) for channel in zip(*SHADES, strict=True)], -1))
