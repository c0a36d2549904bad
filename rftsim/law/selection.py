"""The triangles of a body that the sand can act on, next to one another, so that no other is evaluated.

A law gives nothing above the sand and nothing behind the leading edge. Of a wheel in sand that leaves one triangle in
eight; finding and copying them costs about a quarter of an evaluation each. Which ones follows from the leading-edge
rule and the depth, see `leading` and `free_surface`.
"""

from typing import Any, Final

from numba import carray, types

from rftsim.law import body as bodies
from rftsim.law.frame import point_velocity
from rftsim.law.free_surface import drop, plane_depth, rising
from rftsim.law.grounds import ALL_COLUMNS
from rftsim.law.laws import Response
from rftsim.law.layout import BLOCK, COLUMN, COLUMNS
from rftsim.law.leading import may_lead
from rftsim.law.vectors import larger, smaller
from rftsim.machine.compiling import inline, inline_loop
from rftsim.machine.lanes import LANES, WIDE, picking
from rftsim.machine.memory import on_stack, peek, poke

LOOK: Final = 4 * BLOCK
"""Triangles that are looked at together, at most."""
CAPACITY: Final = 392
"""Triangles that are evaluated together at most; no power of two, lest the columns share the cache's sets."""
FULL: Final = CAPACITY - LOOK - WIDE
"""Triangles above which these are evaluated before more are looked at."""

_columns, _scores = on_stack(ALL_COLUMNS * CAPACITY, types.float64), on_stack(LOOK, types.float64)
_indices = on_stack(LOOK, types.int64)


@inline
def next_run(body, start, frame, margin):
    """The next triangles from start on whose blocks are not clear, at most LOOK: first, and the one behind the last.

    Both are the number of triangles where none are left.
    """
    first = start
    while first < body.count and bodies.block_is_clear(body, first // BLOCK, frame, margin):
        first += BLOCK
    last = first
    while last < body.count and last < first + LOOK and not bodies.block_is_clear(body, last // BLOCK, frame, margin):
        last += BLOCK
    return min(first, body.count), min(last, body.count)


@inline
def chosen_on_stack():
    """Space for the chosen triangles, on the stack: ALL_COLUMNS of CAPACITY, first those of a packed surface."""
    return carray(_columns(), (ALL_COLUMNS * CAPACITY,))


@inline
def centre(chosen, i):
    """The centre of the i-th chosen triangle [m], (3,)."""
    return chosen[i + COLUMN.x * CAPACITY], chosen[i + COLUMN.y * CAPACITY], chosen[i + COLUMN.z * CAPACITY]


@inline
def normal(chosen, i):
    """The outward normal of the i-th chosen triangle, (3,)."""
    return chosen[i + COLUMN.nx * CAPACITY], chosen[i + COLUMN.ny * CAPACITY], chosen[i + COLUMN.nz * CAPACITY]


@inline
def area(chosen, i):
    """The area of the i-th chosen triangle [m^2]."""
    return chosen[i + COLUMN.area * CAPACITY]


@inline
def filled_up(chosen, n):
    """How many are chosen after ones without area made their number a multiple of WIDE.

    What is left over of a vectorised loop is slow.
    """
    while n % WIDE != 0:
        for column in range(COLUMN.area):
            poke(chosen, n + column * CAPACITY, peek(chosen, column * CAPACITY))
        poke(chosen, n + COLUMN.area * CAPACITY, 0.0)
        n += 1
    return n


@inline_loop
def _picked_one_by_one(body, first, count, scores, chosen, n):
    """Copy behind the first n those of so many triangles, from one on, whose scores are not negative; how many then."""
    indices, found = carray(_indices(), (LOOK,)), 0
    for i in range(count):
        poke(indices, found, i)
        found += 0 if peek(scores, i) < 0.0 else 1  # what is no number counts, and stays none
    for i in range(found):
        k, to = first + peek(indices, i), n + i
        for column in range(COLUMNS):
            poke(chosen, to + column * CAPACITY, bodies.at(body, column, k))
    return n + found


_pick = picking(COLUMNS, CAPACITY)


@inline_loop
def _picked_at_once(body, first, count, scores, chosen, n):
    """The same, for processors that press together what is chosen of a vector."""
    return _pick(scores, count, body.numbers, first, body.count, chosen, n)


_picked = _picked_at_once if WIDE > LANES else _picked_one_by_one


def choosing(response: Response, ahead: bool) -> Any:
    """Make the function that chooses what leads in the sand under a response; ahead: or in that after a time h."""
    normal_speed = response.normal_speed

    @inline
    def score(x, y, z, n, frame, reach2, h):
        v = point_velocity(frame, x, y, z)
        deep = plane_depth(x, y, z, frame) - drop(x, y, z, frame)
        if ahead:
            deep = larger(deep, deep - h * rising(v, frame.rise))
        speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        return smaller(deep, may_lead(normal_speed(n, v, frame), speed2, reach2))

    @inline_loop
    def choose(body, start, frame, margin, reach2, h, chosen, n):
        """Copy what counts of the next run of triangles, see `next_run`, behind the first n.

        Returns:
            How many are chosen then, and behind which triangle to go on.
        """
        first, last = next_run(body, start, frame, margin)
        scores = carray(_scores(), (LOOK,))
        for i in range(last - first):
            x, y, z = bodies.centre(body, first + i)
            poke(scores, i, score(x, y, z, bodies.normal(body, first + i), frame, reach2, h))
        return _picked(body, first, last - first, scores, chosen, n), last

    return choose
