"""A plugin instance for compiled code: its bodies and its block of memory, see `block`."""

import numpy as np
from numba import types

from rftsim.engine import block, external, names
from rftsim.engine.refusals import WHY
from rftsim.law import field as fields
from rftsim.law.layout import MOST_SIDE, RUTS_NUMBERS, SAND, TRACE, TRACE_NUMBERS, WRENCH, numbers_in
from rftsim.machine import claims
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import bytes_at, doubles, int32s, int64s, pointer
from rftsim.machine.records import record_at
from rftsim.solver import state

_MEMBER = block.MEMBER.itemsize
_HEAD = block.BLOCK_HEAD.itemsize
_COUNTERS = numbers_in(block.COUNTERS)
MOST_RUTS = RUTS_NUMBERS + 2 * MOST_SIDE**2
_ZERO, _NINE = ord("0"), ord("9")
SAND_NUMBERS = numbers_in(SAND)
"""Numbers of the record SAND."""

REASONS = 16
"""What is wrong, of fewer reasons than these, and where the name of that stands, are handed over as one number."""

_make_block = types.ExternalFunction("rftsim_make_block", types.intp(types.intp, types.intp, types.intc))
is_sound = types.ExternalFunction("rftsim_is_sound", types.intc(types.intp, types.intp, types.intp))
"""Those of `callbacks`, compiled once."""

head = record_at(block.BLOCK_HEAD)
"""The record BLOCK_HEAD of the block at an address."""
_member_at, _counters_at = record_at(block.MEMBER), record_at(block.COUNTERS)
_trace_at = record_at(TRACE)


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
def asked_ruts(model, m, instance):
    """Numbers of plugin_state that an instance's ruts ask for, by its attribute; more than MOST_RUTS are none."""
    end, total = pointer(m + model.npluginattr), 0
    text = bytes_at(pointer(m + model.plugin_attr), end)
    at = int32s(pointer(m + model.plugin_attradr), pointer(m + model.nplugin))[instance]
    while 0 <= at < end and _ZERO <= text[at] <= _NINE and total <= MOST_RUTS:
        total, at = 10 * total + (text[at] - _ZERO), at + 1
    return ruts_of(model, m, instance, total if total <= MOST_RUTS else 0)


@exact
def ruts_of(model, m, instance, of_bed):
    """Numbers that ruts remember with what they do of an instance's bodies, from the number of the bed's own."""
    return of_bed + TRACE_NUMBERS * count_bodies(model, m, instance) if of_bed > 0 else 0


@exact
def wanted_state(model, m, instance):
    """Numbers of plugin_state that the implicit force wants, beside ruts."""
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
def slot(data, d, instance):
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
    place = slot(data, d, instance)
    number = claims.find(place[0], d, instance)
    if number < 0:
        if _make_block(m, d, instance) % REASONS != WHY.none:
            return 0
    elif number != place[0]:
        place[0] = number
    return claims.address(place[0])


@inline
def member(address, k):
    """The record MEMBER of the k-th body of a block."""
    return _member_at(address + _HEAD + _MEMBER * k)


@exact
def body(address, k):
    """The id of the k-th body of a block."""
    return member(address, k).body


@exact
def surface(model, m, address, k):
    """The address of the surface of the k-th body of a block, or of another's with the same numbers."""
    return pointer(m + model.numeric_data) + 8 * member(address, k).read


@exact
def own_surface(model, m, address, k):
    """The address of the surface that was written for the k-th body of a block."""
    return pointer(m + model.numeric_data) + 8 * member(address, k).start


@exact
def bed(model, m, address):
    """The address of the bed of a block."""
    return pointer(m + model.numeric_data) + 8 * head(address).bed


@exact
def leave_open(numbers):
    """Fill numbers with NaN, in place."""
    for i in range(numbers.size):
        numbers[i] = np.nan


@exact
def spoil(model, data, m, d, instance, address, why):
    """Make the force of an instance NaN, which MuJoCo warns about, and say once why; see WHY."""
    leave_open(doubles(pointer(d + data.qfrc_passive), pointer(m + model.nv)))
    if address == 0:
        return
    leave_open(all_wrenches(address))
    if head(address).has_complained == 0:
        head(address).has_complained = 1
        external.warn(why, name(model, m, instance))


@exact
def terrain(model, m, address):
    """The address of the terrain of a block, or zero where its bed is a plane."""
    known = head(address)
    return pointer(m + model.numeric_data) + 8 * known.terrain if known.terrain_size > 0 else 0


@exact
def ruts(address):
    """The address of the ruts of a block, behind the state that lasts, or zero where its bed remembers nothing."""
    known = head(address)
    return known.state + 8 * known.state_size if known.ruts_size > 0 else 0


@exact
def trace(address, k):
    """The record TRACE of the k-th body of a block, behind its ruts."""
    known = head(address)
    return _trace_at(ruts(address) + 8 * (known.ruts_size - TRACE_NUMBERS * (known.nbody - k)))


@exact
def fill_sand(model, m, address, out):
    """Fill the record SAND at an address with where the sand of a block lies now."""
    sand = fields.sand_at(out)
    sand.bed, sand.terrain, sand.ruts = bed(model, m, address), terrain(model, m, address), ruts(address)


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
def destroy(data, d, instance):
    """Release the block of an instance."""
    number = claims.find(slot(data, d, instance)[0], d, instance)
    if number >= 0:
        claims.drop(number)


@exact
def copy(model, data, target, m, origin, instance):
    """Give another mjData a copy of the block; where there is none to copy, it makes its own when it needs one."""
    address = block_of(model, data, m, origin, instance)
    if address == 0:
        return
    size = claims.words(slot(data, origin, instance)[0])
    number = claims.make(slot(data, target, instance)[0], target, instance, size)
    if number < 0:
        return
    original, fresh = int64s(address, size), int64s(claims.address(number), size)
    for i in range(size):
        fresh[i] = original[i]
    start = head(address).state - pointer(origin + data.plugin_state)
    head(claims.address(number)).state = pointer(target + data.plugin_state) + start
    slot(data, target, instance)[0] = number


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
