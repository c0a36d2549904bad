"""The sand's tractions as arrows that can be read: where triangles are many, one for each patch of neighbours."""

from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.readout import instances, tractions
from rftsim.surface.triangles import Array

MOST: Final = 20
"""Most arrows on a body."""
PATCH: Final = 0.02
"""Side of the smallest patch whose triangles share an arrow, over the extent of what can move."""
GROWTH: Final = 1.25
"""Factor by which patches grow until there are few enough."""
FAINTEST: Final = 0.1
"""Traction, over the largest, below which none is drawn."""
DIGITS: Final = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Digits of round numbers."""


class Patches(NamedTuple):
    """Mean tractions of neighbouring triangles of a body that face one way."""

    centre: Array
    """Middle of the triangles, by area [m], shape (n, 3), world frame."""
    stress: Array
    """Mean traction [Pa], shape (n, 3), world frame."""
    area: Array
    """Area of the triangles [m^2], shape (n,)."""


def patches(model: mujoco.MjModel, data: mujoco.MjData, extent: float) -> Patches:
    """The tractions on all bodies, as of the last mj_forward or mj_step of the data.

    Each active triangle of a body is one patch where there are few; else patches grow until they are `MOST`, or fewer.
    They are fixed to the bodies.

    Args:
        model: Compiled, with or without sand.
        data: Its data.
        extent: The extent of what can move [m].
    """
    found = [_patches(model, data, body, PATCH * extent) for bed in instances(model) for body in bed.bodies]
    together = np.concatenate([np.empty((0, 7)), *found])
    return Patches(together[:, :3], together[:, 3:6], together[:, 6])


def _patches(model: mujoco.MjModel, data: mujoco.MjData, body: int, size: float) -> Array:
    """Of each patch of a body: centre, mean stress and area, (n, 7); the smallest have a side [m]."""
    pressed = _pressed(model, data, body)
    keys, area = np.arange(len(pressed)), pressed[:, 6]
    while keys.size and keys.max() >= MOST:
        keys, size = _numbered(pressed[:, 7:], size), GROWTH * size
    total = np.bincount(keys, area)
    means = [np.bincount(keys, area * column) / total for column in pressed[:, :6].T]
    return np.column_stack([*means, total])


def _pressed(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> Array:
    """Of each active triangle of a body: centre, stress, area, centre in the body's frame and side, (n, 11)."""
    one = tractions(model, data, body)
    turn = data.xmat[body].reshape(3, 3)
    facing = one.normal @ turn
    axis = np.abs(facing).argmax(axis=1)
    side = 2.0 * axis + (facing[np.arange(len(axis)), axis] > 0.0)
    place = (one.centre - data.xpos[body]) @ turn
    return np.column_stack([one.centre, one.stress, one.area, place, side])[one.active]


def _numbered(placed: Array, size: float) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """The number of the patch of a size [m] that each triangle lies in, by its place and side, (n, 4)."""
    key = np.column_stack([np.floor(placed[:, :3] / size), placed[:, 3]])
    return np.unique(key, axis=0, return_inverse=True)[1].ravel()


def round_up(x: float) -> float:
    """The smallest of some digits times a power of ten that is not below x."""
    power = 10.0 ** np.floor(np.log10(x))
    return float(next(digit * power for digit in DIGITS if digit * power >= x * (1.0 - 1e-9)))


def said(pressure: float) -> str:
    """A pressure in words, as people write it."""
    for unit, size in (("MPa", 1e6), ("kPa", 1e3)):
        if pressure >= size:
            return f"{pressure / size:g} {unit}"
    return f"{pressure:g} Pa"
