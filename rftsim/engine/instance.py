"""A plugin instance for compiled code: its bodies and its block of memory, see `block`."""

from rftsim.engine import block
from rftsim.engine.block import BODY_MARKER, SAND_MARKER
from rftsim.law.layout import BED, WRENCH, numbers_in
from rftsim.machine import claims
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import characters, doubles, int32s, int64s, pointer
from rftsim.machine.records import record_at
from rftsim.solver import state

_BODY_MARKER, _SAND_MARKER = BODY_MARKER.encode(), SAND_MARKER.encode()
_BED = numbers_in(BED)
_MEMBER = block.MEMBER.itemsize
_HEAD = block.BLOCK_HEAD.itemsize
_COUNTERS = numbers_in(block.COUNTERS)

head = record_at(block.BLOCK_HEAD)
"""The record BLOCK_HEAD of the block at an address."""
_member_at, _counters_at = record_at(block.MEMBER), record_at(block.COUNTERS)


@exact
def _is_marked(names, numeric, marker, owner):
    """Whether the name at `numeric` is the name at `owner` with the marker inserted somewhere."""
    same = 0
    while names[numeric + same] != 0 and names[numeric + same] == names[owner + same]:
        same += 1
    for start in range(same + 1):
        k = 0
        while k < len(marker) and names[numeric + start + k] == marker[k]:
            k += 1
        if k < len(marker):
            continue
        i = start
        while names[owner + i] != 0 and names[numeric + i + k] == names[owner + i]:
            i += 1
        if names[owner + i] == 0 and names[numeric + i + k] == 0:
            return True
    return False


@exact
def _find_numeric(model, m, marker, owner):
    names = characters(pointer(m + model.names))
    count = pointer(m + model.nnumeric)
    address = int32s(pointer(m + model.name_numericadr), count)
    for i in range(count):
        if _is_marked(names, address[i], marker, owner):
            return i
    return -1


@exact
def numeric(model, m, i):
    """A numeric field of the model, as a view."""
    count = pointer(m + model.nnumeric)
    start = int32s(pointer(m + model.numeric_adr), count)[i]
    size = int32s(pointer(m + model.numeric_size), count)[i]
    return doubles(pointer(m + model.numeric_data) + 8 * start, size)


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
def granted_state(model, m, instance):
    """Numbers of plugin_state that the instance has."""
    return int32s(pointer(m + model.plugin_statenum), pointer(m + model.nplugin))[instance]


@exact
def _slot(data, d, instance):
    """Where mjData keeps the number of an instance's block, (1,)."""
    return int64s(pointer(d + data.plugin_data) + 8 * instance, 1)


@inline
def block_of(model, data, m, d, instance):
    """The address of an instance's block; made anew where mjData lost it, as it does when it is pickled."""
    slot = _slot(data, d, instance)
    number = claims.find(slot[0], d, instance)
    if number < 0:
        initialise(model, data, m, d, instance)
    elif number != slot[0]:
        slot[0] = number
    return claims.address(slot[0])


@exact
def body(address, k):
    """The id of the k-th body of a block."""
    return _member_at(address + _HEAD + _MEMBER * k).body


@exact
def numeric_of(address, k):
    """The numeric of the surface of the k-th body of a block."""
    return _member_at(address + _HEAD + _MEMBER * k).numeric


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
def _words(model, m, instance):
    """Words of an instance's block."""
    start = block.state_start(count_bodies(model, m, instance))
    return start // 8 + granted_state(model, m, instance)


@exact
def lasting(model, data, m, d, instance):
    """The state after the last step, a view of MuJoCo's plugin_state."""
    start = int32s(pointer(m + model.plugin_stateadr), pointer(m + model.nplugin))[instance]
    return doubles(pointer(d + data.plugin_state) + 8 * start, granted_state(model, m, instance))


@exact
def initialise(model, data, m, d, instance):
    """Make the block of an instance; -1 where a body or the bed has no numbers."""
    words = _words(model, m, instance)
    number = claims.make(-1, d, instance, words)
    if number < 0:
        return -1
    address = claims.address(number)
    blank = int64s(address, words)
    for i in range(words):
        blank[i] = 0
    if not _find_numerics(model, m, instance, address):
        claims.drop(number)
        return -1
    _slot(data, d, instance)[0] = number
    return 0


@exact
def _find_numerics(model, m, instance, address):
    """Fill a block's head and members; whether the bed and each body have numbers."""
    nbody = pointer(m + model.nbody)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    names = int32s(pointer(m + model.name_bodyadr), nbody)
    instances = int32s(pointer(m + model.name_pluginadr), pointer(m + model.nplugin))
    bed = _find_numeric(model, m, _SAND_MARKER, instances[instance])
    head(address).bed, found = bed, 0
    complete = bed >= 0 and numeric(model, m, bed).size == _BED
    for body in range(nbody):
        if plugins[body] == instance:
            member = _member_at(address + _HEAD + _MEMBER * found)
            member.body, member.numeric = body, _find_numeric(model, m, _BODY_MARKER, names[body])
            complete = complete and member.numeric >= 0
            found += 1
    head(address).nbody = found
    return complete


@exact
def destroy(data, d, instance):
    """Release the block of an instance."""
    number = claims.find(_slot(data, d, instance)[0], d, instance)
    if number >= 0:
        claims.drop(number)


@exact
def copy(model, data, target, m, origin, instance):
    """Give another mjData a copy of the block."""
    size = _words(model, m, instance)
    original = int64s(block_of(model, data, m, origin, instance), size)
    number = claims.make(_slot(data, target, instance)[0], target, instance, size)
    fresh = int64s(claims.address(number), size)
    for i in range(size):
        fresh[i] = original[i]
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
    now = lasting(model, data, m, d, instance)
    waiting = pending(address, now.size)
    for i in range(now.size):
        now[i] = waiting[i]
    counted = _counters_at(counters(address))
    counted.steps += 1.0
    counted.all_evaluations += counted.evaluations
    counted.all_derivatives += counted.derivatives
    counted.all_unsolved += counted.unsolved
