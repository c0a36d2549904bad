"""How the faces of a mesh hang together: welded vertices, edges that faces share, closed shells."""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.integer[Any]]
Indices = NDArray[np.intp]

NEAR: Final = 1e-6
"""Angle between faces that lie on one another, by rounding [rad]."""


def welded(points: Array, faces: Faces) -> tuple[Array, Faces]:
    """Vertices that faces have, none twice, to 1e-8, and the faces on them."""
    used, faces = np.unique(faces, return_inverse=True)
    points = points[used]
    first, same = distinct(np.round(points * 1e8).astype(np.int64))
    return points[first], same[faces].reshape(-1, 3)


def distinct(rows: Faces) -> tuple[Indices, Indices]:
    """Where each distinct row of integers is first, and which of these each row is."""
    first, same = np.zeros(1, dtype=int), np.zeros(len(rows), dtype=int)
    for column in rows.T:
        value = np.unique(column, return_inverse=True)[1]
        _, first, same = np.unique(same * (value.max(initial=0) + 1) + value, return_index=True, return_inverse=True)
    return first, same


def needed(faces: Faces) -> NDArray[np.bool_]:
    """Which faces are needed where some are there several times, either way round, shape (nface,).

    Each counts once, if the mesh is closed then. If not, closed shells share faces: two that look opposite ways part
    shells that touch, and neither is needed; two that look the same way are both.
    """
    first, same = distinct(np.sort(faces, axis=1))
    once = np.zeros(len(faces), dtype=bool)
    once[first] = True
    if once.all() or is_closed(faces[once]):
        return once
    ascending = (faces[:, 0] < faces[:, 1]).astype(int) + (faces[:, 1] < faces[:, 2]) + (faces[:, 2] < faces[:, 0])
    sign = np.where(ascending == 2, 1, -1)
    net = np.bincount(same, sign).astype(int)
    order = np.lexsort((np.arange(len(faces)), sign, same))
    start = np.searchsorted(same[order], np.arange(len(first)))
    rank = np.empty(len(faces), dtype=int)
    rank[order] = np.arange(len(faces)) - start[same[order]]
    negative = np.bincount(same, sign < 0).astype(int)
    own = np.where(sign < 0, rank, rank - negative[same])
    kept: NDArray[np.bool_] = (sign == np.sign(net)[same]) & (own < np.abs(net)[same])
    return kept if kept.any() and is_closed(faces[kept]) else once


def open_face(faces: Faces) -> int | None:
    """A face one of whose directed edges has no opposite, or None where the surface is closed."""
    tail, head = _directed(faces)
    balance = np.bincount(_edges(faces), np.sign(head - tail))
    wrong = balance[_edges(faces)] != 0
    return int(np.argmax(wrong)) // 3 if wrong.any() else None


def is_closed(faces: Faces) -> bool:
    """Whether each directed edge of faces, shape (nface, 3), has its opposite."""
    return open_face(faces) is None


def shells(points: Array, faces: Faces) -> tuple[Indices, Array, Faces]:
    """Take a mesh apart into its shells.

    An edge that more than two faces share is one at which shells touch, or parts of one: first those faces go together
    that hang together elsewhere, then those between which the solid lies.

    Args:
        points: Places of the vertices [m], shape (nvert, 3).
        faces: Welded, their winding consistent, shape (nface, 3).

    Returns:
        The shell of each face, from 0 on, shape (nface,); and places of vertices and faces on them, where shells share
        no vertex, and each directed edge of a closed one has one opposite.
    """
    mate = _mates(points, faces)
    half = np.flatnonzero(mate >= 0)
    onward = mate[half] - mate[half] % 3 + (mate[half] + 1) % 3
    corners = _components(3 * len(faces), half, onward)
    places = np.empty((int(corners.max()) + 1, 3))
    places[corners] = points[faces.ravel()]
    return _components(len(faces), half // 3, mate[half] // 3), places, corners.reshape(-1, 3)


def _directed(faces: Faces) -> tuple[Indices, Indices]:
    """Tails and heads of the directed edges of faces, three for each, (3 nface,) each."""
    return faces.ravel().astype(np.intp), faces[:, [1, 2, 0]].ravel().astype(np.intp)


def _edges(faces: Faces) -> Indices:
    """A number for the edge that each directed edge lies on, (3 nface,)."""
    tail, head = _directed(faces)
    code = np.minimum(tail, head) * (int(faces.max()) + 1) + np.maximum(tail, head)
    edge: Indices = np.unique(code, return_inverse=True)[1]
    return edge


def _mates(points: Array, faces: Faces) -> Indices:
    """For each directed edge its opposite in the same shell, -1 where there is none, (3 nface,)."""
    tail, head = _directed(faces)
    edge = _edges(faces)
    order = np.argsort(edge, kind="stable")
    count = np.bincount(edge)
    starts = np.concatenate([[0], np.cumsum(count)[:-1]])
    mate = np.full(len(edge), -1)
    plain = starts[count == 2]
    one, other = order[plain], order[plain + 1]
    opposite = tail[one] == head[other]
    mate[one[opposite]], mate[other[opposite]] = other[opposite], one[opposite]
    shared = [order[starts[number] : starts[number] + count[number]] for number in np.flatnonzero(count > 2)]
    if shared:
        half = np.flatnonzero(mate >= 0)
        patch = _components(len(faces), half // 3, mate[half] // 3)
        fans = [_Fan.of(points[faces], own, tail[own] < head[own]) for own in shared]
        sense = _senses(points[faces], patch)
        for one, other in _paired(fans, patch, sense):
            mate[one], mate[other] = other, one
    return mate


def _senses(triangles: Array, patch: Indices) -> Indices:
    """Whether the faces of each patch look outward (1), inward (-1), or may do either, as flat ones do (0)."""
    size = np.ptp(triangles, axis=(0, 1)).max()
    volume = volumes(triangles, patch)
    looks: Indices = np.sign(volume).astype(int) * (np.abs(volume) > 1e-12 * size**3)
    return looks


class _Fan(NamedTuple):
    """The directed edges of faces around an edge that more than two share."""

    forward: list[int]
    """Those of one direction, which are to be paired."""
    backward: list[int]
    """Those against it."""
    angle: dict[int, float]
    """The angle about the edge at which the face of each lies [rad]."""

    @classmethod
    def of(cls, triangles: Array, halves: Indices, is_forward: NDArray[np.bool_]) -> "_Fan":
        """The fan of directed edges, (n,), of which some run forward, (n,)."""
        face, corner = halves // 3, halves % 3
        ends = triangles[face, corner], triangles[face, (corner + 1) % 3]
        along = (ends[1] - ends[0])[0] * (1.0 if is_forward[0] else -1.0)
        arm = triangles[face, (corner + 2) % 3] - ends[0]
        first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        angle = np.arctan2(arm @ np.cross(along, first) / np.linalg.norm(along), arm @ first)
        return cls(
            halves[is_forward].tolist(),
            halves[~is_forward].tolist(),
            dict(zip(halves.tolist(), angle.tolist(), strict=True)),
        )

    def choice(self, part: Callable[[int], tuple[int, int]]) -> tuple[int, int, bool]:
        """The likeliest pair, and whether it is sure: of one part, or with no rival at the same angle.

        Args:
            part: The part that a directed edge is known to belong to, and whether its faces look outward (1), inward
                (-1), or may do either (0).
        """
        found = []
        for one in self.forward:
            for other in self.backward:
                (own, sense), (its, other_sense) = part(one), part(other)
                turn = (sense or other_sense or 1) * (self.angle[one] - self.angle[other])  # the solid lies behind both
                found.append((own != its, (turn - NEAR) % (2.0 * np.pi), one, other))
        found.sort()
        _, least, one, other = found[0]
        rivals = (abs(angle - least) < 2.0 * NEAR and (a == one) != (b == other) for _, angle, a, b in found)
        return one, other, not found[0][0] or not any(rivals)


def _paired(fans: list[_Fan], patch: Indices, sense: Indices) -> Iterator[tuple[int, int]]:
    """Pairs of directed edges that belong to one shell; what is not sure waits until other edges have told.

    Args:
        fans: Edges with more than two faces; emptied.
        patch: What faces hang together by other edges, shape (nface,).
        sense: Whether the faces of each patch look outward, inward, or may do either (1, -1, 0).
    """
    leader, looks = list(range(len(sense))), sense.tolist()

    def part(half: int) -> tuple[int, int]:
        number = int(patch[half // 3])
        while leader[number] != number:
            leader[number] = leader[leader[number]]
            number = leader[number]
        return number, looks[number]

    waiting = fans
    while waiting:
        later, must = [], True
        for fan in waiting:
            while fan.forward and fan.backward:
                one, other, sure = fan.choice(part)
                if not sure and not (must and fan is waiting[-1]):
                    break
                must = False
                fan.forward.remove(one)
                fan.backward.remove(other)
                (own, sign), (its, other_sign) = part(one), part(other)
                leader[own], looks[its] = its, other_sign or sign
                yield one, other
            if fan.forward and fan.backward:
                later.append(fan)
        waiting = later


def volumes(triangles: Array, label: Indices) -> Array:
    """Volume within each shell [m^3], about the mean of its faces where it is open, shape (nshell,)."""
    count = np.bincount(label)
    middle = np.stack([np.bincount(label, triangles[:, :, k].mean(axis=1)) / count for k in range(3)], axis=1)
    a, b, c = np.moveaxis(triangles - middle[label][:, None], 1, 0)
    parts: Array = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    return np.bincount(label, parts).astype(float)


def _components(count: int, one: Indices, other: Indices) -> Indices:
    """A number from 0 on for each of `count` things, the same where links lead from one to the other, (count,)."""
    labels = np.arange(count)
    while True:
        least = np.minimum(labels[one], labels[other])
        lower = labels.copy()
        for end in (one, other):
            np.minimum.at(lower, end, least)
            np.minimum.at(lower, labels[end], least)
        lower = lower[lower]
        if (lower == labels).all():
            numbered: Indices = np.unique(labels, return_inverse=True)[1]
            return numbered
        labels = lower
