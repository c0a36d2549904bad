"""The sand's force at the velocity of the moment."""

from numba import njit

from rftsim.engine import block, bodies, instance
from rftsim.law import exports
from rftsim.machine.memory import doubles, pointer, room


@njit(forceinline=True)
def press(model, data, m, d, number):
    """Evaluate the sand on every body of the instance and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    table, wrenches = instance.table(address), instance.wrenches(address)
    sand = instance.numeric(model, m, table[1])
    t = bodies.tree(model, data, m, d)
    force = doubles(pointer(d + data.qfrc_passive), pointer(m + model.nv))
    v, w = doubles(room(3), 3), doubles(room(3), 3)
    for k in range(table[0]):
        body = table[block.HEAD + 2 * k]
        surface = instance.numeric(model, m, table[block.HEAD + 2 * k + 1])
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3]
        r = t.xmat[9 * body : 9 * body + 9].ctypes.data
        f = wrenches[block.WRENCH * k : block.WRENCH * (k + 1)]
        own = sand.ctypes.data, surface.ctypes.data, x.ctypes.data, r, v.ctypes.data, w.ctypes.data, f.ctypes.data
        exports.wrench(*own)
        bodies.add_wrench(t, body, x, (f[0], f[1], f[2]), (f[3], f[4], f[5]), force)
    counted = instance.counters(address)
    counted[0], counted[1], counted[2] = 1.0, 0.0, 0.0
