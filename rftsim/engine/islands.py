"""Islands: trees of bodies that MuJoCo's constraints join; each with a body near the sand has an equation of its own.

The table at an address i sorts the model's degrees of freedom, the bed's bodies that are near the sand, and the rows of
constraints by island. An island goes by the number of one of its trees.
"""

from typing import Final

import numpy as np

from rftsim.machine import lanes
from rftsim.machine.compiling import exact
from rftsim.machine.memory import int64s
from rftsim.machine.table import Table

COUNTS: Final = np.dtype([(name, "i8") for name in ("ntree", "nv", "nbody", "nrow")])
"""The head of a table: trees, degrees of freedom, bodies that are near the sand, rows of constraints."""
NONE: Final = -1
"""The island of a row that moves nothing."""

_T: Final = Table(COUNTS, COUNTS.names or ())
head = _T.head
"""Record COUNTS of the table at i."""
leader = _T.vector("ntree", view=int64s)
"""A tree of the same island, and at last the one that the island goes by, int64, (ntree,)."""
island_of_row = _T.vector("nrow", view=int64s)
"""A tree that a row moves, or NONE, and at last its island, int64, (nrow,)."""
island_of_body = _T.vector("nbody", view=int64s)
"""The same of a near body, int64, (nbody,)."""
near = _T.vector("nbody", view=int64s)
"""Places of the near bodies among those of the bed, int64, (nbody,)."""
dofs = _T.vector("nv", view=int64s)
"""All degrees of freedom, island by island, int64, (nv,)."""
place_of = _T.vector("nv", view=int64s)
"""Place of a degree of freedom in the equation of its island, see `place`, int64, (nv,)."""
below = _T.vector("nv", view=int64s)
"""Scratch: how many there are in the subtree of a degree of freedom, itself among them, int64, (nv,)."""
members = _T.vector("nbody", view=int64s)
"""All near bodies, by their place in `near`, island by island, int64, (nbody,)."""
rows = _T.vector("nrow", view=int64s)
"""All rows, island by island, int64, (nrow,)."""
dof_start = _T.vector("ntree", view=int64s)
"""Place of an island's first degree of freedom in `dofs`, int64, (ntree,)."""
body_start = _T.vector("ntree", view=int64s)
"""Place of its first body in `members`."""
row_start = _T.vector("ntree", view=int64s)
"""Place of its first row in `rows`."""
dof_count = _T.vector("ntree", view=int64s)
"""Degrees of freedom of an island, int64, (ntree,)."""
body_count = _T.vector("ntree", view=int64s)
"""Near bodies of it."""
row_count = _T.vector("ntree", view=int64s)
"""Rows of it."""
smooth_force = _T.vector("nv")
"""The smooth generalised force but the sand's, of all degrees of freedom, (nv,)."""

TABLE: Final = _T.size
"""Numbers of a table, int64."""
_lay_out, _place = _T.layout(), _T.place()


@exact
def lay_out(i, ntree, nv, nbody, nrow):
    """Fill the table at i for so many trees, degrees of freedom, near bodies and rows; the bytes of its arrays."""
    counts = head(i)
    counts.ntree, counts.nv, counts.nbody, counts.nrow = ntree, nv, nbody, nrow
    return _lay_out(i)


@exact
def begin(i, address):
    """Place the arrays of a table that was laid out at an address; each tree is an island."""
    _place(i, address)
    own = leader(i)
    for tree in range(own.size):
        own[tree] = tree


@exact
def find(i, tree):
    """The tree that stands for a tree's island."""
    own = leader(i)
    while own[tree] != tree:
        own[tree] = own[own[tree]]
        tree = own[tree]
    return tree


@exact
def add_to_row(i, row, tree):
    """Say that a row moves a tree, and so joins it to the others that it moves."""
    island = island_of_row(i)
    if island[row] == NONE:
        island[row] = tree
    else:
        own, one, other = leader(i), find(i, island[row]), find(i, tree)
        own[max(one, other)] = min(one, other)


@exact
def _sort(islands, start, count, out):
    """Sort what has an island by that: fill the start and the count of each island, and out."""
    for tree in range(start.size):
        count[tree] = 0
    for k in range(islands.size):
        if islands[k] != NONE:
            count[islands[k]] += 1
    total = 0
    for tree in range(start.size):
        start[tree], total = total, total + count[tree]
        count[tree] = 0
    for k in range(islands.size):
        island = islands[k]
        if island != NONE:
            out[start[island] + count[island]] = k
            count[island] += 1


@exact
def sort(i, tree_of_dof):
    """Sort all by island, when every row and near body has a tree.

    Args:
        i: The table.
        tree_of_dof: The tree of each degree of freedom, (nv,).
    """
    places, order = place_of(i), dofs(i)
    for row in range(head(i).nrow):
        if island_of_row(i)[row] != NONE:
            island_of_row(i)[row] = find(i, island_of_row(i)[row])
    for k in range(head(i).nbody):
        if island_of_body(i)[k] != NONE:
            island_of_body(i)[k] = find(i, island_of_body(i)[k])
    for dof in range(places.size):
        places[dof] = find(i, tree_of_dof[dof])
    _sort(places, dof_start(i), dof_count(i), order)
    _sort(island_of_body(i), body_start(i), body_count(i), members(i))
    _sort(island_of_row(i), row_start(i), row_count(i), rows(i))


@exact
def place(i, island, parent):
    """Place an island's degrees of freedom in its equation, so that no tile of its matrices couples what trees do not.

    A branch that does not fit into what is left of a tile begins a new one, see `rftsim.solver.pattern`.

    Args:
        i: The table.
        island: The island.
        parent: The degree of freedom above each, or a negative number, (nv,).

    Returns:
        The room that they take, a multiple of LANES.
    """
    places, sizes, first = place_of(i), below(i), dof_start(i)[island]
    own = dofs(i)[first : first + dof_count(i)[island]]
    for k in range(own.size):
        sizes[own[k]] = 1
    for k in range(own.size - 1, 0, -1):
        if parent[own[k]] >= 0:
            sizes[parent[own[k]]] += sizes[own[k]]
    room, before = 0, NONE
    for k in range(own.size):
        left = lanes.padded(room) - room
        if parent[own[k]] != before and sizes[own[k]] > left:
            room += left
        places[own[k]], room, before = room, room + 1, own[k]
    return lanes.padded(room)
