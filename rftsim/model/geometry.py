"""Surfaces of a MuJoCo model's bodies: their geoms as checked triangles."""

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.model.draft import TEMPORARY
from rftsim.surface import solids
from rftsim.surface.triangles import EDGE_ON_SINGLE, Array, Faces, Surface, joined, make_surface

_GEOM = mujoco.mjtGeom
_SECTIONS = 24
FINENESS = 6
"""Edges of a geom's triangles are at most its size over this, unless the caller says otherwise."""


def body_surface(
    model: mujoco.MjModel, body: int, *, collision_only: bool, max_edge: float | None, allow_open: bool
) -> Surface | None:
    """The surface of a body's geoms in the body frame, or None where it has none.

    Args:
        model: A compiled model.
        body: The body's id.
        collision_only: Leave out geoms that collide with nothing.
        max_edge: Longest edge of a triangle [m]; None for a sixth of each geom's size.
        allow_open: Accept meshes that are not closed.

    Raises:
        SurfaceError: A mesh does not bound a body.
        SceneError: A geom has no surface that the sand could press on.
    """
    surfaces = []
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        if collision_only and not is_colliding(model, geom):
            continue
        surface = _geom_surface(model, geom, allow_open)
        surfaces.append(surface.refined(surface.size / FINENESS if max_edge is None else max_edge))
    return joined(surfaces) if surfaces else None


def is_colliding(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom can collide with anything at all."""
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


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


def _geom_surface(model: mujoco.MjModel, geom: int, allow_open: bool) -> Surface:
    label = geom_label(model, geom)
    if model.geom_type[geom] == int(_GEOM.mjGEOM_MESH):
        label += f" (mesh {model.mesh(model.geom_dataid[geom]).name})"
    vertices, faces = geom_triangles(model, geom)
    surface = make_surface(vertices, faces, name=label, allow_open=allow_open, edge_on=EDGE_ON_SINGLE)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return surface.moved(rotation.reshape(3, 3), model.geom_pos[geom])


def _primitive(kind: mujoco.mjtGeom, size: Array, label: str) -> tuple[Array, Faces]:
    """Tessellation of a primitive; round ones are blown up to their exact volume."""
    if kind == _GEOM.mjGEOM_BOX:
        return _faces(solids.box(2 * size))
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID):
        ball = solids.ball(2)
        radii = size if kind == _GEOM.mjGEOM_ELLIPSOID else np.full(3, size[0])
        return _faces(ball * radii * (4 * np.pi / 3 / solids.volume(ball)) ** (1 / 3))
    if kind == _GEOM.mjGEOM_CYLINDER:
        round_ = solids.cylinder(size[0], 2 * size[1], _SECTIONS)
        volume = 2 * np.pi * size[0] ** 2 * size[1]
    elif kind == _GEOM.mjGEOM_CAPSULE:
        round_ = solids.capsule(size[0], 2 * size[1], _SECTIONS // 2, _SECTIONS)
        volume = np.pi * size[0] ** 2 * (2 * size[1] + 4 / 3 * size[0])
    else:
        raise SceneError(f"{label} is of type {kind.name[len('mjGEOM_') :].lower()}, which has no surface for the sand")
    widen = np.sqrt(volume / solids.volume(round_))
    return _faces(round_ * [widen, widen, 1.0])


def _faces(triangles: Array) -> tuple[Array, Faces]:
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
