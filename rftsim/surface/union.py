"""Unions of closed surfaces, by manifold3d: faces that lie inside another part of the same solid meet no sand."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from rftsim.errors import SurfaceError
from rftsim.surface.triangles import Array, Surface, welded


def overlapping(surfaces: Sequence[Surface]) -> list[list[int]]:
    """Groups of surfaces, by their numbers, whose boxes overlap with one another's, directly or through others."""
    boxes = [(s.triangles.min(axis=(0, 1)), s.triangles.max(axis=(0, 1))) for s in surfaces]
    groups: list[list[int]] = []
    for number, (low, high) in enumerate(boxes):
        near = [g for g in groups if any((low < boxes[k][1]).all() and (high > boxes[k][0]).all() for k in g)]
        groups = [group for group in groups if group not in near]
        groups.append(sorted([number, *(k for group in near for k in group)]))
    return groups


def united(surfaces: Sequence[Surface]) -> list[Surface | None]:
    """The part of each of several closed surfaces that the union of their solids shows, None where all is inside.

    Args:
        surfaces: Closed, outward, in one frame, without wheels.

    Raises:
        SurfaceError: A surface is no boundary of a solid to manifold3d, as where its faces touch along an edge.
    """
    import manifold3d  # not at start-up, where few models need it

    solids = [_solid(manifold3d, surface) for surface in surfaces]
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    corners = np.asarray(whole.vert_properties)[:, :3][np.asarray(whole.tri_verts).astype(np.intp)]
    parts: dict[int, list[Array]] = {}
    ends = np.asarray(whole.run_index).astype(np.intp) // 3
    for owner, start, end in zip(np.asarray(whole.run_original_id).tolist(), ends[:-1], ends[1:], strict=True):
        parts.setdefault(owner, []).append(corners[start:end])
    return [
        _shown(surface, parts.get(solid.original_id(), [])) for surface, solid in zip(surfaces, solids, strict=True)
    ]


def _solid(manifold3d: Any, surface: Surface) -> Any:
    """The solid that a surface bounds."""
    points, faces = welded(surface.triangles.reshape(-1, 3), np.arange(3 * surface.ntri).reshape(-1, 3))
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(faces.astype(np.uint64)))
    )
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise SurfaceError(f"a surface of {surface.ntri} triangles bounds no solid ({solid.status().name})")
    return solid.as_original()


def _shown(surface: Surface, pieces: list[Array]) -> Surface | None:
    """The surface with other triangles, without those of no area; None where none are left."""
    if not pieces:
        return None
    triangles = np.concatenate(pieces)
    double = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    kept = triangles[double > 2e-14 * surface.size**2]
    return dataclasses.replace(surface, triangles=kept) if len(kept) else None
