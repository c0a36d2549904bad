"""Matrices of an equation's pattern: those of a tree couple a degree of freedom to its ancestors alone.

Elimination from the last degree of freedom to the first then fills nothing in; what constraints between branches add to
the pattern is closed under it by `close`. So the cost grows with the number of degrees of freedom times the square of
the depth of the tree. A matrix is stored with all its entries; those outside of the pattern are neither set nor read.
"""

from typing import Final

import numpy as np

from rftsim.machine.compiling import exact, fast, inline
from rftsim.machine.memory import doubles, peek, poke
from rftsim.solver import equation

_LEAST: Final = 1e-300
"""Size of the pivot that stands for a vanishing one."""


@exact
def couple_on(p, k, other, known):
    """Couple degree of freedom k to one before it, the next of a rising row of them.

    Args:
        p: The equation.
        k: The degree of freedom.
        other: The one before it.
        known: How many that k is coupled to come before the last one of the row.

    Returns:
        How many come before this one.
    """
    own, n = equation.coupled(p, k), equation.coupled_length(p)[k]
    while known < n and own[known] < other:
        known += 1
    if known == n or own[known] != other:
        for i in range(n, known, -1):
            own[i] = own[i - 1]
        own[known] = other
        equation.coupled_length(p)[k] = n + 1
    return known


@exact
def join(p, k, more, count):
    """Couple degree of freedom k to more of those before it, of which so many are given, rising."""
    known = np.int64(0)
    for i in range(count):
        known = couple_on(p, k, more[i], known)


@exact
def close(p):
    """Extend the pattern by what elimination fills in."""
    length = equation.coupled_length(p)
    for k in range(length.size - 1, 0, -1):
        if length[k] > 1:
            own, last = equation.coupled(p, k), length[k] - 1
            join(p, own[last], own, last)


@exact
def clear(p, a):
    """Set a matrix to zero within the pattern."""
    for k in range(a.shape[0]):
        own = equation.coupled(p, k)
        a[k, k] = 0.0
        for i in range(equation.coupled_length(p)[k]):
            a[k, own[i]] = a[own[i], k] = 0.0


@exact
def copy(p, a, out):
    """Fill the matrix out with the numbers of A."""
    for k in range(a.shape[0]):
        own = equation.coupled(p, k)
        out[k, k] = a[k, k]
        for i in range(equation.coupled_length(p)[k]):
            out[k, own[i]], out[own[i], k] = a[k, own[i]], a[own[i], k]


@exact
def add(p, a, share, out):
    """Add a share of a matrix A to the matrix out."""
    for k in range(a.shape[0]):
        own = equation.coupled(p, k)
        out[k, k] += share * a[k, k]
        for i in range(equation.coupled_length(p)[k]):
            out[k, own[i]] += share * a[k, own[i]]
            out[own[i], k] += share * a[own[i], k]


@exact
def add_difference(p, a, b, share, out):
    """Add A - B, each column by its own share, to the matrix out."""
    for k in range(a.shape[0]):
        own = equation.coupled(p, k)
        out[k, k] += share[k] * (a[k, k] - b[k, k])
        for i in range(equation.coupled_length(p)[k]):
            other = own[i]
            out[k, other] += share[other] * (a[k, other] - b[k, other])
            out[other, k] += share[k] * (a[other, k] - b[other, k])


@inline
def _numbers(a):
    """All entries of a matrix, one after another, to be read and written by `peek` and `poke`."""
    return doubles(a.ctypes.data, a.size)


@fast
def multiply(p, a, x, out):
    """Fill out with the product A x."""
    n, lengths, numbers = x.size, equation.coupled_length(p), _numbers(a)
    for k in range(n):
        own, row, y = equation.coupled(p, k), k * n, x[k]
        total = peek(numbers, row + k) * y
        for i in range(lengths[k]):
            other = peek(own, i)
            total += peek(numbers, row + other) * peek(x, other)
            poke(out, other, peek(out, other) + peek(numbers, other * n + k) * y)
        out[k] = total


@fast
def factor(p, a):
    """Factor a matrix in place: from the last row on, without a change of their order; pivots are left inverted."""
    n, lengths, numbers = a.shape[0], equation.coupled_length(p), _numbers(a)
    for k in range(n - 1, -1, -1):
        own, count, pivot = equation.coupled(p, k), lengths[k], k * n
        inverse = 1.0 / (a[k, k] if a[k, k] != 0.0 else _LEAST)
        a[k, k] = inverse
        for i in range(count):
            row = n * peek(own, i)
            share = peek(numbers, row + k) * inverse
            poke(numbers, row + k, share)
            for j in range(count):
                other = peek(own, j)
                poke(numbers, row + other, peek(numbers, row + other) - share * peek(numbers, pivot + other))


@fast
def substitute(p, a, b, out):
    """Fill out with the solution of A x = b from the factors of A; b and out differ."""
    n, lengths, numbers = b.size, equation.coupled_length(p), _numbers(a)
    for k in range(n):
        out[k] = b[k]
    for k in range(n - 1, -1, -1):
        own, x = equation.coupled(p, k), out[k]
        for i in range(lengths[k]):
            other = peek(own, i)
            poke(out, other, peek(out, other) - peek(numbers, other * n + k) * x)
    for k in range(n):
        own, x, row = equation.coupled(p, k), out[k], k * n
        for i in range(lengths[k]):
            other = peek(own, i)
            x -= peek(numbers, row + other) * peek(out, other)
        out[k] = x * a[k, k]
