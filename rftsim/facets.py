"""Facets: neighbouring triangles of like normals that the sand feels as one.

A law sees of a triangle only its centroid, its normal and its area, so what stands for several triangles need not be
part of a mesh. A facet has the sum of their area vectors; so a closed surface stays closed, sum n A = 0.
"""

import dataclasses
import heapq
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rftsim.surface import Array, Surface

Labels = NDArray[np.intp]

TURN: Final = 0.25
"""How far two normals' difference counts against two centroids', which count in body sizes; found by trial."""
ROUNDS: Final = 2
"""Rounds in which triangles change to the nearest cluster."""


def features(surface: Surface, nearness: Array) -> Array:
    """Points whose distance says how unlike two triangles are to the sand, (ntri, 6).

    Args:
        surface: The triangles.
        nearness: Symmetric, (3, 3); how far two centroids lie apart to the sand is |nearness (c1 - c2)|.
    """
    return np.hstack([surface.centres @ nearness / surface.size, TURN * surface.normals])


def bisections(points: Array, weights: Array, count: int) -> list[Labels]:
    """Cut a set of points in two, along its longest principal axis, again and again, the widest part first.

    Args:
        points: (n, k).
        weights: (n,).
        count: Parts that are wanted at most.

    Returns:
        For each part, in the order in which they arise, the points that leave the part they were in for it.
    """
    parts = [np.arange(len(points))]
    left = [parts[0]]
    queue: list[tuple[float, int, Labels, Labels]] = []

    def judge(number: int) -> None:
        part = parts[number]
        apart = points[part] - np.average(points[part], axis=0, weights=weights[part])
        spread, axes = np.linalg.eigh((weights[part, None] * apart).T @ apart)
        ahead = apart @ axes[:, -1] > 0.0
        if ahead.any() and not ahead.all():
            heapq.heappush(queue, (-float(spread[-1]), number, part[ahead], part[~ahead]))

    judge(0)
    while queue and len(parts) < count:
        _, number, leaving, staying = heapq.heappop(queue)
        parts[number] = staying
        parts.append(leaving)
        left.append(leaving)
        judge(number)
        judge(len(parts) - 1)
    return left


def clusters(points: Array, weights: Array, cuts: list[Labels], count: int) -> Labels:
    """The cluster of each point, (n,): `count` bisections, then rounds of Lloyd's algorithm."""
    labels = np.zeros(len(points), dtype=np.intp)
    for number, leaving in enumerate(cuts[:count]):
        labels[leaving] = number
    for _ in range(ROUNDS):
        weight = np.bincount(labels, weights)
        sums = np.column_stack([np.bincount(labels, weights * column) for column in points.T])
        kept = weight > 0.0
        labels = cKDTree(sums[kept] / weight[kept, None]).query(points)[1]
    found: Labels = np.unique(labels, return_inverse=True)[1]
    return found


def merged(surface: Surface, labels: Labels) -> Surface:
    """One facet for each cluster: its area vector, at its centre of area, shifted so that the volume stays.

    A facet is kept as an equilateral triangle of its centroid, normal and area.
    """
    vectors, areas, centres = surface.normals * surface.areas[:, None], surface.areas, surface.centres

    def summed(values: Array) -> Array:
        return np.column_stack([np.bincount(labels, column) for column in values.T])

    vector, middle = summed(vectors), summed(areas[:, None] * centres) / np.bincount(labels, areas)[:, None]
    area = np.linalg.norm(vector, axis=1)
    kept = area > 1e-14 * areas.sum()  # a cluster may hold both sides of a plate, and push nowhere
    normal = vector[kept] / area[kept, None]
    volume = np.bincount(labels, np.einsum("ij,ij->i", centres, vectors))  # three times that of the cone to the origin
    lacking = volume - np.einsum("ij,ij->i", middle, vector)
    centre = middle[kept] + normal * (lacking[kept] / area[kept])[:, None]
    return dataclasses.replace(surface, triangles=_equilateral(centre, normal, area[kept]), outline=surface.corners)


def _equilateral(centres: Array, normals: Array, areas: Array) -> Array:
    """Equilateral triangles, (n, 3, 3), counter-clockwise about their normals."""
    aside = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, aside)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    radius = np.sqrt(areas / (0.75 * np.sqrt(3.0)))[:, None]
    angles = 2 * np.pi / 3 * np.arange(3)
    return np.stack([centres + radius * (np.cos(a) * first + np.sin(a) * second) for a in angles], axis=1)
