"""The triangles of a body that the sand can act on, next to one another, so that no other is evaluated.

A law gives nothing above the sand and nothing behind the leading edge. Of a wheel in sand that leaves one triangle in
eight; finding and copying them costs about a quarter of an evaluation each.
"""

from typing import Any, Final

from numba import carray, njit, types

from rftsim.memory import on_stack

FASTMATH: Final = {"reassoc", "contract", "arcp", "nsz"}
"""Floating-point liberties of the compiled loops."""
LOOK: Final = 128
"""Triangles that are looked at together."""
ROOM: Final = 392
"""Triangles that are evaluated together at most; no power of two, lest the columns share the cache's sets."""
LANES: Final = 8
"""They are filled up to a multiple of this with ones without area: what is left over of a vectorised loop is slow."""

_columns, _scores = on_stack(7 * ROOM, types.float64), on_stack(LOOK, types.float64)
_indices = on_stack(LOOK, types.int64)


@njit(forceinline=True)
def columns_on_stack():
    """Space for the chosen triangles, on the stack: seven columns of ROOM, as a packed surface has them."""
    return carray(_columns(), (7 * ROOM,))


def choosing(score: Any) -> Any:
    """The function that chooses, for a score (of centre, normal, frame and two more) that is negative where not."""

    @njit(fastmath=FASTMATH, error_model="numpy", forceinline=True)
    def choose(columns, first, last, frame, reach, h, chosen, n):
        """Copy what counts of triangles first to last, at most LOOK, behind the first n; how many there are then."""
        cx, cy, cz, nx, ny, nz, area = columns
        scores, indices = carray(_scores(), (LOOK,)), carray(_indices(), (LOOK,))
        for i in range(first, last):
            scores[i - first] = score(cx[i], cy[i], cz[i], nx[i], ny[i], nz[i], frame, reach, h)
        found = 0
        for i in range(last - first):
            indices[found] = i
            found += 0 if scores[i] < 0.0 else 1  # what is no number counts, and stays none
        for i in range(found):
            k, to = first + indices[i], n + i
            chosen[to], chosen[to + ROOM], chosen[to + 2 * ROOM] = cx[k], cy[k], cz[k]
            chosen[to + 3 * ROOM], chosen[to + 4 * ROOM], chosen[to + 5 * ROOM] = nx[k], ny[k], nz[k]
            chosen[to + 6 * ROOM] = area[k]
        return n + found

    return choose


@njit(forceinline=True)
def filled_up(chosen, n):
    """Their number after ones without area made it a multiple of LANES."""
    while n % LANES != 0:
        for column in range(6):
            chosen[n + column * ROOM] = chosen[column * ROOM]
        chosen[n + 6 * ROOM] = 0.0
        n += 1
    return n
