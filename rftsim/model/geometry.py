"""Surfaces of a MuJoCo model's geoms: primitives, convex hulls of meshes, or the meshes themselves, as triangles."""

from typing import Any, Final, Literal, NamedTuple

import mujoco
import numpy as np

from rftsim.errors import SceneError, SurfaceError
from rftsim.model.draft import TEMPORARY
from rftsim.surface import solids
from rftsim.surface.topology import Array, Faces, is_closed
from rftsim.surface.triangles import EDGE_ON_SINGLE, Surface, make_surface

Meshes = Literal["hull", "exact"]
"""How the meshes of geoms are felt: as the convex hulls that MuJoCo collides with, or as they are where closed."""
MESHES: Final[tuple[Meshes, ...]] = ("hull", "exact")
Geoms = Literal["collision", "all"]
"""Which geoms bound a body: those that can collide, or, where a body has none of these, all that it has."""

_GEOM = mujoco.mjtGeom
LARGER: Final = 1.25
"""Volume of a hull over that of its mesh from which on the difference is said."""


class Part(NamedTuple):
    """A geom's surface in its body's frame."""

    geom: int
    """The geom's id."""
    surface: Surface
    """Its triangles, closed."""
    hull: bool
    """Whether they are the convex hull of a mesh."""
    excess: float
    """Volume of the hull over that of the mesh, NaN where the mesh is open, 1 where there is no hull [-]."""


def colliding(model: mujoco.MjModel) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Whether each geom can collide with anything at all, by its bits or by a contact pair, shape (ngeom,)."""
    can = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    can[model.pair_geom1] = can[model.pair_geom2] = True
    return can  # type: ignore[no-any-return]


def own_geoms(model: mujoco.MjModel, body: int) -> range:
    """The ids of all geoms of a body."""
    first = int(model.body_geomadr[body])
    return range(first, first + int(model.body_geomnum[body]))


def bounding_geoms(model: mujoco.MjModel, body: int, geoms: Geoms) -> list[int]:
    """The ids of the geoms that bound a body."""
    can, own = colliding(model), own_geoms(model, body)
    return [geom for geom in own if can[geom]] or (list(own) if geoms == "all" else [])


def geom_label(model: mujoco.MjModel, geom: int) -> str:
    """The words by which messages name a geom of a compiled model or draft."""
    body = model.body(model.geom_bodyid[geom]).name
    name = model.geom(geom).name.partition(TEMPORARY)[0]
    return f"geom {name or geom} of body {body or model.geom_bodyid[geom]}"


def geom_triangles(model: mujoco.MjModel, geom: int) -> tuple[Array, Faces]:
    """Vertices [m], shape (nvert, 3), and faces, shape (nface, 3), of a geom in its own frame.

    Raises:
        SceneError: The geom has no bounded surface: planes, height fields and distance fields.
    """
    kind = _GEOM(model.geom_type[geom])
    if kind == _GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        return (
            model.mesh_vert[vertices : vertices + model.mesh_vertnum[mesh]].astype(float),
            model.mesh_face[faces : faces + model.mesh_facenum[mesh]],
        )
    return _primitive(kind, model.geom_size[geom], geom_label(model, geom))


def geom_part(model: mujoco.MjModel, geom: int, as_hull: bool) -> Part:
    """The surface of a geom, where a mesh is taken as its convex hull if so asked, or if it is open.

    Raises:
        SurfaceError: A mesh does not bound a body, nor does its hull.
        SceneError: The geom has no surface that the sand could press on.
    """
    label, hull, excess = geom_label(model, geom), False, 1.0
    vertices, faces = geom_triangles(model, geom)
    if model.geom_type[geom] != int(_GEOM.mjGEOM_MESH):
        surface: Surface | None = make_surface(vertices, faces, name=label, edge_on=EDGE_ON_SINGLE)
    else:
        mesh = int(model.geom_dataid[geom])
        label += f" (mesh {model.mesh(mesh).name})"
        surface = None if as_hull else _closed(vertices, faces, label)
        hull = surface is None
    if surface is None:
        corners = hull_triangles(model, mesh)
        surface = make_surface(*_faces(corners), name=label, edge_on=EDGE_ON_SINGLE)
        excess = _excess(solids.volume(surface.triangles), vertices, faces)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return Part(geom, surface.moved(rotation.reshape(3, 3), model.geom_pos[geom]), hull, excess)


def _excess(hull: float, vertices: Array, faces: Faces) -> float:
    """Volume of a hull [m^3] over that of its mesh [-]; NaN where the mesh is so open that it matters."""
    inside = abs(solids.volume(vertices[faces]))
    if hull < LARGER * inside:
        return hull / inside
    return hull / inside if inside > 0.0 and is_closed(faces) else float("nan")


def _closed(vertices: Array, faces: Faces, label: str) -> Surface | None:
    """The surface of a mesh as it is; None where it bounds no body."""
    try:
        return make_surface(vertices, faces, name=label, edge_on=EDGE_ON_SINGLE)
    except SurfaceError:
        return None


def hull_triangles(model: mujoco.MjModel, mesh: int) -> Array:
    """The convex hull of a mesh, as MuJoCo collides with it where it made one [m], outward, shape (nface, 3, 3).

    Raises:
        SurfaceError: The mesh is flat.
    """
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(float)
    start = int(model.mesh_graphadr[mesh])
    if start < 0:
        return _convex_hull(vertices, model.mesh(mesh).name)
    nvert, nface = model.mesh_graph[start : start + 2].tolist()
    first = start + 2 + 2 * nvert + nvert + 3 * nface  # two counts, edge addresses, vertex ids, edges, and then faces
    corners: Array = vertices[model.mesh_graph[first : first + 3 * nface].reshape(-1, 3)]
    a, b, c = np.moveaxis(corners, 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - corners.mean(axis=(0, 1))) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return corners


def _convex_hull(vertices: Array, name: str) -> Array:
    """Triangles of the convex hull of vertices, shape (nface, 3, 3)."""
    import manifold3d  # not at start-up, where few models need it

    hull = manifold3d.Manifold.hull_points(np.ascontiguousarray(vertices))
    if not hull.volume() > 1e-9 * float(np.ptp(vertices, axis=0).max()) ** 3:
        raise SurfaceError(f"mesh {name} is flat, so that its hull bounds no body: give it a thickness")
    mesh = hull.to_mesh64()
    corners: Array = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts).astype(np.intp)]
    return corners


def _primitive(kind: mujoco.mjtGeom, size: Array, label: str) -> tuple[Array, Faces]:
    """Tessellation of a primitive; round ones have their true volume."""
    if kind == _GEOM.mjGEOM_BOX:
        return _faces(solids.box(2 * size))
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID):
        return _faces(solids.round_ball(size if kind == _GEOM.mjGEOM_ELLIPSOID else np.full(3, size[0]), 2))
    if kind == _GEOM.mjGEOM_CYLINDER:
        return _faces(solids.round_cylinder(size[0], 2 * size[1], solids.SECTIONS))
    if kind == _GEOM.mjGEOM_CAPSULE:
        return _faces(solids.round_capsule(size[0], 2 * size[1], solids.SECTIONS // 2, solids.SECTIONS))
    raise SceneError(f"{label} is of type {kind.name[len('mjGEOM_') :].lower()}, which has no surface for the sand")


def _faces(triangles: Array) -> tuple[Array, Faces]:
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
