"""Bodies that are images of one another but for rounding, as a robot's left and right legs are.

The sand knows neither left nor right: what is felt of a body in some pose and motion is the mirror image of what its
reflection feels in the reflected pose and motion. So where two such bodies are free, facets of the one stand for those
of the other, with the same errors.
"""

import itertools
from typing import Final

import numpy as np

from rftsim.reduction.facets import Labels
from rftsim.surface.triangles import Array, Surface

NEAR: Final = 1e-5
"""Distance, over the body's size, within which two centroids are one; rounding of single precision is a tenth."""
TRIES: Final = 4
"""Directions along which triangles are sorted: along some, two may be too near to each other to be told apart."""


def counterparts(one: Surface, other: Surface) -> Labels | None:
    """For each triangle of one surface its image of the other, shape (ntri,); None where they are no images.

    Images are by reflections along the axes of the body frame, any number of them, and a shift.

    Args:
        one: A surface, not of a wheel.
        other: Another, not of a wheel.
    """
    if one.ntri != other.ntri or one.edge_on != other.edge_on or one.wheel or other.wheel:
        return None
    if abs(one.size - other.size) > NEAR * one.size:
        return None
    first, second = _described(one), _described(other)
    for signs in itertools.product((1.0, -1.0), repeat=3):
        found = _matched(first * np.array([*signs, *signs, 1.0]), second)
        if found is not None:
            return found
    return None


def _described(surface: Surface) -> Array:
    """Centroid from the middle of all, normal and area of each triangle, in body sizes, (ntri, 7)."""
    centre = np.average(surface.centres, axis=0, weights=surface.areas)
    area = surface.areas / surface.size**2
    return np.column_stack([(surface.centres - centre) / surface.size, surface.normals, area])


def _matched(first: Array, second: Array) -> Labels | None:
    """Where in the second each row of the first is, None where one is not; see NEAR for how exactly."""
    rng = np.random.default_rng(0)
    for _ in range(TRIES):
        direction = rng.normal(size=first.shape[1])
        keys = [rows @ direction for rows in (first, second)]
        orders = [np.argsort(key, kind="stable") for key in keys]
        if np.abs(keys[0][orders[0]] - keys[1][orders[1]]).max() > 100 * NEAR:
            return None
        apart = np.abs(first[orders[0]] - second[orders[1]]).max(axis=0)
        if apart[:3].max() <= NEAR and apart[3:].max() <= 100 * NEAR:
            found = np.empty(len(first), dtype=np.intp)
            found[orders[0]] = orders[1]
            return found
    return None
