"""The laws' loops, called from Python."""

import ctypes
import functools
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from rftsim.law.laws import RESPONSES
from rftsim.law.layout import BED, GIVEN, HEADER, record
from rftsim.machine import link
from rftsim.surface.triangles import Array

Flags = np.ndarray[tuple[int], np.dtype[np.bool_]]
ALONG: Final = 1e-6
"""How far the cosine of a face's normal to the plane's is from 1 where it counts as along the plane."""


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


def acts(bed: Array, normals: Array, xmat: Any, stress: Array, depth: Array) -> Flags:
    """Whether the sand acts on each triangle, shape (ntri,): not above it, behind an edge, or along a 2D law's plane.

    Args:
        bed: Packed sand.
        normals: Outward normals, body frame, shape (ntri, 3).
        xmat: Rotation to the world frame, shape (3, 3).
        stress: Each triangle's stress, shape (ntri, 3).
        depth: Each triangle's depth [m], shape (ntri,).
    """
    sand = record(bed, BED)
    found: Flags = (depth > 0.0) & stress.any(axis=1)
    if RESPONSES[int(sand.response)].planar:
        found &= crosses(normals, sand.plane @ xmat)
    return found


def crosses(normals: Array, plane: Array) -> Flags:
    """Whether each face has a part across a plane of motion, shape (ntri,); without one, a 2D law gives it no force.

    Args:
        normals: Unit normals of the faces, shape (ntri, 3).
        plane: Unit normal of the plane, in the same frame.
    """
    found: Flags = np.abs(normals @ plane) < 1.0 - ALONG
    return found


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
