"""The laws' loops as functions of plain addresses: compiled once, called by name from compiled code and from Python.

Numba links whatever a compiled function calls into it and optimises all of it again, level by level. The loops are the
bulk of the code, so everything above them calls them through these names instead.

Addresses are of packed sand, packed surface, xpos (3,), xmat (9,), and so on, all float64.
"""

import ctypes
from typing import Any, Final

import llvmlite.binding as llvm
import numpy as np
from numba import cfunc, njit, types

from rftsim import kernels, packed
from rftsim.compiled import SOURCE
from rftsim.memory import doubles
from rftsim.surface import Array

_address = types.intp
_signatures: Final = {
    "rftsim_wrench": types.void(*[_address] * 7),
    "rftsim_tractions": types.void(*[_address] * 8),
}
wrench = types.ExternalFunction("rftsim_wrench", _signatures["rftsim_wrench"])


@njit(forceinline=True)
def surface_at(address):
    """The packed surface at an address."""
    return doubles(address, packed.size_of(doubles(address, packed.HEADER)))


def _make(source: str) -> dict[str, Any]:
    """The functions by name; each closes over `source`, see `compiled.SOURCE`."""

    @cfunc(_signatures["rftsim_wrench"], cache=True)
    def rftsim_wrench(sand, surface, xpos, xmat, velocity, omega, out):
        """Force and moment about the body's origin, world frame, (6,), at the velocity of the moment."""
        s, body = doubles(sand, packed.SAND_SIZE), surface_at(surface)
        x, r, v, w = doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3)
        total = doubles(out, 6)
        for k in range(6):
            total[k] = 0.0
        if packed.is_clear(s, body, x, r) or not source:
            return
        f, medium = packed.frame_of(s, body, x, r, v, w), packed.medium_of(s, body)
        cx, cy, cz, nx, ny, nz, area = packed.columns(body)
        last = 0
        while last < area.size:
            first, last = packed.next_run(body, last, area.size, f, 0.0)
            if s[0] == 0.0:
                g = kernels.sums_2d(cx, cy, cz, nx, ny, nz, area, first, last, f, medium)
            elif s[0] == 1.0:
                g = kernels.sums_3d(cx, cy, cz, nx, ny, nz, area, first, last, f, medium)
            else:
                g = kernels.sums_3d_quartic(cx, cy, cz, nx, ny, nz, area, first, last, f, medium)
            for part in range(0, 6, 3):
                a, b, c = packed.to_world(r, g[part], g[part + 1], g[part + 2])
                total[part] += a
                total[part + 1] += b
                total[part + 2] += c

    @cfunc(_signatures["rftsim_tractions"], cache=True)
    def rftsim_tractions(sand, surface, xpos, xmat, velocity, omega, stress, depth):
        """Stress of each triangle in the body frame, (ntri, 3), and effective depth, (ntri,)."""
        s, body = doubles(sand, packed.SAND_SIZE), surface_at(surface)
        x, r, v, w = doubles(xpos, 3), doubles(xmat, 9), doubles(velocity, 3), doubles(omega, 3)
        f, medium = packed.frame_of(s, body, x, r, v, w), packed.medium_of(s, body)
        cx, cy, cz, nx, ny, nz, area = packed.columns(body)
        n = area.size if source else 0
        stress_out, depth_out = doubles(stress, 3 * n).reshape(n, 3), doubles(depth, n)
        if s[0] == 0.0:
            kernels.tractions_2d(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)
        elif s[0] == 1.0:
            kernels.tractions_3d(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)
        else:
            kernels.tractions_3d_quartic(cx, cy, cz, nx, ny, nz, f, medium, stress_out, depth_out)

    functions = (rftsim_wrench, rftsim_tractions)
    return {function.__name__: function for function in functions}


def publish(functions: dict[str, Any]) -> dict[str, Any]:
    """Make compiled functions known by name, for as long as the process lives."""
    for name, function in functions.items():
        llvm.add_symbol(name, function.address)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(functions))
    return functions


_FUNCTIONS: Final = publish(_make(SOURCE))


def tractions(sand: Array, body: Array, xpos: Any, xmat: Any, velocity: Any, omega: Any) -> tuple[Array, Array]:
    """Each triangle's stress [Pa] in the body frame, (ntri, 3), and effective depth [m], (ntri,)."""
    ntri = int(body[14])
    arrays = [np.ascontiguousarray(x, dtype=float) for x in (sand, body, xpos, xmat, velocity, omega)]
    stress, depth = np.empty((ntri, 3)), np.empty(ntri)
    _FUNCTIONS["rftsim_tractions"].ctypes(*(array.ctypes.data for array in (*arrays, stress, depth)))
    return stress, depth


def wrenches(sand: Array, body: Array, xpos: Array, xmat: Array, velocity: Array, omega: Array) -> Array:
    """Force [N] and moment about the body's origin [N m], world frame, (n, 6).

    Args:
        sand: Packed sand.
        body: Packed surface.
        xpos: Positions of the body's origin [m], (n, 3).
        xmat: Rotations to the world frame, (n, 3, 3).
        velocity: Velocities of the body's origin [m/s], (n, 3).
        omega: Angular velocities, world frame [rad/s], (n, 3).
    """
    out = np.empty((len(xpos), 6))
    arrays = [*(np.ascontiguousarray(x, dtype=float) for x in (xpos, xmat, velocity, omega)), out]
    rows = zip(*(range(a.ctypes.data, a.ctypes.data + a.nbytes, a.strides[0]) for a in arrays), strict=True)
    fixed = sand.ctypes.data, body.ctypes.data
    for row in rows:
        _FUNCTIONS["rftsim_wrench"].ctypes(*fixed, *row)
    return out
