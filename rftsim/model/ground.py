"""The free surface of a bed as it now is: the plane or terrain of the model, and the ruts that the data remember."""

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rftsim.errors import SceneError
from rftsim.law import layout
from rftsim.model.readout import Instance, instances
from rftsim.sand.free_surface import FreeSurface, slope_normal
from rftsim.sand.terrain import PAD, spline
from rftsim.surface.triangles import Array

Window = tuple[tuple[float, float], tuple[float, float]]
"""Lowest x and y, and highest x and y [m]."""


class Ground:
    """The free surface of a bed, ruts and all, as it was when this was made.

    Attributes:
        plane: The plane of a bed without a terrain, else None.
        spacing: Distance between the values that are known, along x and along y [m]: of the ruts, or of the terrain
            where there are none; None of a plane without ruts.
        window: Where ruts are remembered; else the values of the terrain; None of a plane without ruts.
        displaced: Volume of sand that was displaced so far [m^3].
        left: Volume by which what was left behind the window lies above the free surface [m^3].
    """

    def __init__(self, bed: Instance, state: Array) -> None:
        """Copy the numbers of a bed, and those that the data hold of its ruts, if any."""
        numbers = layout.record(bed.packed, layout.BED)
        self._relief = None if bed.relief is None else bed.relief.copy()
        self._offset = float(numbers.offset)
        up = tuple(numbers.up.tolist())
        self.plane = FreeSurface(self._offset / up[2], up) if self._relief is None else None
        self._cells: Array | None = None
        self.spacing: tuple[float, float] | None = None
        self.window: Window | None = None
        self.displaced = self.left = 0.0
        if self._relief is not None:
            self._describe_terrain()
        if state.size:
            self._describe_ruts(numbers, state)

    def _describe_terrain(self) -> None:
        assert self._relief is not None
        head = layout.record(self._relief, layout.TERRAIN)
        self.spacing = float(head.dx), float(head.dy)
        last = float(head.x + (head.columns - 1) * head.dx), float(head.y + (head.rows - 1) * head.dy)
        self.window = (float(head.x), float(head.y)), last

    def _describe_ruts(self, bed: Any, state: Array) -> None:
        rows, columns, side = int(bed.rows), int(bed.columns), float(bed.spacing)
        head = layout.record(state, layout.RUTS)
        kept = state[layout.RUTS_NUMBERS : layout.RUTS_NUMBERS + rows * columns].reshape(rows, columns)
        first = int(head.row), int(head.column)
        self._cells = np.roll(kept, (-(first[0] % rows), -(first[1] % columns)), axis=(0, 1))
        self.spacing = side, side
        self.window = (
            (first[1] * side, first[0] * side),
            ((first[1] + columns - 1) * side, (first[0] + rows - 1) * side),
        )
        self.displaced, self.left = float(head.moved), float(head.left)

    @property
    def marks(self) -> Array:
        """Height of each cell of the ruts over the free surface [m], (rows, columns) along y and x over the window.

        Raises:
            SceneError: The bed remembers nothing.
        """
        if self._cells is None:
            raise SceneError("this sand remembers nothing: load the model with ruts=True")
        return self._cells.copy()

    def undisturbed_at(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height of the free surface without its ruts over places [m]; x and y [m] of any one shape."""
        return self._undisturbed(x, y)[0]

    def height_at(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height of the surface over places [m]; x and y [m] of any one shape."""
        return self._surface(x, y)[0]

    def normal_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Upward unit normal of the surface over places, shape (..., 3); x and y [m] of any one shape."""
        return slope_normal(*self._surface(x, y)[1:])

    def depth(self, points: ArrayLike) -> Any:
        """Depth of points below the surface along the normal above them [m]: of (3,) a number, of (n, 3) shape (n,)."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        height, *slopes = self._surface(x, y)
        return (height - z) * slope_normal(*slopes)[..., 2]

    def _undisturbed(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        if self.plane is not None:
            n = self.plane.normal
            shape = np.broadcast_shapes(np.shape(x), np.shape(y))
            return self.plane.height_at(x, y), np.full(shape, -n[0] / n[2]), np.full(shape, -n[1] / n[2])
        assert self._relief is not None
        head = layout.record(self._relief, layout.TERRAIN)
        shape = int(head.rows) + 2 * PAD, int(head.columns) + 2 * PAD
        values = self._relief[layout.TERRAIN_NUMBERS :].reshape(shape)
        height, *slopes = spline(values, (head.x, head.y), (head.dx, head.dy), bool(head.repeat), x, y)
        return height + self._offset, slopes[0], slopes[1]

    def _surface(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        """Height [m] and slopes along x and y [-], over places; ruts are in proportion between their cells."""
        height, along, across = self._undisturbed(x, y)
        if self._cells is None or self.spacing is None or self.window is None:
            return height, along, across
        (x0, y0), side = self.window[0], self.spacing[0]
        u, v = (np.asarray(x, dtype=float) - x0) / side, (np.asarray(y, dtype=float) - y0) / side
        rows, columns = self._cells.shape
        inside = (u >= 0.0) & (v >= 0.0) & (u < columns - 1) & (v < rows - 1)
        j, i = np.where(inside, u, 0.0).astype(int), np.where(inside, v, 0.0).astype(int)
        f, g = u - j, v - i
        a, b, c, d = (self._cells[i + r, j + s] for r in (0, 1) for s in (0, 1))
        more = (1 - g) * ((1 - f) * a + f * b) + g * ((1 - f) * c + f * d)
        slopes = ((1 - g) * (b - a) + g * (d - c)) / side, ((1 - f) * (c - a) + f * (d - b)) / side
        return (
            height + np.where(inside, more, 0.0),
            along + np.where(inside, slopes[0], 0.0),
            across + np.where(inside, slopes[1], 0.0),
        )

    @property
    def volume(self) -> float:
        """Volume by which the sand lies above the free surface, in the window and left behind it [m^3]; about zero."""
        if self._cells is None or self.spacing is None:
            return 0.0
        return math.fsum(self._cells.ravel().tolist()) * self.spacing[0] ** 2 + self.left


def ground(model: mujoco.MjModel, data: mujoco.MjData | None = None, bed: str | None = None) -> Ground:
    """The free surface of a model's bed as it now is.

    Args:
        model: A model with sand.
        data: Its data, whose ruts count; without, none do.
        bed: Name of the bed, where the model has several.

    Raises:
        SceneError: The model has no bed, or several and none or another one is named.
    """
    found = {item.name: item for item in instances(model)}
    if bed is None and len(found) == 1:
        bed = next(iter(found))
    if bed not in found:
        names = ", ".join(map(repr, found)) or "none"
        raise SceneError(f"the model has no bed {bed!r}: its beds are {names}" if bed else f"which bed? {names}")
    own = found[bed]
    size = int(layout.ruts_size(own.bed))
    if data is None or not size:
        return Ground(own, np.zeros(0))
    end = int(model.plugin_stateadr[own.id] + model.plugin_statenum[own.id]) - layout.TRACE_NUMBERS * len(own.bodies)
    return Ground(own, data.plugin_state[end - size : end].copy())
