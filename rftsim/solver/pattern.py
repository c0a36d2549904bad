"""The pattern of an equation's matrices: what its trees couple, by tiles of LANES rows and columns, see `tiles`.

A tree couples a degree of freedom to its ancestors alone, and elimination from the last one to the first then fills
nothing in. So it is with tiles, of which one descends from another where one of its degrees of freedom does. Where
constraints couple branches, one is hung below the other. Matrices are stored with all their entries, row by row; tiles
that hold no coupled pair are neither set nor read.
"""

from typing import Final

from rftsim.machine.compiling import exact
from rftsim.machine.lanes import LANES
from rftsim.solver import equation, linear_algebra

NONE: Final = -1
"""The parent of what is coupled to nothing before it."""


@exact
def begin(p):
    """Begin with a pattern in which nothing is coupled."""
    parent = equation.parent(p)
    for k in range(parent.size):
        parent[k] = NONE


@exact
def couple(p, k, other):
    """Couple two degrees of freedom, the second before the first: its tile becomes an ancestor of the other's."""
    parent = equation.parent(p)
    k, other = k // LANES, other // LANES
    while k != other and other != NONE:
        above = parent[k]
        if above < other:
            parent[k], k, other = other, other, above
        else:
            k = above


@exact
def find(p):
    """Fill the columns of the tiles that each row of them has: of its ancestors, its own, and of its descendants."""
    parent, count, before = equation.parent(p), equation.tile_count(p), equation.before(p)
    for k in range(parent.size // LANES):
        own, above, known = equation.tiles(p, k), parent[k], 0
        if above != NONE:
            known = before[above] + 1
            linear_algebra.copy(equation.tiles(p, above)[:known], own[:known])
        for i in range(known):
            other = own[i] // LANES
            equation.tiles(p, other)[count[other]] = LANES * k
            count[other] += 1
        own[known], before[k], count[k] = LANES * k, known, known + 1
