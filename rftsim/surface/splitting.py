"""Triangles into smaller ones, (ntri, 3, 3), without gaps between neighbours."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def split(triangles: Array, max_edge: float) -> Array:
    """The triangles after edges longer than max_edge [m] were halved, and the halves again; the others stay.

    The same as trimesh's `subdivide_to_size`, triangle by triangle.
    """
    while (is_long := _lengths2(triangles) > max_edge**2).any():
        triangles = _halved(triangles, is_long)
    return triangles


def quartered(triangles: Array) -> Array:
    """Each triangle as four, between its corners and the middles of its edges, (4 ntri, 3, 3)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
    return _together((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))


def _halved(triangles: Array, is_long: NDArray[np.bool_]) -> Array:
    """Each marked edge, (ntri, 3), halved once; of triangles with two, the rest is cut along its shorter diagonal."""
    none, one, two, three = (is_long.sum(axis=1) == count for count in range(4))
    a, b, c = _starting_at(triangles[one], np.argmax(is_long[one], axis=1))
    ab = (a + b) / 2.0
    halves = _together((a, ab, c), (ab, b, c))
    a, b, c = _starting_at(triangles[two], np.argmin(is_long[two], axis=1) + 1)
    ab, bc = (a + b) / 2.0, (b + c) / 2.0
    from_a = (((a - bc) ** 2).sum(axis=1) <= ((ab - c) ** 2).sum(axis=1))[:, None]
    thirds = [(ab, b, bc), (a, ab, np.where(from_a, bc, c)), (np.where(from_a, a, ab), bc, c)]
    return np.concatenate(
        [triangles[none], halves, *(_together(third) for third in thirds), quartered(triangles[three])]
    )


def _lengths2(triangles: Array) -> Array:
    """Squares of the lengths of the edges from each corner to the next, (ntri, 3)."""
    squares: Array = (np.diff(triangles, axis=1, append=triangles[:, :1]) ** 2).sum(axis=2)
    return squares


def _starting_at(triangles: Array, corner: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """The corners of each triangle from one of them on, (ntri, 3) each."""
    row = np.arange(len(triangles))
    a, b, c = (triangles[row, (corner + k) % 3] for k in range(3))
    return a, b, c


def _together(*triangles: tuple[Array, Array, Array]) -> Array:
    """Several triangles in place of each, one after another."""
    return np.stack([corner for triangle in triangles for corner in triangle], axis=1).reshape(-1, 3, 3)
