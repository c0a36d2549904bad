"""The question of each step, whether the model still has the numbers that were checked when a block was made."""

from numba import types

from rftsim.engine import checks, instance
from rftsim.engine.seal import BED_NUMBERS, LARGEST, TABLE
from rftsim.law.body import header_at
from rftsim.law.layout import HEADER_NUMBERS
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, pointer, stack_doubles

LOOK = 4096
"""Numbers of a surface that are looked at in one step."""
_TABLE, _TABLE_END = TABLE.start, TABLE.stop
_fill_weight = types.ExternalFunction("rftsim_weigh", types.void(types.intp, types.intp, types.intp))


@exact
def is_sound(model, m, address, state_size):
    """Whether a block's bed, surfaces and state are still what was checked, or what may take its place.

    The state has to be of the size that the force which is asked for wants. Of a surface of more than LOOK numbers, so
    many are looked at each time, and their sum is compared at the end.
    """
    end, kept = pointer(m + model.nnumericdata), instance.lasting(address)
    if kept.size != state_size:
        return False
    for i in range(kept.size):
        if not abs(kept[i]) <= LARGEST:
            return False
    if instance.head(address).bed > end - BED_NUMBERS:
        return False
    sand = instance.bed(model, m, address)
    if not checks.is_within(sand) or sealed_weight(sand) != instance.head(address).bed_weight:
        return False
    for k in range(instance.head(address).nbody):
        member = instance.member(address, k)
        if member.start > end - member.size or not _is_same(instance.surface(model, m, address, k), member):
            return False
    return True


@inline
def weight(at, size):
    """The weight of so many numbers at an address, see `checks.weigh`."""
    out = stack_doubles(1)
    _fill_weight(at, size, out)
    return doubles(out, 1)[0]


@inline
def sealed_weight(sand):
    """The weight of the numbers of the bed at an address that nobody may change."""
    return checks.weigh_rest(sand) + weight(sand + 8 * _TABLE, _TABLE_END - _TABLE)


@exact
def _is_same(at, member):
    """Whether the surface at an address is still the one that was checked, as far as it is looked at now."""
    header = header_at(at)
    if header.ntri != member.ntri or header.wheel_radius != member.wheel_radius:
        return False
    return weight(at, HEADER_NUMBERS) == member.header_weight and (
        not look(at, member) or looked(member) == member.weight
    )


@exact
def look(at, member):
    """Weigh some more of a member's surface; whether all of it was looked at."""
    n = min(LOOK, member.size - member.looked_at)
    member.weight_so_far += weight(at + 8 * member.looked_at, n)
    member.looked_at += n
    return member.looked_at >= member.size


@exact
def looked(member):
    """The weight of a member's surface, all of which was looked at; from here on it is looked at anew."""
    found = member.weight_so_far
    member.weight_so_far, member.looked_at = 0.0, 0
    return found
