"""The triangles of a body that the sand can act on, next to one another, so that no other is evaluated.

A law gives nothing above the sand and nothing behind the leading edge. Of a wheel in sand that leaves one triangle in
eight; finding and copying them costs about a quarter of an evaluation each.
"""

from typing import Any, Final

from numba import carray, njit, types

from rftsim.law.layout import BLOCK, BOX, COLUMNS, HEADER
from rftsim.machine.memory import on_stack, peek, poke
from rftsim.solver.linear_algebra import FASTMATH

LOOK: Final = 4 * BLOCK
"""Triangles that are looked at together, at most."""
ROOM: Final = 392
"""Triangles that are evaluated together at most; no power of two, lest the columns share the cache's sets."""
LANES: Final = 8
"""They are filled up to a multiple of this with ones without area: what is left over of a vectorised loop is slow."""

_columns, _scores = on_stack(COLUMNS * ROOM, types.float64), on_stack(LOOK, types.float64)
_indices = on_stack(LOOK, types.int64)


@njit(forceinline=True)
def block_is_clear(body, block, frame, margin):
    """Whether a block of triangles lies more than a margin above the undisturbed sand."""
    start, r = HEADER + COLUMNS * int(body[14]) + BOX * block, frame.rise
    middle = r[0] * peek(body, start) + r[1] * peek(body, start + 1) + r[2] * peek(body, start + 2)
    below = abs(r[0]) * peek(body, start + 3) + abs(r[1]) * peek(body, start + 4) + abs(r[2]) * peek(body, start + 5)
    return middle - below >= frame.height + margin


@njit(forceinline=True)
def next_run(body, start, frame, margin):
    """The next triangles from start on whose blocks are not clear, at most LOOK: first, and the one behind the last.

    Both are the number of triangles where none are left.
    """
    count = int(body[14])
    first = start
    while first < count and block_is_clear(body, first // BLOCK, frame, margin):
        first += BLOCK
    last = first
    while last < count and last < first + LOOK and not block_is_clear(body, last // BLOCK, frame, margin):
        last += BLOCK
    return min(first, count), min(last, count)


@njit(forceinline=True)
def columns_on_stack():
    """Space for the chosen triangles, on the stack: COLUMNS of ROOM, as a packed surface has them."""
    return carray(_columns(), (COLUMNS * ROOM,))


def choosing(score: Any) -> Any:
    """The function that chooses, for a score (of centre, normal, frame and two more) that is negative where not."""

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def choose(body, start, frame, margin, reach2, h, chosen, n):
        """Copy what counts of the next run of triangles, see `next_run`, behind the first n.

        Returns:
            How many are chosen then, and behind which triangle to go on.
        """
        first, last = next_run(body, start, frame, margin)
        size = int(body[14])
        at = HEADER + first
        scores, indices = carray(_scores(), (LOOK,)), carray(_indices(), (LOOK,))
        for i in range(last - first):
            x, y, z = peek(body, at + i), peek(body, at + i + size), peek(body, at + i + 2 * size)
            nx, ny, nz = peek(body, at + i + 3 * size), peek(body, at + i + 4 * size), peek(body, at + i + 5 * size)
            poke(scores, i, score(x, y, z, nx, ny, nz, frame, reach2, h))
        found = 0
        for i in range(last - first):
            poke(indices, found, i)
            found += 0 if peek(scores, i) < 0.0 else 1  # what is no number counts, and stays none
        for i in range(found):
            k, to = at + peek(indices, i), n + i
            for column in range(COLUMNS):
                poke(chosen, to + column * ROOM, peek(body, k + column * size))
        return n + found, last

    return choose


@njit(forceinline=True)
def filled_up(chosen, n):
    """Their number after ones without area made it a multiple of LANES."""
    while n % LANES != 0:
        for column in range(COLUMNS - 1):
            poke(chosen, n + column * ROOM, peek(chosen, column * ROOM))
        poke(chosen, n + (COLUMNS - 1) * ROOM, 0.0)
        n += 1
    return n
