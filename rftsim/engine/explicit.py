"""The sand's force at the velocity of the moment."""

from typing import Final

from rftsim.engine import bodies, instance
from rftsim.engine.refusals import WHY
from rftsim.law import exports
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles, pointer, stack_doubles

_SAND: Final = instance.SAND_NUMBERS


@inline
def press(model, data, m, d, number, is_for_implicit):
    """Evaluate the sand on every body of an instance of one of the two forces, and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    size = instance.needed_state(model, m, address) if address != 0 and is_for_implicit else 0
    if address == 0 or instance.is_sound(m, address, size) == 0:
        instance.spoil(model, data, m, d, number, address, WHY.changed)
        return
    sand = stack_doubles(_SAND)
    instance.fill_sand(model, m, address, sand)
    t = bodies.tree(model, data, m, d)
    force = doubles(pointer(d + data.qfrc_passive), pointer(m + model.nv))
    v, w = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    for k in range(instance.head(address).nbody):
        body, surface = instance.body(address, k), instance.surface(model, m, address, k)
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3]
        r = t.xmat[9 * body : 9 * body + 9].ctypes.data
        f = instance.wrench(address, k)
        instance.leave_open(f)
        exports.wrench(sand, surface, x.ctypes.data, r, v.ctypes.data, w.ctypes.data, f.ctypes.data)
        bodies.add_wrench(t, body, x, (f[0], f[1], f[2]), (f[3], f[4], f[5]), force)
    instance.count(address, 1.0)
