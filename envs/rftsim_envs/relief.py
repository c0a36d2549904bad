"""The relief of the ground: dunes that all simulations share, each of which lies at another place of them."""

import functools
import math
from typing import Any, Final

import numpy as np

from rftsim.law import layout
from rftsim.sand.dune_field import dunes
from rftsim.sand.terrain import PAD, Terrain, spline
from rftsim_envs.physics import Array

FIELD: Final = 12.0
"""Side of the field of dunes, which repeats, in wavelengths."""
LINE: Final = 64.0
"""Length of the dunes that vary along x alone, in wavelengths."""
BESIDE: Final = 2.0
"""Width of the field that these are a line of, in wavelengths."""
VALUES: Final = 8.0
"""Values to a wavelength: simulations each hold a copy of them."""
SEED: Final = 0
"""Seed of the field; seeds of episodes draw places in it."""


class Relief:
    """Heights of the undisturbed ground under n simulations; z = 0 where there is no terrain.

    Args:
        packed: Packed terrain, see `layout.pack_terrain`; None of level ground.
        heads: Records of `layout.TERRAIN` of the simulations, (n,), whose places are read when a height is asked for.

    Attributes:
        period: Lengths along x and y after which the ground repeats itself [m]; zeros of level ground.
    """

    def __init__(self, packed: Array | None = None, heads: Any = None) -> None:
        self._heads, self.period = heads, (0.0, 0.0)
        if packed is not None:
            head = layout.record(packed, layout.TERRAIN)
            rows, columns = int(head.rows), int(head.columns)
            shape = rows + 2 * PAD, columns + 2 * PAD
            self._coefficients = packed[layout.TERRAIN_NUMBERS :].reshape(shape)
            self._spacing, self._repeat = (float(head.dx), float(head.dy)), bool(head.repeat)
            self.period = columns * self._spacing[0], rows * self._spacing[1]

    @property
    def is_level(self) -> bool:
        """Whether the ground is level, at z = 0."""
        return self._heads is None

    def move(self, i: int, rng: np.random.Generator) -> None:
        """Draw the place of the dunes that simulation i lies at."""
        for name, length in zip("xy", self.period, strict=True):
            self._heads[name][i] = rng.uniform(-length, 0.0)

    def height(self, x: Array, y: Array, chosen: Any = ...) -> Array:
        """Height of the ground over places of each simulation [m].

        Args:
            x: Places [m], (n,) or (n, k).
            y: Places [m], of the same shape.
            chosen: The simulations that the first axis counts; by default all.
        """
        if self.is_level:
            return np.zeros(x.shape)
        heads = self._heads[chosen]
        shape = heads.shape + (1,) * (x.ndim - heads.ndim)
        places = np.array([heads["x"].reshape(shape), heads["y"].reshape(shape)])
        return spline(self._coefficients, places, self._spacing, self._repeat, x, y)[0]


LEVEL: Final = Relief()
"""Ground at z = 0, of any number of simulations."""


@functools.lru_cache(maxsize=8)
def make_dunes(amplitude: float, wavelength: float, planar: bool) -> Terrain:
    """The field of dunes that episodes lie in, which repeats.

    Args:
        amplitude: Root mean square of the heights [m].
        wavelength: Dominant wavelength [m].
        planar: Whether heights vary along x alone: those along a line through a field of dunes.

    Raises:
        ValueError: A length is none.
    """
    spacing, steepest = wavelength / VALUES, 0.5 * math.pi
    if not planar:
        return dunes(amplitude, wavelength, FIELD * wavelength, spacing, SEED, repose=steepest)
    size = LINE * wavelength, BESIDE * wavelength
    field = dunes(amplitude, wavelength, size, spacing, SEED, repose=steepest)
    line = field.heights[0] - field.heights[0].mean()
    heights = line * (amplitude / math.sqrt(float((line**2).mean())))
    return Terrain(np.tile(heights, (2, 1)), field.spacing, field.origin, repeat=True)
