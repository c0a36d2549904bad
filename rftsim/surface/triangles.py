"""The surface of a body as the sand sees it: triangles, checked closed and outward."""

import dataclasses
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rftsim.errors import SurfaceError
from rftsim.files import check_size
from rftsim.surface.clusters import clustered
from rftsim.surface.shells import outer, wound
from rftsim.surface.splitting import split
from rftsim.surface.topology import Array as Array
from rftsim.surface.topology import Faces, needed, open_face, welded

EDGE_ON_DOUBLE: Final = 1e-9
"""Leading-edge tolerance on n.v_hat [-]: rounding of normals computed in double precision."""
EDGE_ON_SINGLE: Final = 1e-6
"""Leading-edge tolerance on n.v_hat [-]: rounding of normals from MuJoCo's single precision."""

LARGEST_FILE: Final = 64_000_000
"""Size of a mesh's file that is still read [byte]: binary STL of a million triangles."""
FARTHEST: Final = 1e6
"""Largest coordinate of a mesh's file [m]."""
LARGEST: Final = 20.0
"""Size of a body above which its mesh is suspected to be in other units [m]."""
SMALLEST: Final = 1e-3
"""Size of a body below which its mesh is suspected to be in other units [m]."""


@dataclasses.dataclass(frozen=True)
class Wheel:
    """The measures of a driven wheel that the structural term needs, in the body frame."""

    axis: tuple[float, float, float]
    """Axis of rotation, made a unit vector; positive spin about it rolls the wheel along axis x up."""
    centre: tuple[float, float, float]
    """A point on the axis [m]."""
    radius: float
    """Outer radius r of delta h = r (r omega^2 / g) [m]."""

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.axis))
        if not (0.0 < length < np.inf and 0.0 < self.radius < np.inf and np.isfinite(self.centre).all()):
            raise ValueError(f"a wheel needs an axis and a positive radius, not {self.axis} and {self.radius}")
        object.__setattr__(self, "axis", tuple(float(a) / length for a in self.axis))


@dataclasses.dataclass(frozen=True)
class Surface:
    """The triangles of a body that the sand can press on, in the body frame."""

    triangles: Array
    """Corners [m], shape (ntri, 3, 3), counter-clockwise seen from outside."""
    edge_on: float = EDGE_ON_DOUBLE
    """Leading-edge tolerance: n.v_hat down to minus this counts as leading [-]."""
    wheel: Wheel | None = None
    """Measures of the wheel where the body is one to the structural term."""
    notes: tuple[str, ...] = ()
    """Sentences that say what was found and repaired."""
    outline: Array | None = None
    """Where the triangles stand for others, corners of those [m], shape (npoint, 3)."""
    centres: Array = dataclasses.field(init=False)
    """Centroids [m], shape (ntri, 3)."""
    normals: Array = dataclasses.field(init=False)
    """Outward unit normals, shape (ntri, 3)."""
    areas: Array = dataclasses.field(init=False)
    """Areas [m^2], shape (ntri,)."""

    def __post_init__(self) -> None:
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        cross = np.cross(b - a, c - a)
        double = np.linalg.norm(cross, axis=1)
        object.__setattr__(self, "centres", (a + b + c) / 3.0)
        object.__setattr__(self, "normals", cross / double[:, None])
        object.__setattr__(self, "areas", double / 2.0)

    @property
    def ntri(self) -> int:
        """The number of triangles of the surface."""
        return len(self.areas)

    @property
    def corners(self) -> Array:
        """The points that span the body [m], shape (npoint, 3)."""
        return self.triangles.reshape(-1, 3) if self.outline is None else self.outline

    @property
    def size(self) -> float:
        """The largest extent of the body along an axis [m]."""
        return float(np.ptp(self.corners, axis=0).max())

    def moved(self, rotation: ArrayLike, translation: ArrayLike) -> "Surface":
        """The surface after the motion x -> rotation x + translation [m]."""
        r, t = np.asarray(rotation), np.asarray(translation)
        wheel = self.wheel
        if wheel is not None:
            wheel = Wheel(tuple((r @ wheel.axis).tolist()), tuple((r @ wheel.centre + t).tolist()), wheel.radius)
        outline = None if self.outline is None else self.outline @ r.T + t
        return dataclasses.replace(self, triangles=self.triangles @ r.T + t, wheel=wheel, outline=outline)

    def clustered(self, size: int) -> "Surface":
        """The surface with its triangles in an order where each `size` of them lie close together."""
        return dataclasses.replace(self, triangles=self.triangles[clustered(self.centres, size)])

    def refined(self, max_edge: float) -> "Surface":
        """The surface with its triangles split until no edge exceeds max_edge [m]."""
        if not max_edge > 0.0:
            raise ValueError(f"max_edge must be positive, not {max_edge:g}")
        return dataclasses.replace(self, triangles=split(self.triangles, max_edge))


def joined(surfaces: "list[Surface]") -> Surface:
    """The surfaces of the parts of a body as one surface, not of a wheel."""
    return Surface(
        triangles=np.concatenate([s.triangles for s in surfaces]),
        edge_on=max(s.edge_on for s in surfaces),
        notes=tuple(note for s in surfaces for note in s.notes),
    )


def make_surface(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    name: str = "mesh",
    allow_open: bool = False,
    edge_on: float = EDGE_ON_DOUBLE,
) -> Surface:
    """A checked surface from vertices and faces.

    Faces of no area and repeated faces are dropped, inconsistent or inward winding is turned; each is noted.

    Args:
        vertices: Places of the vertices [m], shape (nvert, 3).
        faces: Numbers of each face's vertices, shape (nface, 3).
        name: Name of the mesh in messages.
        allow_open: Whether a surface that is not closed is accepted.
        edge_on: Leading-edge tolerance of its triangles on n.v_hat [-].

    Raises:
        SurfaceError: No faces, a vertex that is not finite, or a surface that is not closed (unless allow_open).
    """
    points = np.asarray(vertices, dtype=float).reshape(-1, 3)
    corners = np.asarray(faces, dtype=int).reshape(-1, 3)
    _check_faces(points, corners, name)
    notes: list[str] = []
    points, corners = welded(points, corners)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    areas = np.linalg.norm(np.cross(*_edges(points[corners])), axis=1) / 2.0
    corners = _kept(corners, areas > 1e-14 * extent**2, f"{name}: dropped %d faces of no area", notes)
    if not len(corners):
        raise SurfaceError(f"{name} has no face with an area; the sand needs a closed triangle mesh")
    corners = _kept(corners, needed(corners), f"{name}: dropped %d repeated faces", notes)
    corners, is_turned = wound(points, corners)
    gap = open_face(corners)
    if gap is not None:
        near = _point(points[corners[gap]].mean(axis=0))
        text = f"{name} is open at face {gap} of {len(corners)}, near {near}"
        if not allow_open:
            raise SurfaceError(f"{text}: close it, or allow open meshes (then only its outer side is felt)")
        notes.append(text)
    triangles, found = outer(points, corners, is_turned, name)
    doubts = _size_doubts(float(np.ptp(points, axis=0).max()), name)
    return Surface(triangles, edge_on=edge_on, notes=(*notes, *found, *doubts))


def _check_faces(points: Array, faces: Faces, name: str) -> None:
    """Refuse a mesh without faces, or whose faces have vertices that do not exist or are not finite."""
    if not len(faces):
        raise SurfaceError(f"{name} has no faces; the sand needs a closed triangle mesh")
    if faces.min() < 0 or faces.max() >= len(points):
        wrong = faces.min() if faces.min() < 0 else faces.max()
        raise SurfaceError(f"{name}: a face refers to vertex {wrong}; vertices are 0 to {len(points) - 1}")
    bad = ~np.isfinite(points[faces]).all(axis=(1, 2))
    if bad.any():
        raise SurfaceError(f"{name}: face {int(np.argmax(bad))} has a vertex that is not finite")


def _size_doubts(size: float, name: str) -> list[str]:
    """The doubt about a size that suggests other units, if it does."""
    if SMALLEST <= size <= LARGEST:
        return []
    remedy = f": a mesh in millimetres needs scale 0.001 ({size / 1000:g} m)" if size > LARGEST else ""
    return [f"{name} is {size:g} m in size; lengths are in metres{remedy}"]


def load_surface(path: "str | Path", *, scale: float = 1.0, allow_open: bool = False) -> Surface:
    """A checked surface from a mesh file of any kind that trimesh reads.

    Args:
        path: The file.
        scale: Metres to the unit of the file's lengths, 0.001 for millimetres.
        allow_open: Whether a surface that is not closed is accepted.

    Raises:
        RftsimError: The file is too large, or packed by gzip, bzip2 or xz.
        SurfaceError: The file is missing, is not a mesh, or does not bound a body.
    """
    path = Path(path)
    if not path.is_file():
        raise SurfaceError(f"no mesh file {path}")
    if not (np.isfinite(scale) and scale > 0.0):
        raise SurfaceError(f"the mesh scale must be positive, not {scale:g}")
    check_size(path, LARGEST_FILE)
    import trimesh  # not at start-up, which it would slow by a second

    try:
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh's readers raise whatever their parsers raise
        raise SurfaceError(f"cannot read the mesh {path}: {type(error).__name__}: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise SurfaceError(f"{path} holds no triangle mesh")
    vertices = mesh.vertices * scale
    farthest = float(np.max(np.abs(vertices), initial=0.0, where=np.isfinite(vertices)))
    if farthest > FARTHEST:
        raise SurfaceError(f"{path.name} has a vertex {farthest:g} m from its origin; lengths are in metres")
    return make_surface(vertices, mesh.faces, name=path.name, allow_open=allow_open)


def _point(x: ArrayLike) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.asarray(x)) + ")"


def _kept(faces: Faces, keep: NDArray[np.bool_], note: str, notes: list[str]) -> Faces:
    if not keep.all():
        notes.append(note % np.count_nonzero(~keep))
    return faces[keep]


def _edges(triangles: Array) -> tuple[Array, Array]:
    return triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
