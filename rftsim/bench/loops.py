"""Compiled loops whose time is measured, or whose instructions are counted."""

import numba  # not `from`: what measures the package is not part of what its machine code is made from

from rftsim.law import evaluate as laws
from rftsim.law import exports, sums
from rftsim.law.body import body_at, frame_over, header_at, medium_of
from rftsim.law.grounds import plane
from rftsim.law.laws import CUBIC
from rftsim.law.leading import SHARP, Edge
from rftsim.machine import link
from rftsim.machine.targets import TARGETS

_AS_SHIPPED = next(filter(link.runs, TARGETS["law"]), None)
if _AS_SHIPPED:  # nothing here is compiled for wider or narrower vectors than the law is
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = _AS_SHIPPED.name, _AS_SHIPPED.tuned
laws.linked()("rftsim_wrench")  # by which name compiled code finds it from here on
_sums = sums.sums(CUBIC, plane(CUBIC))


@numba.njit
def evaluate(sand, surface, position, turn, velocity, omega, out, count):
    """The wrench on a body, evaluated so many times, into out (6,)."""
    for _ in range(count):
        exports.wrench(
            sand.ctypes.data,
            surface.ctypes.data,
            position.ctypes.data,
            turn.ctypes.data,
            velocity.ctypes.data,
            omega.ctypes.data,
            out.ctypes.data,
        )


@numba.njit(error_model="numpy")
def law_loop(sand, surface, position, turn, velocity, omega):
    """The loop of 3D-RFT alone, whose instructions are counted."""
    at, edge = surface.ctypes.data, Edge(header_at(surface.ctypes.data).edge_on, SHARP)
    frame = frame_over(sand.ctypes.data, at, position, turn, velocity, omega, 0.0)
    return _sums(body_at(at), frame, sand.ctypes.data, medium_of(sand.ctypes.data), edge)


@numba.njit(fastmath={"contract"}, forceinline=True)
def _eight(a, y):
    a = (((a * y + 0.25) * y + 0.25) * y + 0.25) * y + 0.25
    return (((a * y + 0.25) * y + 0.25) * y + 0.25) * y + 0.25


@numba.njit(fastmath={"contract"}, error_model="numpy")
def polynomials(x, out, count):
    """Four polynomials in each number, none of which waits for another."""
    for _ in range(count):
        for i in range(x.size):
            y = x[i]
            a = _eight(_eight(y, y), y)
            b = _eight(_eight(y + 0.1, y), y)
            c = _eight(_eight(y + 0.2, y), y)
            d = _eight(_eight(y + 0.3, y), y)
            out[i] = a + b + c + d
