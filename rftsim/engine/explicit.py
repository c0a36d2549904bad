"""The sand's force at the velocity of the moment."""

from rftsim.engine import bodies, instance
from rftsim.law import exports
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles, pointer, stack_doubles


@inline
def press(model, data, m, d, number):
    """Evaluate the sand on every body of the instance and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    sand = instance.numeric(model, m, instance.head(address).bed).ctypes.data
    t = bodies.tree(model, data, m, d)
    force = doubles(pointer(d + data.qfrc_passive), pointer(m + model.nv))
    v, w = doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    for k in range(instance.head(address).nbody):
        body = instance.body(address, k)
        surface = instance.numeric(model, m, instance.numeric_of(address, k)).ctypes.data
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3]
        r = t.xmat[9 * body : 9 * body + 9].ctypes.data
        f = instance.wrench(address, k)
        exports.wrench(sand, surface, x.ctypes.data, r, v.ctypes.data, w.ctypes.data, f.ctypes.data)
        bodies.add_wrench(t, body, x, (f[0], f[1], f[2]), (f[3], f[4], f[5]), force)
    instance.count(address, 1.0)
