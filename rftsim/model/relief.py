"""The heights of a free surface as people see it: square fields around a place, each finer and smaller than the next.

A field's vertices lie on the surface. Where a finer one lies over it, it is lowered until it is hidden; the rim of a
finer one lies just below the edges of the coarser one's triangles, so that between the two there is no gap. Fields lie
on lattices that are fixed to the world, so that what they show stays in place when they follow a robot.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array

OUTER: Final = 96
"""Cells along each side of a field that is not the finest."""
MOST: Final = 256
"""Most cells along a side of the finest field."""
ENDLESS: Final = 128
"""Cells along a side of it where the terrain repeats and bodies leave no marks."""
UNIT: Final = 32
"""Number that divides the cells along each side of a field: half of it is the largest ratio of neighbouring cells."""
STEP: Final = 4
"""Ratio of the cells of neighbouring fields where the surface has relief that the coarser one has to show."""
REACH: Final = 60.0
"""Distance that the coarsest field covers at least, over the extent of what can move."""
BELOW: Final = 0.02
"""Depth of a field below a finer one, over its cell, at least."""
SKIRT: Final = 0.2
"""Depth of the rim of a field below the coarser one, over its own cell: walls below it cast shadows on nothing."""
SMOOTH: Final = 1.5
"""Cells to a spacing of a terrain's values at least, which triangles show smoothly."""
LOWERED: Final = 0.25
"""Step by which it is lowered where that is not enough, over the same: it seldom changes where marks deepen."""
Heights = Callable[[Array, Array], Any]
"""Height of a surface over places [m]; x and y [m] of any one shape."""


class Level(NamedTuple):
    """The number of cells of a field, and their size."""

    cells: int
    """Cells along each side, a multiple of `UNIT`."""
    cell: float
    """Side of a cell [m]."""

    @property
    def width(self) -> float:
        """The side of the field [m]."""
        return self.cells * self.cell


class Fineness(NamedTuple):
    """The resolution that something needs to be seen, and how far it reaches."""

    spacing: float
    """[m]."""
    width: float
    """[m]."""


class Field(NamedTuple):
    """The heights of a surface at the vertices of a square grid."""

    centre: Array
    """x and y [m], shape (2,)."""
    heights: Array
    """[m], shape (cells + 1, cells + 1): rows along y."""


def make_levels(terrain: FreeSurface | Terrain, marks: Fineness | None, grain: float, extent: float) -> list[Level]:
    """The fields by which a surface is drawn, finest first.

    Args:
        terrain: The surface, undisturbed.
        marks: Fineness of the marks that bodies leave in it; None where they leave none.
        grain: Period of the texture on it [m]; cells are this times powers of two, so that the grain stays in place.
        extent: Extent of what can move [m].
    """
    relief, whole = math.inf, 2.0 * REACH * extent
    if isinstance(terrain, Terrain):
        shape = np.array(terrain.heights.shape[::-1]) * terrain.spacing
        spacing = min(terrain.spacing) / SMOOTH
        own = Fineness(spacing, ENDLESS * spacing if terrain.repeat else float(shape.max()))
        relief, marks = _power(own.spacing, grain, math.floor), marks or own
    assert marks is not None, "a plane without marks needs no fields"
    found = [_finest(marks, grain)]
    while found[-1].width < whole:
        cell = found[-1].cell
        enough = _power(whole / OUTER, cell, math.ceil)
        found.append(Level(OUTER, min(max(STEP * cell, relief), UNIT // 2 * cell, max(enough, 2.0 * cell))))
    return found


def period(terrain: FreeSurface | Terrain, marks: Fineness | None, wanted: float) -> float:
    """The period of the grain [m], about as long as is wanted: a power of two times what the finest field resolves."""
    if marks is not None:
        return _power(wanted, marks.spacing, round)
    return _power(wanted, min(terrain.spacing), round) if isinstance(terrain, Terrain) else wanted


def _finest(marks: Fineness, grain: float) -> Level:
    cell = _power(marks.spacing, grain, math.floor)
    while marks.width > MOST * cell:
        cell *= 2.0
    cells = UNIT * math.ceil(marks.width / cell / UNIT - 1e-9)
    return Level(max(cells, OUTER), cell)


def _power(length: float, unit: float, rounded: Callable[[float], int]) -> float:
    """The product of a unit and a power of two that is a length [m], rounded."""
    power: float = unit * 2.0 ** rounded(round(math.log2(length / unit), 6))
    return power


def sample_fields(levels: Sequence[Level], focus: Array, heights: Heights, grain: float) -> list[Field]:
    """The fields of a surface around a place, finest first.

    Args:
        levels: Their sizes, finest first.
        focus: The place, x and y [m], shape (2,).
        heights: Height of the surface [m] over places.
        grain: Period of the texture on it [m].
    """
    places = zip(levels, centres(levels, focus, grain), strict=True)
    return join_fields(levels, [sample_field(level, centre, heights) for level, centre in places])


def join_fields(levels: Sequence[Level], sampled: Sequence[Field]) -> list[Field]:
    """Fields that lie over one another without gaps, finest first, from such that lie on one surface."""
    fields = [Field(field.centre, field.heights.copy()) for field in sampled]
    for inner, outer, fine, coarse in zip(fields, fields[1:], levels, levels[1:], strict=False):
        _join(inner, outer, fine, coarse)
    return fields


def centres(levels: Sequence[Level], focus: Array, grain: float) -> Array:
    """Centres of fields around a place [m], (n, 2): the nearest where rim and grain fit the coarser one's."""
    steps = np.array([max(level.cell, grain) for level in (*levels[1:], levels[-1])])[:, None]
    return np.asarray(steps * np.rint(np.asarray(focus)[:2] / steps))


def sample_field(level: Level, centre: Array, heights: Heights) -> Field:
    """The field of a surface about a centre, x and y [m], whose vertices all lie on it."""
    along = level.cell * (np.arange(level.cells + 1) - level.cells // 2)
    return Field(centre, np.array(heights(*np.meshgrid(centre[0] + along, centre[1] + along)), dtype=float))


def _join(inner: Field, outer: Field, fine: Level, coarse: Level) -> None:
    """Put the rim of a field on the coarser one about it, and lower that under it, both in place."""
    ratio, cells = round(coarse.cell / fine.cell), round(fine.width / coarse.cell)
    first = np.rint((inner.centre - outer.centre) / coarse.cell).astype(int) + coarse.cells // 2 - cells // 2
    rows, columns = (slice(start, start + cells + 1) for start in first[::-1])
    under = outer.heights[rows, columns]
    refine = _refinement(cells, ratio)
    covered = refine @ under @ refine.T
    rims = np.s_[[0, -1], :], np.s_[:, [0, -1]]
    for rim in rims:
        inner.heights[rim] = covered[rim]
    over = _around(covered - inner.heights).reshape(cells, ratio, cells, ratio).max(axis=(1, 3))
    twist = np.abs(under[1:, 1:] + under[:-1, :-1] - under[1:, :-1] - under[:-1, 1:])  # by the diagonal that is drawn
    below, step = BELOW * coarse.cell, LOWERED * coarse.cell
    under[1:-1, 1:-1] -= _around(below + step * np.ceil(np.maximum(over + 0.25 * twist - 0.5 * below, 0.0) / step))
    for rim in rims:
        inner.heights[rim] = covered[rim] - SKIRT * fine.cell


def _refinement(cells: int, ratio: int) -> Array:
    """The matrix that interpolates linearly between values, (cells * ratio + 1, cells + 1)."""
    places = np.arange(cells * ratio + 1) / ratio
    weights: Array = np.maximum(1.0 - np.abs(places[:, None] - np.arange(cells + 1)), 0.0)
    return weights


def _around(values: Array) -> Array:
    """The largest of each four neighbours, one row and column fewer."""
    rows = np.maximum(values[1:], values[:-1])
    largest: Array = np.maximum(rows[:, 1:], rows[:, :-1])
    return largest
