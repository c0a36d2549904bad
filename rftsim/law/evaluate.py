"""The laws' loops, called from Python."""

import ctypes
import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from rftsim.law.layout import GIVEN, HEADER, record
from rftsim.machine import link
from rftsim.surface.triangles import Array


def linked() -> Callable[[str], int]:
    """Link the laws' machine code into the process; what gives the address of an exported function by its name."""
    return link.load("law", GIVEN)


@functools.cache
def _function(name: str, arguments: int) -> Any:
    """An exported function that takes addresses, and counts, and gives nothing."""
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(linked()(name))


def triangle_stresses(
    bed: Array, surface: Array, xpos: Any, xmat: Any, velocity: Any, omega: Any
) -> tuple[Array, Array]:
    """Each triangle's stress [Pa] in the body frame, (ntri, 3), and effective depth [m], (ntri,)."""
    ntri = int(record(surface, HEADER).ntri)
    arrays = [np.ascontiguousarray(x, dtype=float) for x in (bed, surface, xpos, xmat, velocity, omega)]
    stress, depth = np.empty((ntri, 3)), np.empty(ntri)
    _function("rftsim_tractions", 8)(*(array.ctypes.data for array in (*arrays, stress, depth)))
    return stress, depth


def body_wrenches(bed: Array, surface: Array, xpos: Array, xmat: Array, velocity: Array, omega: Array) -> Array:
    """Force [N] and moment about the body's origin [N m], world frame, (n, 6).

    Args:
        bed: Packed sand.
        surface: Packed surface.
        xpos: Positions of the body's origin [m], (n, 3).
        xmat: Rotations to the world frame, (n, 3, 3).
        velocity: Velocities of the body's origin [m/s], (n, 3).
        omega: Angular velocities, world frame [rad/s], (n, 3).
    """
    out = np.empty((len(xpos), 6))
    arrays = [*(np.ascontiguousarray(x, dtype=float) for x in (xpos, xmat, velocity, omega)), out]
    fixed = bed.ctypes.data, surface.ctypes.data, len(out)
    _function("rftsim_wrenches", 8)(*fixed, *(array.ctypes.data for array in arrays))
    return out
