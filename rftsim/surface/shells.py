"""The shells of a mesh: wound outward, and united, so that only what meets the sand is left."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim.errors import SurfaceError
from rftsim.surface.topology import Array, Faces, Indices, is_closed, shells, volumes
from rftsim.surface.union import APART, area, groups, shown

Flags = NDArray[np.bool_]


class _Left(NamedTuple):
    """What a union leaves of shells."""

    triangles: list[Array | None]
    """Of each shell [m], shape (ntri, 3, 3); None where all is inside others."""
    cut: int
    """Number of shells that lie inside others in part."""
    trouble: str
    """Why shells could not be united; empty where they could."""


def wound(points: Array, faces: Faces) -> tuple[Faces, Flags]:
    """Faces of a consistent winding, where they can have one, and whether each was turned for it, shape (nface,)."""
    if is_closed(faces):
        return faces, np.zeros(len(faces), dtype=bool)
    import trimesh  # not at start-up, which it would slow by a second

    mesh = trimesh.Trimesh(points, faces, process=False)
    trimesh.repair.fix_winding(mesh)
    turned = np.array(mesh.faces)
    return turned, (_cyclic(turned) != _cyclic(faces)).any(axis=1)


def outer(points: Array, faces: Faces, turned: Flags, name: str) -> tuple[Array, list[str]]:
    """The triangles of a mesh that sand can reach [m], outward, (ntri, 3, 3), and sentences about what was done.

    Shells that enclose a negative volume are turned. Closed ones count as solids, of which the union's surface is left:
    what lies inside another shell, a cavity's wall too, meets no sand.

    Args:
        points: Places of the vertices, shape (nvert, 3).
        faces: Welded, their winding consistent, shape (nface, 3).
        turned: Whether each was turned already, shape (nface,).
        name: Name of the mesh in messages.
    """
    label, places, corners = shells(points, faces)
    inward = (volumes(places[corners], label) < 0.0)[label]
    corners[inward] = corners[inward][:, ::-1]
    left = _left(places, corners, label)
    hidden = np.array([triangles is None for triangles in left.triangles])[label]
    kept = np.concatenate([triangles for triangles in left.triangles if triangles is not None])
    notes = []
    if flipped := int(np.count_nonzero((turned ^ inward) & ~hidden)):
        notes.append(f"{name}: turned {flipped} of {len(faces)} faces outward")
    if hidden.any():
        count = np.count_nonzero(hidden)
        notes.append(f"{name}: dropped {count} faces of shells inside another, which no sand reaches")
    if left.cut:
        notes.append(f"{name}: of {left.cut} shells that overlap others only what lies outside them is felt")
    if left.trouble:
        notes.append(
            f"{name}: shells that overlap count twice where they do, as they could not be united: {left.trouble}"
        )
    return kept, notes


def _left(places: Array, corners: Faces, label: Indices) -> _Left:
    """Unite the closed shells of a mesh that overlap."""
    members = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
    parts: list[Array | None] = [places[corners[own]] for own in members]
    closed = [k for k, own in enumerate(members) if is_closed(corners[own])] if len(members) > 1 else []
    cut, trouble = 0, ""
    for group in groups([places[corners[members[k]]] for k in closed]) if len(closed) > 1 else []:
        if len(group) < 2:
            continue
        own = [closed[k] for k in group]
        try:
            found = shown([_alone(places, corners[members[k]]) for k in own])
        except SurfaceError as error:
            trouble = str(error)
            continue
        for k, triangles in zip(own, found, strict=True):
            cut += triangles is not None and area([triangles]) < (1.0 - APART) * area([parts[k]])
            parts[k] = triangles
    return _Left(parts, cut, trouble)


def _alone(places: Array, faces: Faces) -> tuple[Array, Faces]:
    """The vertices that some faces have, and the faces on them."""
    used, own = np.unique(faces, return_inverse=True)
    return places[used], own.reshape(-1, 3)


def _cyclic(faces: Faces) -> Faces:
    """Faces rotated so that the smallest vertex comes first, which leaves the winding."""
    start = np.argmin(faces, axis=1)[:, None]
    return np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
