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
def _is_definite(a: mat66):
    """Whether a symmetric matrix is positive definite: Cholesky's factors exist."""
    f = a
    found = 1
    for i in range(6):
        if found == 1:
            pivot = f[i, i]
            if pivot <= 0.0:
                found = 0
            else:
                for r in range(i + 1, 6):
                    share = f[r, i] / pivot
                    for c in range(i + 1, 6):
                        f[r, c] = f[r, c] - share * f[i, c]
    return found


@wp.func
def without_negative(a: mat66):
    """A symmetric matrix without the parts that belong to its negative eigenvalues."""
    if _is_definite(a) == 1:
        return a
    d = a
    v = wp.identity(n=6, dtype=float)
    for _ in range(SWEEPS):
        for p in range(5):
            for q in range(p + 1, 6):
                if wp.abs(d[p, q]) > 1e-12 * (wp.abs(d[p, p]) + wp.abs(d[q, q])):
                    half = 0.5 * (d[q, q] - d[p, p]) / d[p, q]
                    t = wp.where(half >= 0.0, 1.0, -1.0) / (wp.abs(half) + wp.sqrt(half * half + 1.0))
                    c = 1.0 / wp.sqrt(t * t + 1.0)
                    s = t * c
                    for k in range(6):
                        x, y = d[k, p], d[k, q]
                        d[k, p] = c * x - s * y
                        d[k, q] = s * x + c * y
                    for k in range(6):
                        x, y = d[p, k], d[q, k]
                        d[p, k] = c * x - s * y
                        d[q, k] = s * x + c * y
                        z, w = v[k, p], v[k, q]
                        v[k, p] = c * z - s * w
                        v[k, q] = s * z + c * w
    out = mat66()
    for i in range(6):
        for k in range(6):
            total = float(0.0)
            for e in range(6):
                total += v[i, e] * wp.max(d[e, e], 0.0) * v[k, e]
            out[i, k] = total
    return out
