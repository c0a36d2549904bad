"""Compiled loops that are timed."""

import numba  # not `from`: what measures the package is not part of what its machine code is made from

from rftsim.law import exports, kernels, kinematics
from rftsim.machine import link
from rftsim.solver.linear_algebra import FASTMATH

link.load("law")("rftsim_wrench")  # by which name compiled code finds it from here on


@numba.njit
def evaluate(sand, body, position, turn, velocity, omega, out, count):
    """The wrench on a body, so many times."""
    for _ in range(count):
        exports.wrench(
            sand.ctypes.data,
            body.ctypes.data,
            position.ctypes.data,
            turn.ctypes.data,
            velocity.ctypes.data,
            omega.ctypes.data,
            out.ctypes.data,
        )


@numba.njit(fastmath=FASTMATH, error_model="numpy")
def sums(sand, body, position, turn, velocity, omega):
    """The law's loop alone, whose instructions are counted."""
    frame, medium = kinematics.frame_of(sand, body, position, turn, velocity, omega), kinematics.medium_of(sand, body)
    return kernels.sums_3d(body, frame, medium)


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
