"""A plugin instance for compiled code: its bodies and its block of memory, see `block`."""

import numpy as np
from numba import types

from rftsim.engine import block, checks, external, names
from rftsim.engine.refusals import WHY
from rftsim.engine.seal import BED_NUMBERS, LARGEST
from rftsim.law.body import header_at
from rftsim.law.layout import HEADER_NUMBERS, WRENCH, numbers_in
from rftsim.machine import claims
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int32s, int64s, pointer
from rftsim.machine.records import record_at
from rftsim.solver import state

_MEMBER = block.MEMBER.itemsize
_HEAD = block.BLOCK_HEAD.itemsize
_COUNTERS = numbers_in(block.COUNTERS)
LOOK = 4096
"""Numbers of a surface that are looked at in one step."""

REASONS = 16
"""What is wrong, of fewer reasons than these, and whose name is where, are one number: it is of both."""

_make_block = types.ExternalFunction("rftsim_make_block", types.intp(types.intp, types.intp, types.intc))
is_sound = types.ExternalFunction("rftsim_is_sound", types.intc(types.intp, types.intp, types.intp))
"""Those of `callbacks`, compiled once."""

head = record_at(block.BLOCK_HEAD)
"""The record BLOCK_HEAD of the block at an address."""
_member_at, _counters_at = record_at(block.MEMBER), record_at(block.COUNTERS)


@exact
def count_bodies(model, m, instance):
    """How many bodies name the instance."""
    nbody = pointer(m + model.nbody)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    n = 0
    for body in range(nbody):
        n += plugins[body] == instance
    return n


@exact
def wanted_state(model, m, instance):
    """Numbers of plugin_state that the implicit force wants."""
    return state.state_size(count_bodies(model, m, instance), pointer(m + model.nv))


@exact
def needed_state(model, m, address):
    """The same of a block, whatever the model says by now of its bodies."""
    return state.state_size(head(address).nbody, pointer(m + model.nv))


@exact
def granted_state(model, m, instance):
    """Numbers of plugin_state that the instance has; none where what the model says of them cannot be."""
    n, end = pointer(m + model.nplugin), pointer(m + model.npluginstate)
    start = int32s(pointer(m + model.plugin_stateadr), n)[instance]
    size = int32s(pointer(m + model.plugin_statenum), n)[instance]
    return int(size) if start >= 0 and 0 <= size <= end - start else 0


@exact
def _slot(data, d, instance):
    """Where mjData keeps the number of an instance's block, (1,)."""
    return int64s(pointer(d + data.plugin_data) + 8 * instance, 1)


@exact
def name(model, m, instance):
    """The address of an instance's name."""
    place = names.start_of(model, m, model.name_pluginadr, pointer(m + model.nplugin), instance)
    return pointer(m + model.names) + place


@inline
def block_of(model, data, m, d, instance):
    """The address of an instance's block; made anew where mjData lost it, as it does when it is pickled, or zero."""
    slot = _slot(data, d, instance)
    number = claims.find(slot[0], d, instance)
    if number < 0:
        if _make_block(m, d, instance) % REASONS != WHY.none:
            return 0
    elif number != slot[0]:
        slot[0] = number
    return claims.address(slot[0])


@exact
def body(address, k):
    """The id of the k-th body of a block."""
    return _member_at(address + _HEAD + _MEMBER * k).body


@exact
def surface(model, m, address, k):
    """The address of the surface of the k-th body of a block."""
    return pointer(m + model.numeric_data) + 8 * _member_at(address + _HEAD + _MEMBER * k).start


@exact
def bed(model, m, address):
    """The address of the bed of a block."""
    return pointer(m + model.numeric_data) + 8 * head(address).bed


@exact
def find_sound(model, m, address, state_size):
    """Whether a block's bed, surfaces and state are still what was checked, or what may take its place.

    The state has to be of the size that the force which is asked for wants. Of a surface of more than LOOK numbers, so
    many are looked at each time, and their sum is compared at the end.
    """
    end, kept = pointer(m + model.nnumericdata), lasting(address)
    if kept.size != state_size:
        return False
    for i in range(kept.size):
        if not abs(kept[i]) <= LARGEST:
            return False
    if head(address).bed > end - BED_NUMBERS:
        return False
    sand = bed(model, m, address)
    if not checks.is_within(sand) or checks.sealed_sum(sand) != head(address).bed_sum:
        return False
    for k in range(head(address).nbody):
        member = _member_at(address + _HEAD + _MEMBER * k)
        if member.start > end - member.size or not _is_same(surface(model, m, address, k), member):
            return False
    return True


@exact
def _is_same(at, member):
    """Whether the surface at an address is still the one that was checked, as far as it is looked at now."""
    header = header_at(at)
    if header.ntri != member.ntri or header.wheel_radius != member.wheel_radius:
        return False
    if checks.sum_of(at, HEADER_NUMBERS) != member.header_sum:
        return False
    n = min(LOOK, member.size - member.looked_at)
    member.sum_so_far += checks.sum_of(at + 8 * member.looked_at, n)
    member.looked_at += n
    if member.looked_at < member.size:
        return True
    found = member.sum_so_far
    member.sum_so_far = member.looked_at = 0
    return found == member.sum


@exact
def spoil(model, data, m, d, instance, address, why):
    """Make the force of an instance NaN, which MuJoCo warns about, and say once why; see WHY."""
    force = doubles(pointer(d + data.qfrc_passive), pointer(m + model.nv))
    for i in range(force.size):
        force[i] = np.nan
    if address == 0:
        return
    wrenches = all_wrenches(address)
    for i in range(wrenches.size):
        wrenches[i] = np.nan
    if head(address).has_complained == 0:
        head(address).has_complained = 1
        external.warn(why, name(model, m, instance))


@exact
def wrench(address, k):
    """The last wrench of the k-th body of a block, (WRENCH,)."""
    return doubles(address + block.wrenches_start(head(address).nbody) + 8 * WRENCH * k, WRENCH)


@exact
def all_wrenches(address):
    """The last wrenches of all bodies of a block, (WRENCH n,)."""
    n = head(address).nbody
    return doubles(address + block.wrenches_start(n), WRENCH * n)


@exact
def mark(address, k):
    """The numbers that were left in cfrc_ext for the k-th body of a block, (WRENCH,)."""
    return doubles(address + block.marks_start(head(address).nbody) + 8 * WRENCH * k, WRENCH)


@exact
def counters(address):
    """The address of a block's counters."""
    return address + block.counters_start(head(address).nbody)


@exact
def count(address, evaluations):
    """Set the cost of the last force of a block to so many evaluations and nothing else."""
    counted = _counters_at(counters(address))
    counted.evaluations, counted.derivatives, counted.unsolved = evaluations, 0.0, 0.0


@exact
def add_work(address, work, share):
    """Add a share of the cost of a solution, a record of the solver's WORK, to that of the last force of a block."""
    counted = _counters_at(counters(address))
    counted.evaluations += share * work[0]
    counted.derivatives += share * work[1]
    counted.unsolved += work[2]


@exact
def pending(address, size):
    """The state after the step under way, (size,)."""
    return doubles(address + block.state_start(head(address).nbody), size)


@exact
def lasting(address):
    """The state after the last step, a view of MuJoCo's plugin_state."""
    return doubles(head(address).state, head(address).state_size)


@exact
def initialise(model, data, m, d, instance):
    """Make the block of an instance; what is wrong, see WHY, and the address of the name of what that is wrong with."""
    bodies, state_size = count_bodies(model, m, instance), granted_state(model, m, instance)
    words = block.state_start(bodies) // 8 + state_size
    number = claims.make(-1, d, instance, words)
    if number < 0:
        return WHY.memory, name(model, m, instance)
    address = claims.address(number)
    blank = int64s(address, words)
    for i in range(words):
        blank[i] = 0
    start = int32s(pointer(m + model.plugin_stateadr), pointer(m + model.nplugin))[instance]
    head(address).state = pointer(d + data.plugin_state) + 8 * start
    head(address).state_size = state_size
    why, whose = _check(model, m, instance, address)
    if why != WHY.none:
        claims.drop(number)
    else:
        _slot(data, d, instance)[0] = number
    return why, whose


@exact
def _check(model, m, instance, address):
    """Fill a block's head and members; what is wrong with the model's numbers, and the address of a name."""
    nbody, text = pointer(m + model.nbody), pointer(m + model.names)
    own = name(model, m, instance)
    start, bed_name, why = checks.check_bed(model, m, own - text)
    if why != WHY.none:
        return why, own
    if not checks.sensors_have_room(model, m, instance):
        return WHY.sensor, own
    head(address).bed = start
    head(address).bed_sum = checks.sealed_sum(bed(model, m, address))
    plugins, found = int32s(pointer(m + model.body_plugin), nbody), 0
    for each in range(nbody):
        owner = names.start_of(model, m, model.name_bodyadr, nbody, each)
        if plugins[each] < 0 and checks.has_surface(model, m, owner):
            return WHY.plugin, text + owner
        if plugins[each] == instance:
            if not _fill_member(model, m, address, found, each, owner, bed_name):
                return WHY.surface, text + owner
            found += 1
    head(address).nbody = found
    return WHY.none, own


@exact
def _fill_member(model, m, address, k, each, owner, bed_name):
    """Fill the k-th member of a block; whether the body has the surface that was written for it."""
    start, size = checks.check_surface(model, m, owner, head(address).bed, bed_name)
    if start < 0:
        return False
    member, at = _member_at(address + _HEAD + _MEMBER * k), pointer(m + model.numeric_data) + 8 * start
    member.body, member.start, member.size, member.sum = each, start, size, checks.sum_of(at, size)
    member.header_sum, member.looked_at, member.sum_so_far = checks.sum_of(at, HEADER_NUMBERS), 0, 0
    member.ntri, member.wheel_radius = header_at(at).ntri, header_at(at).wheel_radius
    return True


@exact
def destroy(data, d, instance):
    """Release the block of an instance."""
    number = claims.find(_slot(data, d, instance)[0], d, instance)
    if number >= 0:
        claims.drop(number)


@exact
def copy(model, data, target, m, origin, instance):
    """Give another mjData a copy of the block; where there is none to copy, it makes its own when it needs one."""
    address = block_of(model, data, m, origin, instance)
    if address == 0:
        return
    size = claims.words(_slot(data, origin, instance)[0])
    number = claims.make(_slot(data, target, instance)[0], target, instance, size)
    if number < 0:
        return
    original, fresh = int64s(address, size), int64s(claims.address(number), size)
    for i in range(size):
        fresh[i] = original[i]
    start = head(address).state - pointer(origin + data.plugin_state)
    head(claims.address(number)).state = pointer(target + data.plugin_state) + start
    _slot(data, target, instance)[0] = number


@exact
def forget(address):
    """Clear the wrenches, marks and counters of the block at an address."""
    first = block.wrenches_start(head(address).nbody)
    past = doubles(address + first, (counters(address) - address - first) // 8 + _COUNTERS)
    for i in range(past.size):
        past[i] = 0.0


@inline
def keep(model, data, m, d, instance):
    """End a step: what it left pending lasts, and its work is counted."""
    address = block_of(model, data, m, d, instance)
    if address == 0:
        return
    now = lasting(address)
    waiting = pending(address, now.size)
    for i in range(now.size):
        now[i] = waiting[i]
    counted = _counters_at(counters(address))
    counted.steps += 1.0
    counted.all_evaluations += counted.evaluations
    counted.all_derivatives += counted.derivatives
    counted.all_unsolved += counted.unsolved
