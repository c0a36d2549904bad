"""The sand in MuJoCo's account of forces between bodies, `cfrc_ext` and `cfrc_int`.

MuJoCo makes that account from contacts and applied forces, in mj_rnePostConstraint, and knows nothing of the sand: its
force is a passive one. There each wrench is about the centre of mass of the body's tree, the moment first.
"""

from rftsim.engine import bodies, instance
from rftsim.law.layout import WRENCH
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, pointer, stack_doubles


@exact
def _is_left(now, mark):
    """Whether a body's cfrc_ext is what was left there, and the sand is in it already."""
    same, some = True, False
    for k in range(WRENCH):
        same, some = same and now[k] == mark[k], some or mark[k] != 0.0
    return same and some


@exact
def _about_com(t, body, wrench, out):
    """Fill out with a body's wrench about the centre of mass of its tree, moment first."""
    r, f = bodies.arm(t, body, t.xpos[3 * body : 3 * body + 3]), wrench
    out[0] = f[3] + r[1] * f[2] - r[2] * f[1]
    out[1] = f[4] + r[2] * f[0] - r[0] * f[2]
    out[2] = f[5] + r[0] * f[1] - r[1] * f[0]
    out[3], out[4], out[5] = f[0], f[1], f[2]


@exact
def _add(t, body, wrench, external, internal):
    """Add a body's wrench to what acts on it from outside; what is between it, its ancestors and the world is less."""
    for k in range(WRENCH):
        external[WRENCH * body + k] += wrench[k]
    while True:
        for k in range(WRENCH):
            internal[WRENCH * body + k] -= wrench[k]
        if body == 0:
            break
        body = t.parent[body]


@exact
def add_sand(data, d, t, address):
    """Add the wrenches of the block at an address to cfrc_ext and take them from cfrc_int, unless that is done."""
    size = WRENCH * t.parent.size
    external, internal = doubles(pointer(d + data.cfrc_ext), size), doubles(pointer(d + data.cfrc_int), size)
    wrench = doubles(stack_doubles(WRENCH), WRENCH)
    for k in range(instance.head(address).nbody):
        body, mark = instance.body(address, k), instance.mark(address, k)
        now = external[WRENCH * body : WRENCH * body + WRENCH]
        if not _is_left(now, mark):
            _about_com(t, body, instance.wrench(address, k), wrench)
            _add(t, body, wrench, external, internal)
            for i in range(WRENCH):
                mark[i] = now[i]
