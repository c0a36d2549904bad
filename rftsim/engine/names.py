"""Names of a model's elements for compiled code, which reads nothing outside their array."""

from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import bytes_at, int32s, pointer

_ZERO, _COLON = ord("0"), ord(":")


@inline
def text(model, m):
    """All names, one after another, each with a zero behind it."""
    return bytes_at(pointer(m + model.names), pointer(m + model.nnames))


@inline
def start_of(model, m, places, count, i):
    """Where the name of element i starts, whose kind's places lie at an offset; behind all names, if nowhere."""
    place, end = int32s(pointer(m + places), count)[i], pointer(m + model.nnames)
    return place if 0 <= place < end else end


@inline
def letter(names, i):
    """The character at a place, zero at the end of a name and behind all."""
    return names[i] if i < names.size else 0


@exact
def marked(names, numeric, marker, owner, first):
    """Where the marker stands in the name at `numeric`, if that is the name at `owner` with it inserted; else -1.

    It may be so in several places, and is looked for from `first` on.
    """
    same = 0
    while letter(names, numeric + same) != 0 and letter(names, numeric + same) == letter(names, owner + same):
        same += 1
    for start in range(first, same + 1):
        k = 0
        while k < len(marker) and letter(names, numeric + start + k) == marker[k]:
            k += 1
        if k == len(marker) and _rest_is_same(names, numeric + start + k, owner + start):
            return start
    return -1


@exact
def _rest_is_same(names, one, other):
    """Whether two names are the same from two places on."""
    i = 0
    while letter(names, one + i) != 0 and letter(names, one + i) == letter(names, other + i):
        i += 1
    return letter(names, one + i) == letter(names, other + i)


@exact
def goes_on(names, numeric, more, owner, start, k):
    """Whether the name at `numeric` is that of the k-th numeric of what is an owner's, whose marker stands at start."""
    for i in range(start):
        if letter(names, numeric + i) != letter(names, owner + i):
            return False
    at = numeric + start
    for i in range(len(more)):
        if letter(names, at + i) != more[i]:
            return False
    at += len(more)
    power = 1
    while 10 * power <= k:
        power *= 10
    while power > 0:
        if letter(names, at) != _ZERO + k // power % 10:
            return False
        at, power = at + 1, power // 10
    return letter(names, at) == _COLON and _rest_is_same(names, at + 1, owner + start)
