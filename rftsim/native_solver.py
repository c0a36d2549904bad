"""The solver of the implicit force as a function of plain addresses; see `native`."""

from typing import Any, Final

import numpy as np
from numba import cfunc, njit, types

from rftsim import implicit
from rftsim.compiled import SOURCE
from rftsim.implicit import Bodies, Rows, Step
from rftsim.memory import doubles, int64s
from rftsim.native import publish
from rftsim.native_ahead import FRAME
from rftsim.packed import SAND_SIZE

_SIGNATURE: Final = types.void(types.intp, types.float64)
_solve = types.ExternalFunction("rftsim_solve", _SIGNATURE)
_ENTRIES: Final = 28


@njit
def solve(step, last, foreseen, g, known, count):
    """Predict from the last velocity and the force foreseen there, and solve; see `implicit.solve`.

    Returns:
        The velocity, (nv,), the wrenches, (nbody, 12), whether g holds derivatives, whether the equation is solved.
    """
    b, r = step.bodies, step.rows
    v, wrench, flags = np.empty(step.start.size), np.empty((b.length.size, 12)), np.empty(2)
    flags[0] = 1.0 if known else 0.0
    a = np.empty(_ENTRIES, np.int64)
    a[0], a[1], a[2] = b.length.size, step.start.size, r.kind.size
    a[3], a[4], a[5] = b.jacobian.ctypes.data, b.rotation.ctypes.data, b.frame.ctypes.data
    a[6], a[7], a[8] = b.length.ctypes.data, b.surface.ctypes.data, b.sand.ctypes.data
    a[9], a[10], a[11] = r.jacobian.ctypes.data, r.acceleration.ctypes.data, r.stiffness.ctypes.data
    a[12], a[13], a[14] = r.reference.ctypes.data, r.kind.ctypes.data, r.bound.ctypes.data
    a[15], a[16] = r.damping.ctypes.data, r.spring.ctypes.data
    a[17], a[18], a[19] = step.mass.ctypes.data, step.inverse.ctypes.data, step.start.ctypes.data
    a[20], a[21], a[22] = step.tau.ctypes.data, last.ctypes.data, foreseen.ctypes.data
    a[23], a[24] = g.ctypes.data, count.ctypes.data
    a[25], a[26], a[27] = v.ctypes.data, wrench.ctypes.data, flags.ctypes.data
    _solve(a.ctypes.data, step.h)
    a[0] = g.size + count.size + last.size + foreseen.size + step.start.size  # all live until here
    return v, wrench, flags[0] > 0.0, flags[1] > 0.0


def _make(source: str) -> dict[str, Any]:
    """The function by name; it closes over `source`, see `compiled.SOURCE`."""

    @cfunc(_SIGNATURE, cache=True)
    def rftsim_solve(block, h):
        a = int64s(block, _ENTRIES if source else 0)
        nb, nv, n = a[0], a[1], a[2]
        bodies = Bodies(
            doubles(a[3], nb * 6 * nv).reshape(nb, 6, nv),
            doubles(a[4], nb * 9).reshape(nb, 9),
            doubles(a[5], nb * FRAME).reshape(nb, FRAME),
            doubles(a[6], nb),
            int64s(a[7], nb * 2).reshape(nb, 2),
            doubles(a[8], SAND_SIZE),
        )
        rows = Rows(
            doubles(a[9], n * nv).reshape(n, nv),
            doubles(a[10], n * nv).reshape(n, nv),
            doubles(a[11], n),
            doubles(a[12], n),
            int64s(a[13], n),
            doubles(a[14], n),
            doubles(a[15], n),
            doubles(a[16], n),
        )
        mass, inverse = doubles(a[17], nv * nv).reshape(nv, nv), doubles(a[18], nv * nv).reshape(nv, nv)
        step = Step(bodies, rows, mass, inverse, doubles(a[19], nv), h, doubles(a[20], nv))
        last, foreseen = doubles(a[21], nv).copy(), doubles(a[22], nv)
        g, flags = doubles(a[23], nb * 36).reshape(nb, 6, 6), doubles(a[27], 2)
        known = flags[0] > 0.0
        guess = implicit.predict(step, last, foreseen, g, known)
        point, known, solved = implicit.solve(step, guess, last, g, known, doubles(a[24], 3))
        v, wrench = doubles(a[25], nv), doubles(a[26], nb * 12).reshape(nb, 12)
        for i in range(nv):
            v[i] = point.v[i]
        for b in range(nb):
            for k in range(12):
                wrench[b, k] = point.wrench[b, k]
        flags[0], flags[1] = 1.0 if known else 0.0, 1.0 if solved else 0.0

    return {"rftsim_solve": rftsim_solve}


publish(_make(SOURCE))
