"""Rigid shapes, polygons in the x-z plane and closed meshes; and points all over their surfaces."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.distances import mesh_distances, polygon_distances
from rftsim_mpm.errors import MpmError

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Shape:
    """A closed surface about the origin of its own frame."""

    name: str
    """Name of the shape in messages and recordings."""
    vertices: Array
    """Corners, (n, dim) [m]; of a polygon counter-clockwise with x to the right and z up."""
    faces: NDArray[np.int64]
    """Edges (n, 2) of a polygon, outward triangles (n, 3) of a mesh."""

    @property
    def dim(self) -> int:
        """Dimensions of space: 2 for a polygon, 3 for a mesh."""
        return int(self.vertices.shape[1])

    @property
    def radius(self) -> float:
        """Radius of the circle or sphere about the origin that holds the shape [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def normals(self) -> Array:
        """Outward unit normals of the faces, shape (nface, dim)."""
        normals, _ = _faces(self.vertices, self.faces)
        return normals

    @property
    def areas(self) -> Array:
        """Lengths [m] of a polygon's edges or areas [m^2] of a mesh's faces, shape (nface,)."""
        _, areas = _faces(self.vertices, self.faces)
        return areas

    @property
    def content(self) -> float:
        """Area [m^2] or volume [m^3] inside, by the divergence theorem."""
        heights = np.einsum("fd,fd->f", self.vertices[self.faces].mean(axis=1), self.normals)
        return float(heights @ self.areas) / self.dim

    def distances(self, points: Array) -> Array:
        """Return signed distances of points, (n, dim), from the surface, negative inside, infinite far outside [m]."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        near = ((points >= low) & (points <= high)).all(axis=1)
        found = np.full(len(points), np.inf)
        measure = polygon_distances if self.dim == 2 else mesh_distances
        found[near] = measure(np.ascontiguousarray(points[near]), self.vertices[self.faces])
        return found

    def surface(self, spacing: float, inset: float = 0.0) -> "Surface":
        """Return points about a `spacing` [m] apart all over the surface that lies `inset` [m] inside this one."""
        points, areas, face = patches(self.vertices[self.faces], spacing)
        normals = self.normals[face]
        points = points - inset * normals
        keep = self.distances(points) <= -inset * (1.0 - 1e-6) if inset else np.ones(len(points), bool)
        return Surface(*(np.ascontiguousarray(part[keep]) for part in (points, normals, areas)))


class Surface(NamedTuple):
    """Points all over a body's surface, in its own frame."""

    points: Array
    """Places of the points, (n, dim) [m]."""
    normals: Array
    """Outward unit normals at the points, (n, dim)."""
    areas: Array
    """Area of the surface that each point stands for, (n,) [m^2, in the plane m]."""


def patches(faces: Array, size: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Cut edges (n, 2, 2) or triangles (n, 3, 3) into like pieces of about `size` [m].

    Returns:
        Centres of the pieces, their lengths or areas, and for each the number of the face that it is of.
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
        places += _centres(a, b - a, c - a, n)
        areas += [area / n**2] * n**2
        of += [face] * n**2
    return np.array(places), np.array(areas), np.array(of)


def _centres(corner: Array, along: Array, across: Array, n: int) -> list[Array]:
    """Centres of the n^2 like triangles that a triangle with these two sides from a corner is cut into."""
    shares = [
        ((i + third) / n, (j + third) / n)
        for i in range(n)
        for j in range(n - i)
        for third in ((1 / 3, 2 / 3) if j < n - i - 1 else (1 / 3,))
    ]
    return [corner + along * u + across * v for u, v in shares]


def polygon(points: Array, name: str = "polygon") -> Shape:
    """Return a simple polygon of corners (n, 2) in either order.

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
    """Return a closed triangle mesh, its faces turned outward.

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
    """Return a rectangle (x, z) or a cuboid (x, y, z) about its centre [m]."""
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
    """Return a regular polygon of the area of a circle of this radius [m]."""
    if not radius > 0.0:
        raise MpmError(f"radius must be positive, not {radius:g}")
    angle = 2.0 * np.pi * np.arange(sides) / sides
    corner = radius * math.sqrt(2.0 * np.pi / sides / math.sin(2.0 * np.pi / sides))
    return polygon(corner * np.column_stack([np.cos(angle), np.sin(angle)]), "cylinder")


def drum(radius: float, width: float, sides: int = 48) -> Shape:
    """Return a cylinder about the y axis, centred, of the cross-section of a circle of this radius [m].

    Its triangles are about as long as wide, so that points all over it are not more than need be.
    """
    corner = float(np.linalg.norm(disc(radius, sides).vertices[0]))
    side = 2.0 * corner * math.sin(np.pi / sides)
    rings = corner * (1.0 - side / corner) ** np.arange(1, sides // 3)
    ys = np.linspace(-0.5 * width, 0.5 * width, max(2, 1 + round(width / side)))
    cap = [(r, -0.5 * width) for r in rings[::-1]]
    profile = np.array([*cap, *((corner, y) for y in ys), *((r, -y) for r, y in cap[::-1])])
    angles = 2.0 * np.pi * np.arange(sides) / sides
    around = np.column_stack([np.cos(angles), np.zeros(sides), np.sin(angles)])
    vertices = np.concatenate([r * around + [0.0, y, 0.0] for r, y in profile] + [[[0.0, y, 0.0]] for y in ys[[0, -1]]])
    index = np.arange(sides)
    after, last = np.roll(index, -1), sides * (len(profile) - 1)
    strips = [
        part + sides * k
        for k in range(len(profile) - 1)
        for part in (
            np.column_stack([index, index + sides, after]),
            np.column_stack([after, index + sides, after + sides]),
        )
    ]
    ends = [
        np.column_stack([index, after, np.full(sides, len(vertices) - 2)]),
        np.column_stack([after + last, index + last, np.full(sides, len(vertices) - 1)]),
    ]
    return mesh(vertices, np.concatenate([*strips, *ends]), "cylinder")


def extruded(shape: Shape, width: float) -> Shape:
    """Return the solid that a polygon sweeps along y, centred, as wide as given [m]."""
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
    """Return a grousered wheel, by default that of [Agarwal] Table 4.1: a disc with rectangular lugs."""
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
    """Outward unit normals of edges or triangles, and their lengths or areas."""
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
