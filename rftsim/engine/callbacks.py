"""The callbacks of the two plugins, as compiled functions that MuJoCo calls; see `plugin`."""

from typing import Final

from numba import types

from rftsim.engine import bodies, explicit, implicit, instance, offsets, reactions, sensors
from rftsim.engine.layout import CONSTANTS
from rftsim.law.layout import WRENCH
from rftsim.machine import claims
from rftsim.machine.compiling import inline
from rftsim.machine.exports import address, entry
from rftsim.machine.memory import doubles, int32s
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


@entry(types.intc, address, address, types.intc)
def init(m, d, number):
    """Make an instance's block in new data; -1 where it cannot be."""
    return instance.initialise(offsets.model(), offsets.data(), m, d, number)


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
    """Forget the past of an instance in data that are reset."""
    block = claims.address(memory) if 0 <= memory < PLACES else 0
    if block != 0:
        instance.forget(block)
    lasting = doubles(state, instance.granted_state(offsets.model(), m, number))
    for i in range(lasting.size):
        lasting[i] = 0.0


@entry(types.void, address, address, types.intc)
def advance(m, d, number):
    """End a step of an instance: keep what must last."""
    instance.keep(offsets.model(), offsets.data(), m, d, number)


@entry(types.void, address, address, types.intc)
def add_to_reactions(m, d, number):
    """Add the sand of an instance to cfrc_ext and take it from cfrc_int, as mj_rnePostConstraint left them."""
    model, data = offsets.model(), offsets.data()
    t = bodies.tree(model, data, m, d)
    reactions.add_sand(data, d, t, instance.block_of(model, data, m, d, number))


@entry(types.intc, address, types.intc)
def explicit_nstate(m, number):
    """The number of numbers that last from step to step."""
    return 0


@entry(types.void, address, address, types.intc, types.intc)
def explicit_compute(m, d, number, capability):
    """The passive force at the velocity of the moment, or the sensors."""
    model, data = offsets.model(), offsets.data()
    if capability == _PASSIVE:
        explicit.press(model, data, m, d, number)
        _show(model, data, m, d, number)
    else:
        sensors.read(model, data, m, d, number, False)


@entry(types.intc, address, types.intc)
def implicit_nstate(m, number):
    """The number of numbers that last from step to step."""
    return instance.wanted_state(offsets.model(), m, number)


@entry(types.void, address, address, types.intc, types.intc)
def implicit_compute(m, d, number, capability):
    """The passive force at the end of the step, or the sensors; under RK4 as the explicit one."""
    model, data = offsets.model(), offsets.data()
    if capability != _PASSIVE:
        sensors.read(model, data, m, d, number, not _is_rk4(model, m))
    elif _is_rk4(model, m):
        explicit.press(model, data, m, d, number)
    else:
        implicit.press(model, data, offsets.contact(), m, d, number)
        _show(model, data, m, d, number)
