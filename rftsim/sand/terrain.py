"""Terrain: a free surface of any height, as values on a grid that are joined with continuous height and slope.

Between the values lies a surface of quadratic B-splines, which passes through each of them. Its coefficients are what
compiled code reads: a height is a weighted mean of nine of them, so no point lies above or below all nine, and of a
tilted plane it is the plane.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rftsim.sand.free_surface import FreeSurface, slope_normal

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
        spacing = lengths(self.spacing, "spacing")
        origin = np.asarray(self.origin, dtype=float)
        if origin.shape != (2,) or not np.isfinite(origin).all():
            raise ValueError(f"a terrain's origin must be the x and y of its first value, not {self.origin}")
        heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "spacing", tuple(spacing.tolist()))
        object.__setattr__(self, "origin", tuple(origin.tolist()))

    @classmethod
    def from_function(
        cls,
        function: Callable[[Array, Array], ArrayLike],
        size: ArrayLike,
        spacing: ArrayLike,
        *,
        centre: tuple[float, float] = (0.0, 0.0),
        repeat: bool = False,
    ) -> "Terrain":
        """A terrain through the values of a function, which is sampled once.

        Args:
            function: Height [m] over places x and y [m], arrays of any one shape.
            size: Extent along x and along y [m]; one number stands for both. Of a terrain that repeats, its period.
            spacing: Distance between samples along x and along y [m], which is fitted to the size.
            centre: Middle of the terrain, x and y [m].
            repeat: Whether it repeats; the function has to repeat itself then.

        Raises:
            ValueError: The size holds no two samples each way, or the function gives no finite heights there.
        """
        counts, fitted = grid(size, spacing, repeat)
        x, y = (c - s * (n - 1) / 2 + s * np.arange(n) for c, s, n in zip(centre, fitted, counts, strict=True))
        heights = np.asarray(function(*np.meshgrid(x, y)), dtype=float)
        if heights.shape not in ((), (len(y), len(x))):
            raise ValueError(f"a terrain's function must give heights of the shape of x and y, not {heights.shape}")
        heights = np.broadcast_to(heights, (len(y), len(x)))
        return cls(heights, fitted, (float(x[0]), float(y[0])), repeat)

    @classmethod
    def from_coefficients(
        cls, coefficients: ArrayLike, spacing: tuple[float, float], origin: tuple[float, float], repeat: bool
    ) -> "Terrain":
        """The terrain that has these coefficients, to rounding; spacing, origin and repeat are those of the class.

        Args:
            coefficients: [m], shape (rows + 2 PAD, columns + 2 PAD).
            spacing: Distance between values along x and along y [m].
            origin: Place of the first value, x and y [m].
            repeat: Whether it repeats.
        """
        padded = np.asarray(coefficients, dtype=float)
        rows, columns = (n - 2 * PAD for n in padded.shape)
        return cls(_finer(_finer(padded)[0][:rows].T)[0][:columns].T, spacing, origin, repeat)

    @functools.cached_property
    def coefficients(self) -> Array:
        """Coefficients of the B-splines [m], shape (rows + 2 PAD, columns + 2 PAD)."""
        found = _along(_along(self.heights, self.repeat).T, self.repeat).T
        found.setflags(write=False)
        return found

    @property
    def ceiling(self) -> FreeSurface:
        """A level plane that no point of the terrain lies above."""
        return FreeSurface(float(self.coefficients.max()))

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
    def window(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Places of the first and of the last value, x and y [m]."""
        (x, y), (dx, dy), (rows, columns) = self.origin, self.spacing, self.heights.shape
        return (x, y), (x + dx * (columns - 1), y + dy * (rows - 1))

    def slopes(self) -> tuple[Array, Array]:
        """Slopes along x and y [-] at the values and midway between them, shape (2 rows, 2 columns) each; unordered."""
        dx, dy = self.spacing
        level, rising = _finer(self.coefficients.T)
        return _finer(rising.T)[0] / dx, _finer(level.T)[1] / dy

    @functools.cached_property
    def steepest(self) -> float:
        """The steepest slope [rad], at the values and midway between them."""
        return math.atan(float(np.hypot(*self.slopes()).max()))

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
    at_x, at_y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    j, along_x, turn_x = _weights((at_x - x0) / dx, int(columns), repeat)
    i, along_y, turn_y = _weights((at_y - y0) / dy, int(rows), repeat)
    width = coefficients.shape[1]
    first = np.asarray(i * width + j)
    around = np.add.outer(np.arange(3) * width, np.arange(3)).reshape(3, 3, *[1] * first.ndim)
    nine = coefficients.ravel().take(first + around)
    level, rising = (nine * along_x).sum(axis=1), (nine * turn_x).sum(axis=1)
    return (along_y * level).sum(axis=0), (along_y * rising).sum(axis=0) / dx, (turn_y * level).sum(axis=0) / dy


def _weights(t: Array, count: int, repeat: bool) -> tuple[Any, Array, Array]:
    """Of places in spacings: the first of three padded coefficients, and (3, ...) their weights, and derivatives'."""
    if repeat:
        t = t - count * np.floor(t / count)
    t = np.clip(t, -2.0, count + 1.0)
    nearest = np.floor(t + 0.5)
    f = t - nearest
    weights = np.array([0.5 * (0.5 - f) ** 2, 0.75 - f**2, 0.5 * (0.5 + f) ** 2])
    return nearest.astype(int) + PAD - 1, weights, np.array([f - 0.5, -2.0 * f, f + 0.5])


def _along(values: Array, repeat: bool) -> Array:
    """Padded coefficients, along the first axis, of the spline through values."""
    from scipy.linalg import solve_banded  # not at start-up, where few need it

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


def _finer(coefficients: Array) -> tuple[Array, Array]:
    """Heights of a spline, and their differences per spacing, at its values and then midway; along the first axis."""
    inside = slice(PAD, len(coefficients) - PAD)
    before, at, after = (coefficients[inside.start + k : inside.stop + k] for k in (-1, 0, 1))
    heights = np.concatenate([(before + 6.0 * at + after) / 8.0, (at + after) / 2.0])
    return heights, np.concatenate([(after - before) / 2.0, after - at])


def grid(size: ArrayLike, spacing: ArrayLike, repeat: bool) -> tuple[tuple[int, int], tuple[float, float]]:
    """The numbers of values along x and along y of a terrain of a size, and their distances [m], fitted to it.

    Args:
        size: Extent along x and along y [m], of a terrain that repeats its period; one number stands for both.
        spacing: Distance that is wanted [m], of the same shapes.
        repeat: Whether the terrain repeats, so that its last value lies a spacing before its end.

    Raises:
        ValueError: Size or spacing are no positive lengths, or the size holds no two values each way.
    """
    extent, wanted = (lengths(value, name) for value, name in ((size, "size"), (spacing, "spacing")))
    parts = np.rint(extent / wanted)
    if parts.min() < (2 if repeat else 1):
        raise ValueError(f"a terrain's spacing must divide its size, {extent} m, into parts, which {wanted} m does not")
    if parts.prod() > MOST:
        raise ValueError(
            f"a terrain of {extent} m has more than {MOST} values at a spacing of {wanted} m: take a larger"
        )
    nx, ny = (int(part) if repeat else int(part) + 1 for part in parts)
    dx, dy = (extent / parts).tolist()
    return (nx, ny), (dx, dy)


def lengths(value: ArrayLike | None, name: str) -> Array:
    """Lengths along x and along y [m], of which one number may stand for both, shape (2,).

    Raises:
        ValueError: They are no positive numbers, one or two.
    """
    found = np.asarray(value, dtype=float)
    if found.shape not in ((), (1,), (2,)) or not np.isfinite(found).all() or not (found > 0.0).all():
        raise ValueError(f"a terrain's {name} must be positive, in metres, one number or two, not {found}")
    return np.broadcast_to(found, 2)
