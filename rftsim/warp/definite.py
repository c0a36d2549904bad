"""Symmetric matrices of six rows as functions of Warp."""

from typing import Final

import warp as wp

mat66 = wp.types.matrix(shape=(6, 6), dtype=wp.float32)
vec6 = wp.types.vector(length=6, dtype=wp.float32)

SWEEPS: Final = wp.constant(6)
"""Sweeps of Jacobi's method; each squares what is left beside the diagonal, and four leave nothing in single
precision."""


@wp.func
def from_blocks(upper: wp.mat33, beside: wp.mat33, lower: wp.mat33):
    """The symmetric matrix with blocks ((upper, beside), (beside', lower))."""
    out = mat66()
    for i in range(3):
        for k in range(3):
            out[i, k] = upper[i, k]
            out[i, 3 + k] = beside[i, k]
            out[3 + k, i] = beside[i, k]
            out[3 + i, 3 + k] = lower[i, k]
    return out


@wp.func
def _eliminated(f: mat66, i: int):
    """A matrix after the i-th step of Cholesky's elimination."""
    for row in range(i + 1, 6):
        share = f[row, i] / f[i, i]
        for column in range(i + 1, 6):
            f[row, column] = f[row, column] - share * f[i, column]
    return f


@wp.func
def _is_definite(a: mat66):
    """Whether a symmetric matrix is positive definite: all pivots of its elimination are positive."""
    f = a
    for i in range(6):
        if not f[i, i] > 0.0:
            return False
        f = _eliminated(f, i)
    return True


@wp.struct
class Turned:
    """A matrix on its way to a diagonal, and the rotations that took it there."""

    matrix: mat66
    rotation: mat66


@wp.func
def _turned(t: Turned, p: int, q: int):
    """A matrix after the rotation of Jacobi's method that clears one of its elements."""
    d, v = t.matrix, t.rotation
    if wp.abs(d[p, q]) <= 1e-12 * (wp.abs(d[p, p]) + wp.abs(d[q, q])):
        return t
    half = 0.5 * (d[q, q] - d[p, p]) / d[p, q]
    tangent = wp.where(half >= 0.0, 1.0, -1.0) / (wp.abs(half) + wp.sqrt(half * half + 1.0))
    c = 1.0 / wp.sqrt(tangent * tangent + 1.0)
    s = tangent * c
    for k in range(6):
        x, y = d[k, p], d[k, q]
        d[k, p] = c * x - s * y
        d[k, q] = s * x + c * y
    for k in range(6):
        x, y, z, w = d[p, k], d[q, k], v[k, p], v[k, q]
        d[p, k] = c * x - s * y
        d[q, k] = s * x + c * y
        v[k, p] = c * z - s * w
        v[k, q] = s * z + c * w
    t.matrix = d
    t.rotation = v
    return t


@wp.func
def without_negative(a: mat66):
    """A symmetric matrix without the parts that belong to its negative eigenvalues."""
    if _is_definite(a):
        return a
    t = Turned()
    t.matrix = a
    t.rotation = wp.identity(n=6, dtype=float)
    sweeps = int(SWEEPS)
    for _ in range(sweeps):
        for p in range(5):
            for q in range(p + 1, 6):
                t = _turned(t, p, q)
    out = mat66()
    for e in range(6):
        axis = wp.transpose(t.rotation)[e]
        out += wp.max(t.matrix[e, e], 0.0) * wp.outer(axis, axis)
    return out
