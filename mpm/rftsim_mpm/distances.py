"""Signed distances of points from polygons and closed meshes, compiled; negative inside.

Everything that these loops call is in this file: numba's cache sees no change in a function of another.
"""

import numpy as np
from numba import njit


@njit(error_model="numpy", cache=True)
def polygon_distances(points, edges):
    """Return signed distances of points, (n, 2), from a polygon's edges, (m, 2, 2); the sign by counting crossings."""
    found = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        px, pz = points[p, 0], points[p, 1]
        best, inside = np.inf, False
        for e in range(edges.shape[0]):
            ax, az, bx, bz = edges[e, 0, 0], edges[e, 0, 1], edges[e, 1, 0], edges[e, 1, 1]
            best = min(best, _from_segment(px, pz, ax, az, bx, bz))
            if (az > pz) != (bz > pz) and px < ax + (pz - az) / (bz - az) * (bx - ax):
                inside = not inside
        found[p] = -np.sqrt(best) if inside else np.sqrt(best)
    return found


@njit(error_model="numpy", cache=True)
def mesh_distances(points, triangles):
    """Return signed distances of points, (n, 3), from a closed mesh, (m, 3, 3); the sign by the solid angle."""
    found = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        best, angle = np.inf, 0.0
        for t in range(triangles.shape[0]):
            corners, point = triangles[t], _place(points, p)
            a, b, c = _place(corners, 0), _place(corners, 1), _place(corners, 2)
            squared, solid = _from_triangle(_minus(a, point), _minus(b, point), _minus(c, point))
            best = min(best, squared)
            angle += solid
        found[p] = -np.sqrt(best) if abs(angle) > 2.0 * np.pi else np.sqrt(best)
    return found


@njit(error_model="numpy")
def _from_segment(px, pz, ax, az, bx, bz):
    """Squared distance of a point from a segment of the plane."""
    ux, uz, wx, wz = bx - ax, bz - az, px - ax, pz - az
    t = min(max((wx * ux + wz * uz) / (ux * ux + uz * uz), 0.0), 1.0)
    return (wx - t * ux) ** 2 + (wz - t * uz) ** 2


@njit(error_model="numpy")
def _from_triangle(a, b, c):
    """Squared distance of the origin from a triangle, and the solid angle that it is seen under."""
    ab, bc, ca = _minus(b, a), _minus(c, b), _minus(a, c)
    n = ab[1] * -ca[2] + ab[2] * ca[1], ab[2] * -ca[0] + ab[0] * ca[2], ab[0] * -ca[1] + ab[1] * ca[0]
    n2 = _dot(n, n)
    height = _dot(a, n)
    foot = (height / n2 * n[0], height / n2 * n[1], height / n2 * n[2])
    if _is_left(foot, a, ab, n) and _is_left(foot, b, bc, n) and _is_left(foot, c, ca, n):
        squared = height * height / n2
    else:
        squared = min(min(_from_edge(a, ab), _from_edge(b, bc)), _from_edge(c, ca))
    la, lb, lc = np.sqrt(_dot(a, a)), np.sqrt(_dot(b, b)), np.sqrt(_dot(c, c))
    return squared, 2.0 * np.arctan2(height, la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb)


@njit(error_model="numpy")
def _is_left(point, start, edge, n):
    """Whether a point in a triangle's plane lies on the inner side of one of its edges."""
    w = _minus(point, start)
    turn = (edge[1] * w[2] - edge[2] * w[1], edge[2] * w[0] - edge[0] * w[2], edge[0] * w[1] - edge[1] * w[0])
    return _dot(turn, n) >= 0.0


@njit(error_model="numpy")
def _from_edge(start, edge):
    """Squared distance of the origin from a segment."""
    w = -start[0], -start[1], -start[2]
    t = min(max(_dot(w, edge) / _dot(edge, edge), 0.0), 1.0)
    r = w[0] - t * edge[0], w[1] - t * edge[1], w[2] - t * edge[2]
    return _dot(r, r)


@njit(error_model="numpy")
def _place(places, i):
    return places[i, 0], places[i, 1], places[i, 2]


@njit(error_model="numpy")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(error_model="numpy")
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
