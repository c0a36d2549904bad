"""How the faces of a mesh hang together: welded vertices, edges that faces share, closed shells."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.integer[Any]]
Indices = NDArray[np.intp]


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

    Each counts once, but that two closed shells which share a face need it twice: where an edge would have an odd
    number of faces, a second one is kept, if that closes the mesh.
    """
    first, same = distinct(np.sort(faces, axis=1))
    once = np.zeros(len(faces), dtype=bool)
    once[first] = True
    if once.all():
        return once
    second = np.zeros(len(faces), dtype=bool)
    rest = np.flatnonzero(~once)
    second[rest[np.unique(same[rest], return_index=True)[1]]] = True
    edge = _edges(faces).reshape(-1, 3)
    keep = once.copy()
    while True:
        odd = np.bincount(edge[keep].ravel(), minlength=int(edge.max()) + 1) % 2 == 1
        more = second & ~keep & odd[edge].any(axis=1)
        if not more.any():
            return keep if not odd.any() else once
        keep |= more


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
    shared = np.flatnonzero(count > 2)
    if shared.size:
        half = np.flatnonzero(mate >= 0)
        patch = _components(len(faces), half // 3, mate[half] // 3)
        for number in shared:
            own = order[starts[number] : starts[number] + count[number]]
            _pair(points, faces, own[tail[own] < head[own]], own[tail[own] > head[own]], patch, mate)
    return mate


def _pair(points: Array, faces: Faces, forward: Indices, backward: Indices, patch: Indices, mate: Indices) -> None:
    """Pair the directed edges along one edge with those against it; fills their mates."""
    left, right = list(forward), list(backward)
    for one in forward:
        near = [other for other in right if patch[other // 3] == patch[one // 3]]
        if len(near) == 1 and np.count_nonzero(patch[forward // 3] == patch[one // 3]) == 1:
            left.remove(one)
            right.remove(near[0])
            mate[one], mate[near[0]] = near[0], one
    if not (left and right):
        return
    start, end = points[faces[left[0] // 3, left[0] % 3]], points[faces[left[0] // 3, (left[0] + 1) % 3]]
    along = (end - start) / np.linalg.norm(end - start)
    angle = {half: _turn(points[faces[half // 3, (half + 2) % 3]] - start, along) for half in (*left, *right)}
    for one in left:
        if right:  # the solid lies behind a face: turn from a face that runs forward against the right hand
            nearest = min(right, key=lambda other: (angle[one] - angle[other] - 1e-9) % (2.0 * np.pi))
            right.remove(nearest)
            mate[one], mate[nearest] = nearest, one


def _turn(arm: Array, along: Array) -> float:
    """The angle about an edge at which a face beside it lies, whose third corner is at the end of an arm [rad]."""
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    return float(np.arctan2(arm @ np.cross(along, first), arm @ first))


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
