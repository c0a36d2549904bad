"""Rigid shapes: polygons in the x-z plane and closed meshes: their distances, and points all over them."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Shape:
    """A closed surface about the origin of its own frame."""

    name: str
    vertices: Array
    """Corners, (n, dim) [m]; of a polygon counter-clockwise with x to the right and z up."""
    faces: NDArray[np.int64]
    """Edges (n, 2) of a polygon, outward triangles (n, 3) of a mesh."""

    @property
    def dim(self) -> int:
        """Dimensions of space."""
        return int(self.vertices.shape[1])

    @property
    def radius(self) -> float:
        """Of the circle or sphere about the origin that holds the shape [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def normals(self) -> Array:
        """Outward unit normals of the faces, (nface, dim)."""
        normals, _ = _faces(self.vertices, self.faces)
        return normals

    @property
    def areas(self) -> Array:
        """Lengths [m] of a polygon's edges or areas [m^2] of a mesh's faces, (nface,)."""
        _, areas = _faces(self.vertices, self.faces)
        return areas

    @property
    def content(self) -> float:
        """Area [m^2] or volume [m^3] inside, by the divergence theorem."""
        heights = np.einsum("fd,fd->f", self.vertices[self.faces].mean(axis=1), self.normals)
        return float(heights @ self.areas) / self.dim

    def distances(self, points: Array) -> Array:
        """Signed distances of points, (n, dim), from the surface, negative inside [m]; infinite where far outside."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        near = ((points >= low) & (points <= high)).all(axis=1)
        found = np.full(len(points), np.inf)
        measure = _polygon_distances if self.dim == 2 else _mesh_distances
        found[near] = measure(np.ascontiguousarray(points[near]), self.vertices[self.faces])
        return found

    def surface(self, spacing: float, inset: float = 0.0) -> "Surface":
        """Points about a `spacing` [m] apart all over the surface that lies `inset` [m] inside this one."""
        points, areas, face = patches(self.vertices[self.faces], spacing)
        normals = self.normals[face]
        points = points - inset * normals
        keep = self.distances(points) <= -inset * (1.0 - 1e-6) if inset else np.ones(len(points), bool)
        return Surface(*(np.ascontiguousarray(part[keep]) for part in (points, normals, areas)))


class Surface(NamedTuple):
    """A body's surface as points, in its own frame."""

    points: Array
    """(n, dim) [m]."""
    normals: Array
    """Outward, (n, dim)."""
    areas: Array
    """What each stands for, (n,) [m^2, in the plane m]."""


def patches(faces: Array, size: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Cut edges (n, 2, 2) or triangles (n, 3, 3) into like pieces of about `size` [m].

    Returns:
        Their centres, their lengths or areas, and the faces that they are of.
    """
    places: list[Array] = []
    areas: list[float] = []
    of: list[int] = []
    left = [(corners, face) for face, corners in enumerate(faces)]
    while left:
        corners, face = left.pop()
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        longest = float(sides.max())
        n = max(1, math.ceil(longest / size))
        if len(corners) == 2:
            share = (np.arange(n) + 0.5) / n
            places += list(corners[0] + share[:, None] * (corners[1] - corners[0]))
            areas += [longest / n] * n
            of += [face] * n
            continue
        a, b, c = np.roll(corners, -int(sides.argmax()), axis=0)
        area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a)))
        if n > 1 and longest**2 > 8.0 * area:  # slender: halve it
            left += [(np.array([a, 0.5 * (a + b), c]), face), (np.array([0.5 * (a + b), b, c]), face)]
            continue
        for i in range(n):
            for j in range(n - i):
                places.append(a + (b - a) * ((i + 1 / 3) / n) + (c - a) * ((j + 1 / 3) / n))
                if j < n - i - 1:
                    places.append(a + (b - a) * ((i + 2 / 3) / n) + (c - a) * ((j + 2 / 3) / n))
        areas += [area / n**2] * n**2
        of += [face] * n**2
    return np.array(places), np.array(areas), np.array(of)


def polygon(points: Array, name: str = "polygon") -> Shape:
    """A simple polygon, (n, 2), in either order.

    Raises:
        MpmError: Fewer than three corners, corners that coincide, no area, or edges that cross.
    """
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.isfinite(points).all():
        raise MpmError(f"{name} needs at least three finite corners (x, z), not an array of shape {points.shape}")
    following = np.roll(points, -1, axis=0)
    if (np.linalg.norm(following - points, axis=1) == 0.0).any():
        raise MpmError(f"{name} has two corners in the same place")
    area = 0.5 * float(np.sum(points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]))
    if area == 0.0:
        raise MpmError(f"{name} has no area")
    if area < 0.0:
        points = points[::-1]
    if _crossing(points):
        raise MpmError(f"edges of {name} cross each other")
    index = np.arange(len(points))
    return Shape(name, np.ascontiguousarray(points), np.column_stack([index, np.roll(index, -1)]))


def mesh(vertices: Array, faces: NDArray[np.int64], name: str = "mesh") -> Shape:
    """A closed triangle mesh.

    Raises:
        MpmError: It is not closed.
    """
    import trimesh  # slow to import, and the plane does not need it

    body = trimesh.Trimesh(vertices, faces, process=True)
    if not body.is_watertight:
        raise MpmError(f"{name} is not closed: every edge must have two faces")
    if body.volume < 0.0:
        body.invert()
    return Shape(name, np.array(body.vertices), np.array(body.faces, dtype=np.int64))


def box(*size: float) -> Shape:
    """A rectangle (x, z) or a cuboid (x, y, z) about its centre [m]."""
    if len(size) not in (2, 3) or not all(math.isfinite(s) and s > 0.0 for s in size):
        raise MpmError(f"a box has two or three positive sizes, not {size}")
    half = np.array(size) / 2.0
    if len(size) == 2:
        return polygon(np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half, "plate")
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]], float)
    triangles = []  # eight to a side, about its middle: mirror images of each other
    for axis in range(3):
        for side in (-1.0, 1.0):
            rim = np.insert(ring, axis, side, axis=1) * half
            middle = np.insert(np.zeros(2), axis, side) * half
            triangles += [[middle, a, b] for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True)]
            if (side > 0.0) == (axis == 1):  # outwards
                triangles[-8:] = [part[::-1] for part in triangles[-8:]]
    return mesh(np.reshape(triangles, (-1, 3)), np.arange(3 * len(triangles)).reshape(-1, 3), "plate")


def disc(radius: float, sides: int = 48) -> Shape:
    """A regular polygon of the area of the circle."""
    if not radius > 0.0:
        raise MpmError(f"radius must be positive, not {radius:g}")
    angle = 2.0 * np.pi * np.arange(sides) / sides
    corner = radius * math.sqrt(2.0 * np.pi / sides / math.sin(2.0 * np.pi / sides))
    return polygon(corner * np.column_stack([np.cos(angle), np.sin(angle)]), "cylinder")


def extruded(shape: Shape, width: float) -> Shape:
    """The solid that a polygon sweeps along y, centred [m]."""
    ring = shape.vertices
    caps = _triangulated(ring)
    n = len(ring)
    index = np.arange(n)
    after = np.roll(index, -1)
    # Counter-clockwise with z up and x to the right is seen from -y.
    vertices = np.concatenate([np.insert(ring, 1, y, axis=1) for y in (-width / 2.0, width / 2.0)])
    sides = np.concatenate([np.column_stack([index, after + n, after]), np.column_stack([index, index + n, after + n])])
    return mesh(vertices, np.concatenate([caps, caps[:, ::-1] + n, sides]), shape.name)


def wheel(
    radius: float = 0.094, grousers: int = 20, height: float = 0.012, width: float = 0.006, arc: int = 4
) -> Shape:
    """A grousered wheel, by default that of [Agarwal] Table 4.1: a disc with rectangular lugs."""
    half = math.asin(0.5 * width / radius)
    pitch = 2.0 * math.pi / grousers
    corners = []
    for lug in range(grousers):
        out = np.array([math.cos(lug * pitch), math.sin(lug * pitch)])
        side = np.array([-out[1], out[0]])
        top = (radius + height) * out
        corners += [top - 0.5 * width * side, top + 0.5 * width * side]
        for k in range(arc + 1):
            angle = lug * pitch + half + (pitch - 2.0 * half) * k / arc
            corners.append(radius * np.array([math.cos(angle), math.sin(angle)]))
    return polygon(np.array(corners), "wheel")


def _faces(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, Array]:
    if vertices.shape[1] == 2:
        along = vertices[faces[:, 1]] - vertices[faces[:, 0]]
        across = np.column_stack([along[:, 1], -along[:, 0]])
        length: Array = np.linalg.norm(across, axis=1)
        return across / length[:, None], length
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    return across / length[:, None], 0.5 * length


def _crossing(points: Array) -> bool:
    """Whether two edges that are not neighbours meet."""
    a, b = points, np.roll(points, -1, axis=0)
    n = len(points)

    def side(p: Array, q: Array, r: Array) -> Array:
        found: Array = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )
        return found

    i, j = np.triu_indices(n, 2)
    apart = (j - i) % n != n - 1
    i, j = i[apart], j[apart]
    ends = side(a[i], b[i], a[j]) * side(a[i], b[i], b[j]), side(a[j], b[j], a[i]) * side(a[j], b[j], b[i])
    return bool(((ends[0] < 0.0) & (ends[1] < 0.0)).any())


def _triangulated(ring: Array) -> NDArray[np.int64]:
    """Triangles of a simple counter-clockwise polygon, by cutting off ears."""
    left = list(range(len(ring)))
    triangles = []

    def cross(p: Array, q: Array, r: Array) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            turn = cross(ring[a], ring[b], ring[c])
            others = (ring[i] for i in left if i not in (a, b, c))
            corners = ring[a], ring[b], ring[c]
            if turn >= 0.0 and not any(
                min(cross(corners[e], corners[(e + 1) % 3], point) for e in range(3)) > 0.0 for point in others
            ):
                triangles.append((a, b, c))
                left.pop(k)
                break
        else:
            raise MpmError("the outline cannot be cut into triangles; do its edges touch?")
    return np.array([*triangles, tuple(left)], dtype=np.int64)


@njit(error_model="numpy")
def _segment(px, pz, ax, az, bx, bz):
    """Squared distance of a point from a segment."""
    ux, uz, wx, wz = bx - ax, bz - az, px - ax, pz - az
    t = min(max((wx * ux + wz * uz) / (ux * ux + uz * uz), 0.0), 1.0)
    return (wx - t * ux) ** 2 + (wz - t * uz) ** 2


@njit(error_model="numpy", cache=True)
def _polygon_distances(points, edges):
    """Signed distances of points, (n, 2), from a polygon's edges, (m, 2, 2); the sign by counting crossings."""
    found = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        px, pz = points[p, 0], points[p, 1]
        best, inside = np.inf, False
        for e in range(edges.shape[0]):
            ax, az, bx, bz = edges[e, 0, 0], edges[e, 0, 1], edges[e, 1, 0], edges[e, 1, 1]
            best = min(best, _segment(px, pz, ax, az, bx, bz))
            if (az > pz) != (bz > pz) and px < ax + (pz - az) / (bz - az) * (bx - ax):
                inside = not inside
        found[p] = -np.sqrt(best) if inside else np.sqrt(best)
    return found


@njit(error_model="numpy")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(error_model="numpy")
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(error_model="numpy")
def _to_edge(w, u):
    """Squared distance of a point, w from one end, from a segment u."""
    t = min(max(_dot(w, u) / _dot(u, u), 0.0), 1.0)
    r = w[0] - t * u[0], w[1] - t * u[1], w[2] - t * u[2]
    return _dot(r, r)


@njit(error_model="numpy", cache=True)
def _mesh_distances(points, triangles):
    """Signed distances of points, (n, 3), from a closed mesh, (m, 3, 3); the sign by the solid angle about each."""
    found = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        best, angle = np.inf, 0.0
        for t in range(triangles.shape[0]):
            a = (
                triangles[t, 0, 0] - points[p, 0],
                triangles[t, 0, 1] - points[p, 1],
                triangles[t, 0, 2] - points[p, 2],
            )
            b = (
                triangles[t, 1, 0] - points[p, 0],
                triangles[t, 1, 1] - points[p, 1],
                triangles[t, 1, 2] - points[p, 2],
            )
            c = (
                triangles[t, 2, 0] - points[p, 0],
                triangles[t, 2, 1] - points[p, 1],
                triangles[t, 2, 2] - points[p, 2],
            )
            ab, bc, ca = _minus(b, a), _minus(c, b), _minus(a, c)
            n = ab[1] * -ca[2] + ab[2] * ca[1], ab[2] * -ca[0] + ab[0] * ca[2], ab[0] * -ca[1] + ab[1] * ca[0]
            n2 = _dot(n, n)
            height = _dot(a, n)
            foot = (height / n2 * n[0], height / n2 * n[1], height / n2 * n[2])
            over = True
            for edge, start in ((ab, a), (bc, b), (ca, c)):
                w = _minus(foot, start)
                turn = (
                    edge[1] * w[2] - edge[2] * w[1],
                    edge[2] * w[0] - edge[0] * w[2],
                    edge[0] * w[1] - edge[1] * w[0],
                )
                over = over and _dot(turn, n) >= 0.0
            if over:
                best = min(best, height * height / n2)
            else:
                for edge, start in ((ab, a), (bc, b), (ca, c)):
                    best = min(best, _to_edge((-start[0], -start[1], -start[2]), edge))
            la, lb, lc = np.sqrt(_dot(a, a)), np.sqrt(_dot(b, b)), np.sqrt(_dot(c, c))
            angle += 2.0 * np.arctan2(height, la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb)
        found[p] = -np.sqrt(best) if abs(angle) > 2.0 * np.pi else np.sqrt(best)
    return found
