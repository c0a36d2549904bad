"""Closed outlines in the x-z plane, and the solids that they extrude to."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]


def lugged_outline(radius: float, lugs: int, height: float, width: float, *, arc: int, flank: int, top: int) -> Array:
    """Outline of a disc with rectangular lugs, (n, 2), counter-clockwise seen from -y (x right, z up).

    Args:
        radius: Radius of the disc [m].
        lugs: Number of lugs, evenly spaced.
        height: Radial height of a lug above the disc [m]; zero for a plain disc.
        width: Width of a lug [m].
        arc: Segments of the disc between two lugs.
        flank: Segments of a lug's side.
        top: Segments of a lug's outer end.
    """
    half = math.asin(width / 2 / radius)
    pitch = 2 * math.pi / lugs
    foot = radius * math.cos(half)
    points: list[tuple[float, float]] = []
    for lug in range(lugs):
        centre = lug * pitch
        out = np.array([math.cos(centre), math.sin(centre)])
        side = np.array([-out[1], out[0]])
        corners = [(foot, -1.0), (radius + height, -1.0), (radius + height, 1.0), (foot, 1.0)]
        for (r0, s0), (r1, s1), n in zip(corners[:-1], corners[1:], (flank, top, flank), strict=True):
            for k in range(n):
                r, s = r0 + (r1 - r0) * k / n, s0 + (s1 - s0) * k / n
                points.append(tuple(r * out + s * width / 2 * side))
        start, end = centre + half, centre + pitch - half
        for k in range(arc):
            angle = start + (end - start) * k / arc
            points.append((radius * math.cos(angle), radius * math.sin(angle)))
    return np.array(points)


def extruded(outline: Array, width: float, *, rings: int = 1, strips: int = 1) -> tuple[Array, Faces]:
    """The solid that an outline, star-shaped about the origin, sweeps along y: vertices and outward faces.

    Args:
        outline: Its corners in x and z [m], (n, 2), counter-clockwise seen from -y.
        width: Extent along y, centred [m].
        rings: Rings of triangles in each of the two side faces.
        strips: Strips of triangles across the width.
    """
    n = len(outline)
    vertices: list[Array] = []
    faces: list[tuple[int, int, int]] = []
    y = np.linspace(-width / 2, width / 2, strips + 1)
    for level in y:
        vertices.append(np.column_stack([outline[:, 0], np.full(n, level), outline[:, 1]]))
    for strip in range(strips):
        faces += _band(strip * n, (strip + 1) * n, n)
    for level, first, outward in ((y[0], 0, False), (y[-1], strips * n, True)):
        outer = first
        for ring in range(1, rings):
            scale = 1.0 - ring / rings
            inner = sum(map(len, vertices))
            vertices.append(np.column_stack([scale * outline[:, 0], np.full(n, level), scale * outline[:, 1]]))
            faces += [face if outward else face[::-1] for face in _band(outer, inner, n)]
            outer = inner
        hub = sum(map(len, vertices))
        vertices.append(np.array([[0.0, level, 0.0]]))
        for k in range(n):
            a, b = outer + k, outer + (k + 1) % n
            faces.append((b, a, hub) if outward else (a, b, hub))
    return np.concatenate(vertices), np.array(faces)


def _band(first: int, second: int, n: int) -> list[tuple[int, int, int]]:
    """Triangles between two rings of n vertices."""
    faces = []
    for k in range(n):
        a, b = first + k, first + (k + 1) % n
        c, d = second + (k + 1) % n, second + k
        faces += [(a, c, b), (a, d, c)]
    return faces


def lofted(rings: Array) -> tuple[Array, Faces]:
    """The solid between rings of points, one after another, closed by a fan at each end: vertices and outward faces.

    Args:
        rings: Their points [m], (nring, npoint, 3); the first of each ring follows the first of the one before.
    """
    count, n, _ = rings.shape
    hubs = rings[[0, -1]].mean(axis=1)
    vertices = np.concatenate([rings.reshape(-1, 3), hubs])
    faces = [face for ring in range(count - 1) for face in _band(ring * n, (ring + 1) * n, n)]
    last = (count - 1) * n
    for k in range(n):
        after = (k + 1) % n
        faces += [(k, after, count * n), (last + after, last + k, count * n + 1)]
    found = np.array(faces)
    a, b, c = np.moveaxis(vertices[found], 1, 0)
    inside_out = np.einsum("ij,ij->", a, np.cross(b, c)) < 0.0
    return vertices, found[:, ::-1] if inside_out else found


def box(length: float, width: float, height: float, *, along: int, across: int) -> tuple[Array, Faces]:
    """A box about the origin, with `along` x `across` rectangles in its lower and upper faces; [m]."""
    y = np.linspace(-width / 2, width / 2, across + 1)
    y, z = np.concatenate([y, y[::-1]]), np.repeat([-height / 2, height / 2], across + 1)
    x = np.linspace(-length / 2, length / 2, along + 1)
    return lofted(np.array([np.column_stack([np.full(len(y), level), y, z]) for level in x]))


def pad(radius: float, height: float, *, sections: int, rings: int) -> tuple[Array, Faces]:
    """A flattened ball about the origin [m], of so many meridians and parallels; between these it is flat."""
    latitude = np.pi * (np.arange(rings) + 0.5) / rings
    angle = 2 * np.pi * (np.arange(sections) + 0.5) / sections
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sections)])
    up = np.array([0.0, 0.0, height / 2])
    return lofted(np.sin(latitude)[:, None, None] * circle + np.cos(latitude)[:, None, None] * up)
