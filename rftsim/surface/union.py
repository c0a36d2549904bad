"""Unions of closed surfaces, by manifold3d: faces that lie inside another part of the same solid meet no sand."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from rftsim.errors import SurfaceError
from rftsim.surface.topology import Array, Faces, shells, welded

if TYPE_CHECKING:
    from rftsim.surface.triangles import Surface

GROWN: Final = (0.0, 1e-9, 1e-6)
"""How far solids are blown up, over their size, so that those that touch overlap: not, or by more than the rounding of
double or of single precision. The least counts that leaves no more area than the most."""
TOUCHING: Final = 1e-5
"""Share of the area that may be left between solids that touch."""

APART: Final = 1e-12
"""Share of the area down to which what a union takes away is rounding."""


def overlapping(surfaces: "Sequence[Surface]") -> list[list[int]]:
    """Groups of surfaces, by their numbers, whose boxes overlap or touch, directly or through others."""
    return groups([surface.triangles for surface in surfaces])


def groups(solids: Sequence[Array]) -> list[list[int]]:
    """Groups of solids, by their numbers, whose boxes overlap or touch, directly or through others.

    Args:
        solids: Triangles of each [m], shape (ntri, 3, 3).
    """
    low = np.array([triangles.min(axis=(0, 1)) for triangles in solids]).reshape(-1, 3)
    high = np.array([triangles.max(axis=(0, 1)) for triangles in solids]).reshape(-1, 3)
    high = high + GROWN[-1] * float((high - low).max(initial=0.0))
    order = np.argsort(low[:, 0], kind="stable")
    ends = np.searchsorted(low[order, 0], high[order, 0], side="right")
    leader = list(range(len(solids)))

    def first(number: int) -> int:
        while leader[number] != number:
            leader[number] = leader[leader[number]]
            number = leader[number]
        return number

    for place, (one, end) in enumerate(zip(order.tolist(), ends.tolist(), strict=True)):
        later = order[place + 1 : end]
        for other in later[((low[later] <= high[one]) & (high[later] >= low[one])).all(axis=1)].tolist():
            a, b = sorted((first(one), first(other)))
            leader[b] = a
    found: dict[int, list[int]] = {}
    for number in range(len(solids)):
        found.setdefault(first(number), []).append(number)
    return list(found.values())


def united(surfaces: "Sequence[Surface]") -> "list[Surface | None]":
    """The part of each of several closed surfaces that the union of their solids shows, None where all is inside.

    Args:
        surfaces: Closed, outward, in one frame, without wheels.

    Raises:
        SurfaceError: A surface is no boundary of a solid to manifold3d.
    """
    solids = []
    for surface in surfaces:
        mesh = welded(surface.triangles.reshape(-1, 3), np.arange(3 * surface.ntri).reshape(-1, 3))
        solids.append(shells(*mesh)[1:])
    return [
        None if triangles is None else dataclasses.replace(surface, triangles=triangles)
        for surface, triangles in zip(surfaces, shown(solids), strict=True)
    ]


def shown(solids: Sequence[tuple[Array, Faces]]) -> list[Array | None]:
    """The triangles of each of several solids that their union shows [m], (ntri, 3, 3); None where all is inside.

    Solids that touch are one: where faces lie on one another to within rounding, there is no sand between them. New
    corners are off by as much then, see GROWN. What of a solid is shown whole keeps its triangles.

    Args:
        solids: Vertices [m], shape (nvert, 3), and outward faces on them, each directed edge with one opposite.

    Raises:
        SurfaceError: One of them is no solid to manifold3d.
    """
    size = float(max(np.ptp(points, axis=0).max() for points, _ in solids))
    least = (1.0 + TOUCHING) * area(_blown_up(solids, GROWN[-1] * size))
    parts = next(found for by in GROWN if area(found := _blown_up(solids, by * size)) <= least)
    return [
        None if part is None else whole if area([part]) > (1.0 - APART) * area([whole]) else _with_area(part, size)
        for part, whole in zip(parts, (points[faces] for points, faces in solids), strict=True)
    ]


def _blown_up(solids: Sequence[tuple[Array, Faces]], by: float) -> list[Array | None]:
    """The triangles of each solid in the union of all, blown up by a distance [m] and put back where they were."""
    if by == 0.0:
        return _union(solids)
    blown = [(_grown(points, faces, by), faces) for points, faces in solids]
    return [
        None if part is None else _put_back(part, far, near)
        for part, (far, _), (near, _) in zip(_union(blown), blown, solids, strict=True)
    ]


def _union(solids: Sequence[tuple[Array, Faces]]) -> list[Array | None]:
    """The triangles of each solid in the union of all, None where there are none; each lies within one face."""
    import manifold3d  # not at start-up, where few models need it

    first = manifold3d.Manifold.reserve_ids(len(solids))
    made = [_solid(manifold3d, points, faces, first + k) for k, (points, faces) in enumerate(solids)]
    whole = manifold3d.Manifold.batch_boolean(made, manifold3d.OpType.Add).to_mesh64()
    corners = np.asarray(whole.vert_properties)[:, :3][np.asarray(whole.tri_verts).astype(np.intp)]
    parts: dict[int, list[Array]] = {}
    ends = np.asarray(whole.run_index).astype(np.intp) // 3
    for owner, start, end in zip(np.asarray(whole.run_original_id).tolist(), ends[:-1], ends[1:], strict=True):
        if end > start:
            parts.setdefault(owner - first, []).append(corners[start:end])
    return [np.concatenate(parts[k]) if k in parts else None for k in range(len(solids))]


def _solid(manifold3d: Any, points: Array, faces: Faces, number: int) -> Any:
    """The solid that faces bound, whose triangles keep their number through a union."""
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(points),
        np.ascontiguousarray(faces.astype(np.uint64)),
        run_index=np.array([0, 3 * len(faces)], dtype=np.uint64),
        run_original_id=np.array([number], dtype=np.uint32),
        face_id=np.arange(len(faces), dtype=np.uint64),
    )
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise SurfaceError(f"a surface of {len(faces)} triangles bounds no solid ({solid.status().name})")
    return solid


def _grown(points: Array, faces: Faces, by: float) -> Array:
    """Vertices moved outward by a distance [m], along the mean normal of their faces."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sums = np.stack([np.bincount(faces.ravel(), np.repeat(normals[:, k], 3), len(points)) for k in range(3)], axis=1)
    outward: Array = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
    return points + by * outward


def _put_back(triangles: Array, far: Array, near: Array) -> Array:
    """Triangles whose corners are no longer at the vertices of a blown-up solid, but at those of the solid itself."""
    known = {place.tobytes(): vertex for vertex, place in enumerate(far)}
    corners = triangles.reshape(-1, 3).copy()
    vertices = np.array([known.get(corner.tobytes(), -1) for corner in corners])
    corners[vertices >= 0] = near[vertices[vertices >= 0]]
    back: Array = corners.reshape(-1, 3, 3)
    return back


def area(parts: Sequence[Array | None]) -> float:
    """The area of some triangles [m^2], (ntri, 3, 3) each."""
    return sum(float(_double_areas(part).sum()) / 2.0 for part in parts if part is not None)


def _double_areas(triangles: Array) -> Any:
    return np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)


def _with_area(triangles: Array, size: float) -> Array | None:
    """The triangles that have an area; None where none has."""
    kept = triangles[_double_areas(triangles) > 2e-14 * size**2]
    return kept if len(kept) else None
