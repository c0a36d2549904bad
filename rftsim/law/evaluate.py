"""The laws' loops, called from Python."""

import ctypes
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np

from rftsim.law.laws import RESPONSES
from rftsim.law.layout import BED, BED_NUMBERS, GIVEN, HEADER, SAND, record
from rftsim.machine import link
from rftsim.surface.triangles import Array

Flags = np.ndarray[tuple[int], np.dtype[np.bool_]]
SHARE: Final = 1e7
"""Poses times numbers of the surface that are worth a thread of their own: some ten milliseconds."""
ALONG: Final = 1e-6
"""How far the cosine of a face's normal to the plane's is from 1 where it counts as along the plane."""


def linked() -> Callable[[str], int]:
    """Link the laws' machine code into the process; what gives the address of an exported function by its name."""
    return link.load("law", GIVEN)


@functools.cache
def _function(name: str, arguments: int) -> Any:
    """An exported function that takes addresses, and counts, and gives nothing."""
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(linked()(name))


def handle(bed: Array) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """The record SAND of packed sand, by which compiled code finds it, as numbers; it lives no longer than that.

    Args:
        bed: Packed sand, contiguous: a record of BED, and a packed terrain where its surface is a relief.
    """
    sand = np.zeros(1, dtype=SAND)
    sand["bed"] = bed.ctypes.data
    sand["terrain"] = bed.ctypes.data + 8 * BED_NUMBERS if bed.size > BED_NUMBERS else 0
    return sand.view(np.int64)


def triangle_stresses(
    bed: Array, surface: Array, xpos: Any, xmat: Any, velocity: Any, omega: Any
) -> tuple[Array, Array]:
    """Each triangle's stress [Pa] in the body frame, (ntri, 3), and effective depth [m], (ntri,)."""
    ntri = int(record(surface, HEADER).ntri)
    bed, *arrays = [np.ascontiguousarray(x, dtype=float) for x in (bed, surface, xpos, xmat, velocity, omega)]
    stress, depth, sand = np.empty((ntri, 3)), np.empty(ntri), handle(bed)
    _function("rftsim_tractions", 8)(*(array.ctypes.data for array in (sand, *arrays, stress, depth)))
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
    return wrenches_of(bed, surface, np.concatenate([np.ravel(x) for x in (xpos, xmat, velocity, omega)], dtype=float))


def wrenches_of(bed: Array, surface: Array, numbers: Array) -> Array:
    """Force [N] and moment about the body's origin [N m], world frame, (n, 6); many at once on several processors.

    Args:
        bed: Packed sand.
        surface: Packed surface.
        numbers: Of n poses all positions, then all rotations, velocities and angular velocities, shape (18 n,).
    """
    count = len(numbers) // 18
    out = np.empty((count, 6))
    function, start, end = _function("rftsim_wrenches", 8), numbers.ctypes.data, out.ctypes.data
    sand = handle(bed)
    packed = sand.ctypes.data, surface.ctypes.data

    def work(first: int, last: int) -> None:
        at = (start + 24 * first, start + 24 * count + 72 * first)
        then = (start + 96 * count + 24 * first, start + 120 * count + 24 * first)
        function(*packed, last - first, *at, *then, end + 48 * first)

    several = min(count, int(count * surface.size / SHARE))
    if several < 2:
        work(0, count)
        return out
    with ThreadPoolExecutor(min(several, _processors())) as threads:
        ends = np.linspace(0, count, several + 1).astype(int).tolist()
        list(threads.map(work, ends[:-1], ends[1:]))
    return out


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
