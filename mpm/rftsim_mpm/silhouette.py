"""Shapes from files: meshes, and the outline of what is dark, or opaque, in a PNG."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.output import check_size
from rftsim_mpm.shapes import Shape, mesh, polygon

Array = NDArray[np.float64]

LARGEST = 64_000_000
"""Size of a mesh's file that is still read [byte]: binary STL of a million triangles."""


def load_shape(path: Path, *, scale: float = 1.0) -> Shape:
    """Return a file's mesh (STL, OBJ, PLY, ...) times `scale`, or a PNG's silhouette, as wide as `scale` [m]."""
    if not path.is_file():
        raise MpmError(f"no file {path}")
    if path.suffix.lower() == ".png":
        return silhouette(path, width=scale)
    body = read_mesh(path)
    return mesh(np.array(body.vertices) * scale, np.array(body.faces), path.name)


def read_mesh(path: Path) -> Any:
    """Return the triangles of a file as trimesh has them, closed or not.

    Raises:
        MpmError: There is no such file, or no mesh in it.
    """
    import trimesh  # slow to import, and pictures do not need it

    if not path.is_file():
        raise MpmError(f"no file {path}")
    check_size(path, LARGEST)
    try:
        found = trimesh.load_mesh(path)
    except Exception as error:  # trimesh's readers raise whatever their parsers raise
        raise MpmError(f"cannot read a mesh from {path}: {type(error).__name__}: {error}") from error
    if not isinstance(found, trimesh.Trimesh) or not len(found.faces):
        raise MpmError(f"{path} holds no triangle mesh")
    if not np.isfinite(found.vertices).all():
        raise MpmError(f"{path} has a vertex that is not finite")
    return found


def silhouette(path: Path, *, width: float, tolerance: float = 1.5) -> Shape:
    """Return the one figure in a PNG as a polygon about its centroid.

    Args:
        path: The picture; the figure is what is opaque or, without transparency, what is darker than half.
        width: Extent of the figure from left to right [m].
        tolerance: How far corners may be left out of the outline [pixels].

    Raises:
        MpmError: There is no picture, or not one figure without holes in it.
    """
    import matplotlib.image  # an extra

    if not width > 0.0:
        raise MpmError(f"width must be positive, not {width:g}")
    try:
        picture = np.asarray(matplotlib.image.imread(path), float)
    except (OSError, SyntaxError, ValueError) as error:
        raise MpmError(f"cannot read a picture from {path}: {error}") from error
    dark = picture if picture.ndim == 2 else picture[..., : min(3, picture.shape[2])].mean(axis=2)
    clear = picture.ndim == 3 and picture.shape[2] == 4 and picture[..., 3].min() < 0.5
    figure = np.pad(picture[..., 3] >= 0.5 if clear else dark < 0.5 * (dark.max() if dark.max() > 1.0 else 1.0), 1)
    if not figure.any():
        raise MpmError(f"{path} shows nothing dark or opaque")
    loops = _outlines(figure)
    if len(loops) != 1:
        raise MpmError(f"{path} must show one figure without holes; it has {len(loops)} outlines")
    corners = _simplified(loops[0], tolerance)
    corners = np.column_stack([corners[:, 1], -corners[:, 0]])
    corners *= width / np.ptp(corners[:, 0])
    return polygon(corners - _centroid(corners), path.name)


def _outlines(figure: NDArray[np.bool_]) -> list[Array]:
    """Closed loops along the pixels' edges, (n, 2) rows and columns, the figure on the same side of each step."""
    steps: dict[tuple[int, int], list[tuple[int, int]]] = {}
    rows, columns = np.nonzero(figure)
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        around = (
            (figure[r - 1, c], (r, c), (r, c + 1)),
            (figure[r, c + 1], (r, c + 1), (r + 1, c + 1)),
            (figure[r + 1, c], (r + 1, c + 1), (r + 1, c)),
            (figure[r, c - 1], (r + 1, c), (r, c)),
        )
        for filled, start, end in around:
            if not filled:
                steps.setdefault(start, []).append(end)
    loops = []
    while steps:
        here = start = next(iter(steps))
        loop, came = [start], (0, 0)
        while True:
            ends = steps[here]
            # Where two pixels touch at a corner, turn right: they count as apart.
            end = min(ends, key=lambda e, h=here, c=came: c[0] * (e[1] - h[1]) - c[1] * (e[0] - h[0]))  # type: ignore[misc]
            ends.remove(end)
            if not ends:
                del steps[here]
            came, here = (end[0] - here[0], end[1] - here[1]), end
            if here == start:
                break
            loop.append(here)
        loops.append(np.array(loop, float))
    return loops


def _simplified(loop: Array, tolerance: float) -> Array:
    """Douglas and Peucker's choice of corners of a closed loop, from the two that are farthest apart."""
    first = int(np.argmax(np.linalg.norm(loop - loop.mean(axis=0), axis=1)))
    loop = np.roll(loop, -first, axis=0)
    far = int(np.argmax(np.linalg.norm(loop - loop[0], axis=1)))
    closed = np.vstack([loop, loop[:1]])
    keep = np.zeros(len(closed), bool)
    keep[[0, far]] = True
    pieces = [(0, far), (far, len(closed) - 1)]
    while pieces:
        a, b = pieces.pop()
        if b - a < 2:
            continue
        along = closed[b] - closed[a]
        inner = closed[a + 1 : b] - closed[a]
        distance = np.abs(along[0] * inner[:, 1] - along[1] * inner[:, 0]) / np.linalg.norm(along)
        worst = int(np.argmax(distance))
        if distance[worst] > tolerance:
            keep[a + 1 + worst] = True
            pieces += [(a, a + 1 + worst), (a + 1 + worst, b)]
    found: Array = closed[:-1][keep[:-1]]
    return found


def _centroid(corners: Array) -> Array:
    """Centroid of the area of a polygon, (2,)."""
    after = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
    found: Array = ((corners + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    return found
