"""The solver's matrices against NumPy's: products and solutions within the pattern of trees, whatever is coupled."""

import itertools

import numpy as np
import pytest
from numba import njit

from rftsim.engine import islands
from rftsim.machine.lanes import LANES
from rftsim.solver import equation, matrices, pattern


@njit
def place(table, memory, parent):
    """Places of a forest's degrees of freedom as one island, (nv,), and their room."""
    i, nv = table.ctypes.data, parent.size
    islands.lay_out(i, 1, nv, 0, 0)
    islands.begin(i, memory.ctypes.data)
    islands.sort(i, np.zeros(nv, np.int32))
    room = islands.place(i, 0, parent)
    return islands.place_of(i).copy(), room


@njit
def solve(table, memory, n, pairs, a, b):
    """The product A b, the solution of A x = b, and the tiles that are read; A of what pairs couple, (n^2,)."""
    p = table.ctypes.data
    equation.lay_out(p, 0, n, 0)
    equation.place(p, memory.ctypes.data)
    pattern.begin(p)
    for k in range(len(pairs)):
        pattern.couple(p, pairs[k, 0], pairs[k, 1])
    pattern.find(p)
    own, product, solution, count = equation.mass_factors(p), np.empty(n), np.empty(n), 0
    matrices.copy(p, a, own)
    matrices.multiply(p, own, b, product)
    matrices.factor(p, own)
    matrices.substitute(p, own, b, solution)
    for k in range(n // LANES):
        count += equation.tile_count(p)[k]
    return product, solution, count


def forest(rng, nv):
    """Parents of so many degrees of freedom, depth first: of a trunk and branches of one to seven."""
    parent, chain = np.full(nv, -1, dtype=np.int32), []
    for k in range(nv):
        if rng.random() < 0.2:
            del chain[rng.integers(len(chain) + 1) :]
        parent[k] = chain[-1] if chain else -1
        chain.append(k)
    return parent


def coupled(parent, k):
    """A degree of freedom and its ancestors."""
    found = [k]
    while parent[found[-1]] >= 0:
        found.append(parent[found[-1]])
    return found


def packed(parent):
    """Places of a forest in tiles, and their room."""
    return place(np.empty(islands.TABLE, np.int64), np.empty(100 * (len(parent) + 9)), parent)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("nv", [1, 6, 12, 18, 50, 83])
def test_products_and_solutions_are_numpys(nv, seed):
    """Of a matrix that is not symmetric, of a forest in which two constraints couple what lies on two chains each."""
    rng = np.random.default_rng(seed)
    parent = forest(rng, nv)
    places, n = packed(parent)
    pairs = [(places[k], places[parent[k]]) for k in range(nv) if parent[k] >= 0]
    groups = [coupled(parent, k) for k in range(nv)]
    for one, other in rng.integers(nv, size=(2, 2)):
        both = sorted({*groups[one], *groups[other]})
        groups.append(both)
        pairs += [(places[k], places[before]) for before, k in itertools.pairwise(both)]
    a = np.zeros((n, n))
    for group in groups:
        at = places[group]
        a[np.ix_(at, at)] = rng.normal(size=(len(at), len(at)))
    a += np.diag(np.abs(a).sum(axis=1) + 1.0)
    b = np.where(np.isin(np.arange(n), places), rng.normal(size=n), 0.0)
    table, memory = np.empty(equation.TABLE, np.int64), np.full(40 * (n + 4) ** 2, np.nan)
    listed = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    product, solution, _ = solve(table, memory, n, listed, a.ravel(), b)
    np.testing.assert_allclose(product, a @ b, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(solution, np.linalg.solve(a, b), rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("length", [1, 3, 5, 8])
def test_branches_are_not_coupled_by_where_they_lie(length):
    """Twice as many branches of a trunk of six take twice as many tiles, but for those of the trunk."""
    counts = []
    for branches in (16, 32):
        parent = np.arange(-1, 5 + branches * length, dtype=np.int32)
        parent[6::length] = 5
        places, n = packed(parent)
        pairs = np.array([(places[k], places[parent[k]]) for k in range(1, len(parent))], dtype=np.int64)
        table, memory = np.empty(equation.TABLE, np.int64), np.empty(40 * (n + 4) ** 2)
        counts.append(solve(table, memory, n, pairs, np.eye(n).ravel(), np.zeros(n))[2])
    assert counts[1] < 2.05 * counts[0]
