"""The drawn ground lies on the ground, stays in place while cameras and robots move, and hides no mark in it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rftsim
from rftsim.model import relief

EXTENT = 0.5
GRAIN = 0.2


def dunes(repeat=True):
    """Terrain of 9.6 m with waves of some metres and 0.2 m height."""
    rng, places = np.random.default_rng(3), 2.0 * np.pi * np.arange(48) / 48
    x, y = np.meshgrid(places, places)
    waves = [(1, 0), (2, 1), (1, 3), (4, 2), (3, 5)]
    return rftsim.Terrain(0.05 * sum(np.cos(a * x + b * y + rng.uniform(0, 7)) for a, b in waves), 0.2, repeat=repeat)


@dataclasses.dataclass
class Rutted:
    """Ground with a rut along x, 6 cm wide and 3 cm deep, in another one."""

    under: rftsim.FreeSurface | rftsim.Terrain
    place: float = 0.0

    def height_at(self, x, y):
        return self.under.height_at(x, y) - 0.03 * np.exp(-(((y - self.place) / 0.03) ** 2))


MARKS = relief.Fineness(0.0125, 1.2)
GROUNDS = {
    "dunes": (dunes(), None),
    "dunes that end": (dunes(False), None),
    "ruts in a slope": (rftsim.FreeSurface(0.1, (0.1, 0.2, 1.0)), MARKS),
    "ruts in dunes": (dunes(), MARKS),
}


def fields(name, focus):
    under, marks = GROUNDS[name]
    levels = relief.make_levels(under, marks, GRAIN, EXTENT)
    surface = under if marks is None else Rutted(under)
    return levels, relief.sample_fields(levels, np.array(focus), surface.height_at, GRAIN), surface


def vertices(level, field):
    """x, y, z of a field's vertices, (n, n, 3)."""
    along = level.cell * (np.arange(level.cells + 1) - level.cells / 2)
    x, y = np.meshgrid(field.centre[0] + along, field.centre[1] + along)
    return np.stack([x, y, field.heights], axis=-1)


def within(points, level, field, margin=0.0):
    return (np.abs(points[..., :2] - field.centre) < 0.5 * level.width - margin).all(axis=-1)


@pytest.mark.parametrize("name", GROUNDS)
def test_what_is_seen_lies_on_the_ground(name):
    """Vertices lie on it exactly where no finer field is above them, except on rims, on the coarser field's edges."""
    levels, found, surface = fields(name, (1.3, -0.7))
    for k, (level, field) in enumerate(zip(levels, found, strict=True)):
        points = vertices(level, field)
        inner = (
            within(points, level, field, 0.5 * level.cell) if k + 1 < len(levels) else np.ones(points.shape[:2], bool)
        )
        if k:
            inner &= ~within(points, levels[k - 1], found[k - 1], 0.5 * level.cell)
        assert points[inner][:, 2] == pytest.approx(surface.height_at(*points[inner][:, :2].T), abs=1e-9)
    assert levels[-1].width >= 2.0 * relief.REACH * EXTENT


@pytest.mark.parametrize("name", GROUNDS)
def test_a_finer_field_is_not_hidden_by_the_coarser_one_and_joins_it(name):
    levels, found, _ = fields(name, (0.4, 2.2))
    for fine, inner, coarse, outer in zip(levels, found, levels[1:], found[1:], strict=False):
        points, edge = vertices(fine, inner), 1e-9 + coarse.cell
        drawn = heights_of(coarse, outer, points)
        middle = within(points, fine, inner, edge)
        assert (drawn[middle] < points[middle][:, 2]).all()
        rim = ~within(points, fine, inner, 0.5 * fine.cell)
        assert points[rim][:, 2] == pytest.approx(drawn[rim], abs=1e-9)


def heights_of(level, field, points):
    """The height of a field's triangles, by the higher of both diagonals, at points (..., 3) [m]."""
    place = (points[..., :2] - field.centre) / level.cell + level.cells / 2
    first = np.clip(np.floor(place + 1e-9).astype(int), 0, level.cells - 1)
    (s, t), (i, j) = np.moveaxis(place - first, -1, 0), np.moveaxis(first, -1, 0)
    a, b = field.heights[j, i], field.heights[j, i + 1]
    c, d = field.heights[j + 1, i], field.heights[j + 1, i + 1]
    one = np.where(s + t < 1.0, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d))
    other = np.where(s > t, a + s * (b - a) + t * (d - b), a + t * (c - a) + s * (d - c))
    return np.maximum(one, other)


@settings(max_examples=30, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50), st.sampled_from(sorted(GROUNDS)))
def test_fields_move_by_whole_periods_of_the_grain_and_stay_over_one_another(x, y, name):
    """So that grain and vertices stay in place, whatever is followed; and no field leaves the coarser one."""
    under, marks = GROUNDS[name]
    levels = relief.make_levels(under, marks, GRAIN, EXTENT)
    centres = relief.centres(levels, np.array([x, y]), GRAIN)
    assert centres / GRAIN == pytest.approx(np.rint(centres / GRAIN), abs=1e-6)
    for fine, inner, coarse, outer in zip(levels, centres, levels[1:], centres[1:], strict=False):
        corner = (inner - 0.5 * fine.width) / coarse.cell
        assert corner == pytest.approx(np.rint(corner), abs=1e-6)
        assert (np.abs(inner - outer) + 0.5 * fine.width < 0.5 * coarse.width).all()
    assert np.abs(centres[0] - [x, y]).max() <= 0.5 * max(GRAIN, levels[1].cell) + 1e-9


def test_a_field_that_has_moved_shows_the_same_heights():
    levels, before, _ = fields("ruts in dunes", (0.0, 0.0))
    _, after, _ = fields("ruts in dunes", (0.45, -0.31))
    for level, one, other in zip(levels[:1], before, after, strict=False):
        shift = np.rint((other.centre - one.centre) / level.cell).astype(int)
        assert shift.any()
        first, second = (_part(field.heights, own) for field, own in ((one, shift), (other, -shift)))
        assert first[1:-1, 1:-1] == pytest.approx(second[1:-1, 1:-1], abs=1e-12)


def _part(heights, shift):
    """The part of a field that one shifted by some cells along x and y covers, without rims."""
    inner = heights[1:-1, 1:-1]
    n = len(inner)
    x, y = (slice(max(s, 0), n + min(s, 0)) for s in shift)
    return inner[y, x]
