"""The callbacks of the two plugins, as compiled functions that MuJoCo calls; see `plugin`."""

from typing import Final

from numba import types

from rftsim.engine import (
    bodies,
    checks,
    explicit,
    external,
    implicit,
    instance,
    making,
    offsets,
    reactions,
    rutting,
    sensors,
    sound,
)
from rftsim.engine.layout import CONSTANTS
from rftsim.engine.refusals import WHY
from rftsim.law.layout import WRENCH
from rftsim.machine import claims
from rftsim.machine.compiling import inline
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, int32s, pointer
from rftsim.machine.registry import PLACES

_RK4: Final = CONSTANTS["rk4"]
_PASSIVE: Final = CONSTANTS["passive"]
_NO_SENSORS: Final = CONSTANTS["no_sensors"]


@inline
def _is_rk4(model, m):
    """Whether the integrator is RK4, which asks for the force at states that are not the step's."""
    return int32s(m + model.opt_integrator, 1)[0] == _RK4


@inline
def _show(model, data, m, d, number):
    """Read the wrenches as soon as they are known: between mj_step1 and mj_step2, they are those of this step."""
    if not _is_rk4(model, m) and int32s(m + model.opt_disableflags, 1)[0] & _NO_SENSORS == 0:
        sensors.read_wrenches(model, data, m, d, number)


@entry(types.intc, address, types.intc, types.intc)
def nsensordata(m, number, sensor):
    """The number of numbers of a sensor."""
    return WRENCH


@entry(types.intp, address, address, types.intc)
def make_block(m, d, number):
    """Make the block of an instance; what is wrong, and where the name of that stands, see `instance.REASONS`."""
    model, data = offsets.model(), offsets.data()
    why, name = making.initialise(model, data, m, d, number)
    return why + instance.REASONS * (name - pointer(m + model.names))


@entry(types.intc, address, address, types.intp)
def is_sound(m, block, state_size):
    """Whether the model still has what was checked of it when a block was made, for a force with a state of a size."""
    return 1 if sound.is_sound(offsets.model(), m, block, state_size) else 0


@entry(types.void, address, types.intp, address)
def weigh(numbers, size, out):
    """Fill out with the weight of so many numbers, (1,), always by the same instructions and so the same to the bit."""
    doubles(out, 1)[0] = checks.weigh(numbers, size)


@inline
def _initialise(m, d, number, wanted):
    """Make an instance's block in new data, or raise MuJoCo's error, where the model cannot have it."""
    model, data = offsets.model(), offsets.data()
    why, name = WHY.state, instance.name(model, m, number)
    if instance.granted_state(model, m, number) == wanted + instance.asked_ruts(model, m, number):
        found = make_block(m, d, number)
        why, name = found % instance.REASONS, pointer(m + model.names) + found // instance.REASONS
    if why != WHY.none:
        for other in range(number):
            instance.destroy(data, d, other)
        external.refuse(data, d, why, name)
    return 0 if why == WHY.none else -1


@entry(types.void, address, types.intc)
def destroy(d, number):
    """Release the block of an instance in data that go."""
    instance.destroy(offsets.data(), d, number)


@entry(types.void, address, address, address, types.intc)
def copy(target, m, origin, number):
    """Copy the block of an instance to other data."""
    instance.copy(offsets.model(), offsets.data(), target, m, origin, number)


@entry(types.void, address, address, address, types.intc)
def reset(m, state, memory, number):
    """Forget the past of an instance in data that are reset; what was copied bit by bit may name another's block."""
    model = offsets.model()
    block = claims.address(memory) if 0 <= memory < PLACES else 0
    if block != 0 and instance.head(block).state == state:
        instance.forget(block)
    lasting = doubles(state, instance.granted_state(model, m, number))
    for i in range(lasting.size):
        lasting[i] = 0.0


@entry(types.void, address, address, types.intc)
def advance(m, d, number):
    """End a step of an instance: keep what must last, and mark the sand that remembers."""
    model, data = offsets.model(), offsets.data()
    instance.keep(model, data, m, d, number)
    rutting.remember(model, data, m, d, number)


@entry(types.void, address, address, types.intc)
def add_to_reactions(m, d, number):
    """Add the sand of an instance to cfrc_ext and take it from cfrc_int, as mj_rnePostConstraint left them."""
    model, data = offsets.model(), offsets.data()
    block = instance.block_of(model, data, m, d, number)
    if block != 0:
        reactions.add_sand(data, d, bodies.tree(model, data, m, d), block)


@entry(types.intc, address, types.intc)
def explicit_nstate(m, number):
    """The number of numbers that last from step to step."""
    return instance.asked_ruts(offsets.model(), m, number)


@entry(types.intc, address, address, types.intc)
def explicit_init(m, d, number):
    """Make an instance's block in new data, where its model was made for the explicit force."""
    return _initialise(m, d, number, 0)


@entry(types.void, address, address, types.intc, types.intc)
def explicit_compute(m, d, number, capability):
    """The passive force at the velocity of the moment, or the sensors."""
    model, data = offsets.model(), offsets.data()
    if capability == _PASSIVE:
        explicit.press(model, data, m, d, number, False)
        _show(model, data, m, d, number)
    else:
        sensors.read(model, data, m, d, number, False)


@entry(types.intc, address, types.intc)
def implicit_nstate(m, number):
    """The number of numbers that last from step to step."""
    model = offsets.model()
    return instance.wanted_state(model, m, number) + instance.asked_ruts(model, m, number)


@entry(types.intc, address, address, types.intc)
def implicit_init(m, d, number):
    """Make an instance's block in new data, where its model was made for the implicit force."""
    return _initialise(m, d, number, instance.wanted_state(offsets.model(), m, number))


@entry(types.void, address, address, types.intc, types.intc)
def implicit_compute(m, d, number, capability):
    """The passive force at the end of the step, or the sensors; under RK4 as the explicit one."""
    model, data = offsets.model(), offsets.data()
    if capability != _PASSIVE:
        sensors.read(model, data, m, d, number, not _is_rk4(model, m))
    elif _is_rk4(model, m):
        explicit.press(model, data, m, d, number, True)
    else:
        implicit.press(model, data, offsets.contact(), m, d, number)
        _show(model, data, m, d, number)
