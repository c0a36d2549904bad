"""Terrain: a free surface of any height, as values on a grid that are joined with continuous height and slope.

Between the values lies a surface of quadratic B-splines, which passes through each of them. Its coefficients are what
compiled code reads: a height is a weighted mean of nine of them, so no point lies above or below all nine, and of a
tilted plane it is the plane.
"""

import dataclasses
import math
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_banded

from rftsim.sand.free_surface import slope_normal

Array = NDArray[np.float64]
PAD: Final = 3
"""Coefficients beyond the values on each side: the first goes on straight, the others level off."""
MOST: Final = 4_000_000
"""Most values of a terrain; a model carries each of them."""


@dataclasses.dataclass(frozen=True, eq=False)
class Terrain:
    """A free surface given by heights on a rectangular grid along the world's x and y axes.

    Beyond its values a terrain levels off within three spacings, unless it repeats.

    Raises:
        ValueError: Heights that are no finite (rows, columns) array of at least 2 x 2 values, or a spacing or an origin
            that is none.
    """

    heights: Array
    """Heights [m], shape (rows, columns): rows along y and columns along x, as in MuJoCo's height fields."""
    spacing: tuple[float, float]
    """Distance between values along x and along y [m]; one number stands for both."""
    origin: tuple[float, float] = (0.0, 0.0)
    """Place of the first value, x and y [m]."""
    repeat: bool = False
    """Whether it goes on for ever by repeating itself, every columns * spacing along x and rows * spacing along y."""

    def __post_init__(self) -> None:
        heights = np.array(self.heights, dtype=float)
        if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
            raise ValueError(
                f"a terrain needs finite heights, at least 2 x 2 of them, not an array of shape {heights.shape}"
            )
        if heights.size > MOST:
            raise ValueError(
                f"a terrain of {heights.shape[0]} x {heights.shape[1]} values is more than a model carries, {MOST}: "
                "take a larger spacing"
            )
        spacing = np.broadcast_to(np.asarray(self.spacing, dtype=float), 2)
        origin = np.asarray(self.origin, dtype=float)
        if not (np.isfinite(spacing).all() and (spacing > 0.0).all()):
            raise ValueError(f"a terrain's spacing must be positive, in metres, not {self.spacing}")
        if origin.shape != (2,) or not np.isfinite(origin).all():
            raise ValueError(f"a terrain's origin must be the x and y of its first value, not {self.origin}")
        heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "spacing", tuple(spacing.tolist()))
        object.__setattr__(self, "origin", tuple(origin.tolist()))

    @property
    def coefficients(self) -> Array:
        """Coefficients of the B-splines [m], shape (rows + 2 PAD, columns + 2 PAD)."""
        return _along(_along(self.heights, self.repeat).T, self.repeat).T

    def height_at(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height of the surface over places [m]; x and y [m] of any one shape."""
        return self._surface(x, y)[0]

    def normal_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Upward unit normal of the surface over places, shape (..., 3); x and y [m] of any one shape."""
        return slope_normal(*self._surface(x, y)[1:])

    def depth(self, points: ArrayLike) -> Any:
        """Depth of points below the surface along the normal above them [m], positive in the sand.

        Args:
            points: World frame [m], shape (3,) or (n, 3).

        Returns:
            A number, or an array of shape (n,).
        """
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        height, *slopes = self._surface(x, y)
        return (height - z) * slope_normal(*slopes)[..., 2]

    @property
    def steepest(self) -> float:
        """The steepest slope between neighbouring values [rad]."""
        dx, dy = self.spacing
        h = self.heights
        if self.repeat:
            h = np.pad(h, ((0, 1), (0, 1)), mode="wrap")
        along = np.diff(h, axis=1)[:-1] / dx, np.diff(h, axis=0)[:, :-1] / dy
        return math.atan(float(np.sqrt(along[0] ** 2 + along[1] ** 2).max()))

    def _surface(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        """Height [m], and slopes along x and y [-], over places."""
        return spline(self.coefficients, self.origin, self.spacing, self.repeat, x, y)


def spline(
    coefficients: Array, origin: ArrayLike, spacing: ArrayLike, repeat: bool, x: ArrayLike, y: ArrayLike
) -> tuple[Array, Array, Array]:
    """Height [m] and slopes along x and y [-] of a surface of quadratic B-splines.

    Args:
        coefficients: [m], shape (rows + 2 PAD, columns + 2 PAD).
        origin: Place of the coefficient [PAD, PAD], x and y [m].
        spacing: Distance between coefficients along x and along y [m].
        repeat: Whether it repeats.
        x: Places [m], of any shape.
        y: Places [m], of the same shape.
    """
    rows, columns = np.array(coefficients.shape) - 2 * PAD
    (x0, y0), (dx, dy) = np.asarray(origin), np.asarray(spacing)
    j, along_x, turn_x = _weights((np.asarray(x, dtype=float) - x0) / dx, int(columns), repeat)
    i, along_y, turn_y = _weights((np.asarray(y, dtype=float) - y0) / dy, int(rows), repeat)
    height = slope_x = slope_y = np.zeros(np.broadcast_shapes(i.shape, j.shape))
    for a in range(3):
        for b in range(3):
            c = coefficients[i + a, j + b]
            height = height + along_y[a] * along_x[b] * c
            slope_x = slope_x + along_y[a] * turn_x[b] * c / dx
            slope_y = slope_y + turn_y[a] * along_x[b] * c / dy
    return height, slope_x, slope_y


def _weights(t: Array, count: int, repeat: bool) -> tuple[Any, tuple[Array, ...], tuple[Array, ...]]:
    """Of places in spacings: the first of three padded coefficients, their weights, and their derivatives'."""
    if repeat:
        t = t - count * np.floor(t / count)
    t = np.clip(t, -2.0, count + 1.0)
    nearest = np.floor(t + 0.5)
    f = t - nearest
    weights = 0.5 * (0.5 - f) ** 2, 0.75 - f**2, 0.5 * (0.5 + f) ** 2
    return nearest.astype(int) + PAD - 1, weights, (f - 0.5, -2.0 * f, f + 0.5)


def _along(values: Array, repeat: bool) -> Array:
    """Padded coefficients, along the first axis, of the spline through values."""
    n = len(values)
    if repeat:
        phase = 2.0 * np.pi * np.arange(n // 2 + 1) / n
        filtered = np.fft.rfft(values, axis=0) / (0.75 + 0.25 * np.cos(phase))[:, None]
        return np.pad(np.fft.irfft(filtered, n, axis=0), ((PAD, PAD), (0, 0)), mode="wrap")
    band = np.array([np.full(n, 0.125), np.full(n, 0.75), np.full(n, 0.125)])
    band[1, [0, -1]], band[0, 1], band[2, -2] = 1.0, 0.0, 0.0  # the ends go on straight, so their values are theirs
    inner = solve_banded((1, 1), band, values)
    before, after = 2.0 * inner[:1] - inner[1:2], 2.0 * inner[-1:] - inner[-2:-1]
    return np.concatenate([before.repeat(PAD, axis=0), inner, after.repeat(PAD, axis=0)])
