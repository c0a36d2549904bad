"""The question of each step, whether the model still has the numbers that were checked when a block was made."""

from numba import types

from rftsim.engine import checks, instance
from rftsim.engine.seal import TABLE
from rftsim.law.body import header_at
from rftsim.law.layout import BED_NUMBERS, HEADER_NUMBERS
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, pointer, stack_doubles

LOOK, PIECE = 4096, 512
"""Numbers of all surfaces of a bed that are looked at in one step, about, and in one go."""
_TABLE, _TABLE_END = TABLE.start, TABLE.stop
_fill_weight = types.ExternalFunction("rftsim_weigh", types.void(types.intp, types.intp, types.intp))


@exact
def is_sound(model, m, address, state_size):
    """Whether a block's bed, surfaces and state are still what was checked, or what may take its place.

    The state has to be of the size that the force which is asked for wants. Of surfaces of more than LOOK numbers, so
    many are looked at each time, one surface after the other, and the sum of each is compared at its end.
    """
    end, kept = pointer(m + model.nnumericdata), instance.lasting(address)
    if kept.size != state_size:
        return False
    if not checks.are_numbers(kept.ctypes.data, kept.size) or instance.head(address).bed > end - BED_NUMBERS:
        return False
    sand = instance.bed(model, m, address)
    if not checks.is_within(sand) or sealed_weight(sand) != instance.head(address).bed_weight:
        return False
    head = instance.head(address)
    if head.terrain > end - head.terrain_size or (
        head.terrain_size > 0 and checks.weigh_shape(instance.terrain(model, m, address)) != head.terrain_weight
    ):
        return False
    for k in range(head.nbody):
        member = instance.member(address, k)
        if member.start > end - member.size or not _has_header(instance.own_surface(model, m, address, k), member):
            return False
    return _look_on(model, m, address)


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
def _has_header(at, member):
    """Whether the surface at an address still has the header that was checked."""
    header = header_at(at)
    if header.ntri != member.ntri or header.wheel_radius != member.wheel_radius:
        return False
    return weight(at, HEADER_NUMBERS) == member.header_weight


@exact
def _look_on(model, m, address):
    """Weigh LOOK numbers more of the surfaces; whether those that are through are still what was checked."""
    head, left, through = instance.head(address), LOOK, 0
    while left > 0 and through < head.nbody:
        member = instance.member(address, head.looking)
        left -= look(instance.own_surface(model, m, address, head.looking), member)
        if member.looked_at >= member.size:
            through += 1
            head.looking = head.looking + 1 if head.looking + 1 < head.nbody else 0
            if looked(member) != member.weight:
                return False
    return True


@exact
def look(at, member):
    """Weigh one piece more of a member's surface, always the same ones; how many numbers that are."""
    n = min(PIECE, member.size - member.looked_at)
    member.weight_so_far += weight(at + 8 * member.looked_at, n)
    member.looked_at += n
    return n


@exact
def looked(member):
    """The weight of a member's surface, all of which was looked at; from here on it is looked at anew."""
    found = member.weight_so_far
    member.weight_so_far, member.looked_at = 0.0, 0
    return found
