"""Small dense linear algebra for compiled code: loops beat LAPACK's overhead at these sizes and need no library."""

import numpy as np
from numba import njit


@njit
def multiply(a, x):
    """A x, (n,)."""
    out = np.zeros(a.shape[0])
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            out[i] += a[i, k] * x[k]
    return out


@njit
def multiply_transposed(a, x):
    """A' x, (n,)."""
    out = np.zeros(a.shape[1])
    for i in range(a.shape[0]):
        if x[i] != 0.0:
            for k in range(a.shape[1]):
                out[k] += a[i, k] * x[i]
    return out


@njit
def dot(x, y):
    """The product x . y."""
    out = 0.0
    for i in range(x.size):
        out += x[i] * y[i]
    return out


@njit
def norm(inverse, x):
    """Length of an impulse x in a mass metric whose inverse is given, sqrt(x' M^-1 x)."""
    return np.sqrt(max(dot(x, multiply(inverse, x)), 0.0))


@njit
def _factor(a):
    """LU factors of a square matrix, in place, by partial pivoting: the order of its rows."""
    n = a.shape[0]
    order = np.arange(n)
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            order[k], order[pivot] = order[pivot], order[k]
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        if a[k, k] == 0.0:
            a[k, k] = 1e-300
        for i in range(k + 1, n):
            a[i, k] /= a[k, k]
            factor = a[i, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
    return order


@njit
def _substitute(lu, order, b, out):
    n = lu.shape[0]
    for i in range(n):
        out[i] = b[order[i]]
        for j in range(i):
            out[i] -= lu[i, j] * out[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            out[i] -= lu[i, j] * out[j]
        out[i] /= lu[i, i]


@njit
def solve(a, b):
    """The solution of A x = b; A is overwritten."""
    out = np.empty(b.size)
    _substitute(a, _factor(a), b, out)
    return out


@njit
def inverse(a):
    """The inverse of a square matrix."""
    n = a.shape[0]
    lu = a.copy()
    order = _factor(lu)
    out, column, unit = np.empty((n, n)), np.empty(n), np.zeros(n)
    for k in range(n):
        unit[k] = 1.0
        _substitute(lu, order, unit, column)
        unit[k] = 0.0
        for i in range(n):
            out[i, k] = column[i]
    return out
