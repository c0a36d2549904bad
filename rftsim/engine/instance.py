"""A plugin instance for compiled code: its bodies and its block of memory, see `block`."""

from numba import njit

from rftsim.engine.block import BODY_MARKER, COUNTERS, HEAD, SAND_MARKER, SIZE, WRENCH
from rftsim.law.layout import SAND_SIZE
from rftsim.machine import claims
from rftsim.machine.memory import characters, doubles, int32s, int64s, pointer
from rftsim.solver import state

_BODY_MARKER, _SAND_MARKER = BODY_MARKER.encode(), SAND_MARKER.encode()


@njit
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


@njit
def _find_numeric(model, m, marker, owner):
    names = characters(pointer(m + model.names))
    count = pointer(m + model.nnumeric)
    address = int32s(pointer(m + model.name_numericadr), count)
    for i in range(count):
        if _is_marked(names, address[i], marker, owner):
            return i
    return -1


@njit
def numeric(model, m, i):
    """A numeric field of the model, as a view."""
    count = pointer(m + model.nnumeric)
    start = int32s(pointer(m + model.numeric_adr), count)[i]
    size = int32s(pointer(m + model.numeric_size), count)[i]
    return doubles(pointer(m + model.numeric_data) + SIZE * start, size)


@njit
def count_bodies(model, m, instance):
    """How many bodies name the instance."""
    nbody = pointer(m + model.nbody)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    n = 0
    for body in range(nbody):
        n += plugins[body] == instance
    return n


@njit
def wanted_state(model, m, instance):
    """Numbers of plugin_state that the implicit force wants."""
    return state.state_size(count_bodies(model, m, instance), pointer(m + model.nv))


@njit
def state_size(model, m, instance):
    """Numbers of plugin_state that the instance has."""
    return int32s(pointer(m + model.plugin_statenum), pointer(m + model.nplugin))[instance]


@njit
def _slot(data, d, instance):
    """Where mjData keeps the number of an instance's block, (1,)."""
    return int64s(pointer(d + data.plugin_data) + SIZE * instance, 1)


@njit(forceinline=True)
def block_of(model, data, m, d, instance):
    """The address of an instance's block; made anew where mjData lost it, as it does when it is pickled."""
    slot = _slot(data, d, instance)
    number = claims.find(slot[0], d, instance)
    if number < 0:
        initialise(model, data, m, d, instance)
    elif number != slot[0]:
        slot[0] = number
    return claims.address(slot[0])


@njit
def table(address):
    """The integers of a block."""
    return int64s(address, HEAD + 2 * pointer(address))


@njit
def wrenches(address):
    """The last wrench of each body, (6 n,)."""
    n = pointer(address)
    return doubles(address + SIZE * (HEAD + 2 * n), WRENCH * n)


@njit
def counters(address):
    """The counters of a block, (COUNTERS,)."""
    n = pointer(address)
    return doubles(address + SIZE * (HEAD + (2 + WRENCH) * n), COUNTERS)


@njit
def pending(address, size):
    """The state after the step under way, (size,)."""
    n = pointer(address)
    return doubles(address + SIZE * (HEAD + (2 + WRENCH) * n + COUNTERS), size)


@njit
def lasting(model, data, m, d, instance):
    """The state after the last step, a view of MuJoCo's plugin_state."""
    start = int32s(pointer(m + model.plugin_stateadr), pointer(m + model.nplugin))[instance]
    return doubles(pointer(d + data.plugin_state) + SIZE * start, state_size(model, m, instance))


@njit
def initialise(model, data, m, d, instance):
    """Make the block of an instance; -1 where a body or the bed has no numbers."""
    n = count_bodies(model, m, instance)
    nbody = pointer(m + model.nbody)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    names = int32s(pointer(m + model.name_bodyadr), nbody)
    instances = int32s(pointer(m + model.name_pluginadr), pointer(m + model.nplugin))
    words = HEAD + (2 + WRENCH) * n + COUNTERS + state_size(model, m, instance)
    number = claims.make(-1, d, instance, words)
    if number < 0:
        return -1
    address = claims.address(number)
    blank = int64s(address, words)
    for i in range(words):
        blank[i] = 0
    blank[0] = n
    entries = table(address)
    entries[1] = _find_numeric(model, m, _SAND_MARKER, instances[instance])
    complete = entries[1] >= 0 and numeric(model, m, entries[1]).size == SAND_SIZE
    k = HEAD
    for body in range(nbody):
        if plugins[body] == instance:
            entries[k] = body
            entries[k + 1] = _find_numeric(model, m, _BODY_MARKER, names[body])
            complete = complete and entries[k + 1] >= 0
            k += 2
    if not complete:
        claims.drop(number)
        return -1
    _slot(data, d, instance)[0] = number
    return 0


@njit
def destroy(data, d, instance):
    """Release the block of an instance."""
    number = claims.find(_slot(data, d, instance)[0], d, instance)
    if number >= 0:
        claims.drop(number)


@njit
def copy(model, data, target, m, origin, instance):
    """Give another mjData a copy of the block."""
    size = HEAD + (2 + WRENCH) * count_bodies(model, m, instance) + COUNTERS + state_size(model, m, instance)
    block = int64s(block_of(model, data, m, origin, instance), size)
    number = claims.make(_slot(data, target, instance)[0], target, instance, size)
    fresh = int64s(claims.address(number), size)
    for i in range(size):
        fresh[i] = block[i]
    _slot(data, target, instance)[0] = number


@njit
def forget(address):
    """Clear the wrenches and counters."""
    for values in (wrenches(address), counters(address)):
        for i in range(values.size):
            values[i] = 0.0


@njit(forceinline=True)
def keep(model, data, m, d, instance):
    """End a step: what it left pending lasts, and its work is counted."""
    address = block_of(model, data, m, d, instance)
    now = lasting(model, data, m, d, instance)
    waiting = pending(address, now.size)
    for i in range(now.size):
        now[i] = waiting[i]
    counted = counters(address)
    counted[3] += 1.0
    for k in range(3):
        counted[4 + k] += counted[k]
