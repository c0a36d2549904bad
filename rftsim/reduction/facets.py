"""Facets: neighbouring triangles of like normals that the sand feels as one.

A law sees of a triangle only its centroid, its normal and its area, so what stands for several triangles need not be
part of a mesh. A facet has the sum of their area vectors; so a closed surface stays closed, sum n A = 0.
"""

import dataclasses
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rftsim.surface.triangles import Array, Surface

Labels = NDArray[np.intp]
"""The cluster of each triangle, 0 to n - 1, shape (ntri,)."""

TURN: Final = 0.25
"""How far two normals' difference counts against two centroids', which count in body sizes; found by trial."""
ROUNDS: Final = 2
"""Rounds in which triangles change to the nearest cluster."""
CHUNK: Final = 512
"""Points that are held against all means at once; so many keep the distances in the processor's cache."""


def features(surface: Surface, nearness: Array) -> Array:
    """Points whose distance says how unlike two triangles are to the sand, shape (ntri, 6).

    Args:
        surface: The triangles.
        nearness: Symmetric matrix, shape (3, 3); to the sand two centroids lie |nearness (c1 - c2)| apart.
    """
    apart = surface.centres - surface.centres.mean(axis=0)
    return np.hstack([apart @ nearness / surface.size, TURN * surface.normals])


def split(labels: Labels, chosen: Labels, points: Array, weights: Array) -> Labels:
    """The labels after each chosen cluster was cut in two across its longest principal axis, where it can be.

    Args:
        labels: Cluster of each point, 0 to n - 1, shape (npoint,).
        chosen: Clusters to cut.
        points: Places of the points, shape (npoint, k).
        weights: Weight of each point, shape (npoint,).
    """
    count = int(labels.max()) + 1
    place = np.full(count, -1)
    place[chosen] = np.arange(len(chosen))
    among = np.flatnonzero(place[labels] >= 0)
    own, weight = place[labels[among]], weights[among]
    apart = points[among] - _means(own, points[among], weight)[own]
    axis = np.linalg.eigh(_moments(own, apart, weight))[1][:, :, -1]
    ahead = np.einsum("ij,ij->i", apart, axis[own]) > 1e-12
    part = np.bincount(own[ahead], minlength=len(chosen))
    can = (part > 0) & (part < np.bincount(own, minlength=len(chosen)))
    fresh = count + np.cumsum(can) - 1
    moved = ahead & can[own]
    labels = labels.copy()
    labels[among[moved]] = fresh[own[moved]]
    return labels


def settled(labels: Labels, points: Array, weights: Array) -> Labels:
    """The labels after each point went to the cluster of the nearest mean, ROUNDS times; arguments as of `split`."""
    for _ in range(ROUNDS):
        labels = np.unique(_nearest(points, _means(labels, points, weights)), return_inverse=True)[1]
    return labels


def spread(labels: Labels, points: Array, weights: Array) -> Array:
    """How far the points of each cluster lie apart: their weighted second moment about the mean, shape (n,)."""
    apart = points - _means(labels, points, weights)[labels]
    return _sums(labels, (weights * np.einsum("ij,ij->i", apart, apart))[:, None])[:, 0]


def fused(labels: Labels, count: int, costs: Array, points: Array, weights: Array) -> Labels:
    """The labels after up to so many clusters went into their nearest, the cheapest pairs first, each once at most.

    Args:
        labels: Cluster of each point, 0 to n - 1, shape (npoint,).
        count: Clusters that are to vanish.
        costs: Cost of each cluster, two of which make that of a pair, shape (n,).
        points: Places of the points, shape (npoint, k).
        weights: Weight of each point, shape (npoint,).
    """
    means = _means(labels, points, weights)
    near, into = _neighbours(means), np.arange(len(means))
    taken = np.zeros(len(means), dtype=bool)
    for one in np.argsort(costs + costs[near], kind="stable").tolist():
        other = int(near[one])
        if count > 0 and not taken[one] and not taken[other]:
            taken[[one, other]], into[one], count = True, other, count - 1
    return np.unique(into[labels], return_inverse=True)[1]


def _means(labels: Labels, points: Array, weights: Array) -> Array:
    """Weighted means of the points of each cluster, (n, k)."""
    return _sums(labels, weights[:, None] * points) / np.bincount(labels, weights)[:, None]


def _moments(labels: Labels, apart: Array, weights: Array) -> Array:
    """Second moments of each cluster's points about its mean, (n, k, k)."""
    k = apart.shape[1]
    i, j = np.triu_indices(k)
    found = np.empty((int(labels.max()) + 1, k, k))
    found[:, i, j] = found[:, j, i] = _sums(labels, weights[:, None] * apart[:, i] * apart[:, j])
    return found


def _sums(labels: Labels, values: Array) -> Array:
    """Sums over each cluster, (n, k), of values of shape (npoint, k)."""
    found: Array = np.column_stack([np.bincount(labels, column) for column in values.T])
    return found


def _nearest(points: Array, means: Array) -> Labels:
    """The nearest mean to each point, (npoint,); in single precision, which is twice as fast."""
    place, means = points.astype(np.float32), means.astype(np.float32)
    across, square = -2.0 * means.T, (means**2).sum(axis=1)
    found = np.empty(len(points), dtype=np.intp)
    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        found[part] = np.argmin(place[part] @ across + square, axis=1)
    return found


def _neighbours(means: Array) -> Labels:
    """The nearest other mean to each, (n,)."""
    square, found = (means**2).sum(axis=1), np.empty(len(means), dtype=np.intp)
    for start in range(0, len(means), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(means)))
        apart = square - 2.0 * means[part] @ means.T
        apart[np.arange(len(part)), part] = np.inf
        found[part] = apart.argmin(axis=1)
    return found


def merged(surface: Surface, labels: Labels) -> Surface:
    """The surface of one facet for each cluster: its area vector, at its centre of area, shifted to keep the volume.

    A facet is kept as an equilateral triangle of its centroid, normal and area. Those without an area, which hold both
    sides of a plate, are kept too, as triangles of next to no area.
    """
    vectors, areas, centres = surface.normals * surface.areas[:, None], surface.areas, surface.centres

    vector, middle = _sums(labels, vectors), _means(labels, centres, areas)
    area = np.maximum(np.linalg.norm(vector, axis=1), 1e-15 * areas.sum())
    normal = np.where(area[:, None] > 1e-14 * areas.sum(), vector / area[:, None], [0.0, 0.0, 1.0])
    volume = np.bincount(labels, np.einsum("ij,ij->i", centres, vectors))  # three times that of the cone to the origin
    lacking = volume - np.einsum("ij,ij->i", middle, vector)
    flat = area > 1e-3 * np.bincount(labels, areas)
    centre = middle + np.where(flat[:, None], normal * (lacking / area)[:, None], 0.0)
    return dataclasses.replace(surface, triangles=_equilateral(centre, normal, area), outline=surface.corners)


def _equilateral(centres: Array, normals: Array, areas: Array) -> Array:
    """Equilateral triangles, (n, 3, 3), counter-clockwise about their normals."""
    aside = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, aside)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    radius = np.sqrt(areas / (0.75 * np.sqrt(3.0)))[:, None]
    angles = 2 * np.pi / 3 * np.arange(3)
    return np.stack([centres + radius * (np.cos(a) * first + np.sin(a) * second) for a in angles], axis=1)
