"""The free surface: what bounds the sand from above, as a plane."""

import dataclasses
import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class GroundLike(Protocol):
    """A free surface, of whatever kind, that is asked for heights, normals and depths."""

    def depth(self, points: ArrayLike) -> Any:
        """Depth of points below the surface along its normal [m], positive in the sand; points [m], (3,) or (n, 3)."""

    def height_at(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height of the surface over places [m]; x and y [m] of any one shape."""

    def normal_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Upward unit normal of the surface over places, shape (..., 3); x and y [m] of any one shape."""


@dataclasses.dataclass(frozen=True)
class FreeSurface:
    """A plane that bounds the sand from above; `Terrain` is a surface of any height.

    Depth and the laws' "up" follow the normal. RFT was measured and fitted on level ground: on slopes it is
    uncalibrated.

    Raises:
        ValueError: The normal does not point upward.
    """

    height: float = 0.0
    """Height at which the surface meets the world's z axis [m]."""
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Upward normal of the surface; made a unit vector."""

    def __post_init__(self) -> None:
        normal = np.asarray(self.normal, dtype=float)
        if normal.shape != (3,) or not np.isfinite(normal).all() or not normal[2] > 0.0:
            raise ValueError(f"the sand's normal must point upward, as (0, 0, 1) does, not {self.normal}")
        if not math.isfinite(self.height):
            raise ValueError(f"the sand's height must be finite, not {self.height}")
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "normal", tuple(unit.tolist()))

    @property
    def offset(self) -> float:
        """The product of the normal and any point on the surface, normal . x [m]."""
        return self.height * self.normal[2]

    @property
    def ceiling(self) -> "FreeSurface":
        """A plane that no point of the surface lies above: itself."""
        return self

    def depth(self, points: ArrayLike) -> Any:
        """Depth of points below the surface along its normal [m], positive in the sand.

        Args:
            points: World frame [m], shape (3,) or (n, 3).

        Returns:
            A number, or an array of shape (n,).
        """
        return self.offset - np.dot(points, self.normal)

    def height_at(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Height of the surface over places [m]; x and y [m] of any one shape."""
        across = np.multiply(x, self.normal[0]) + np.multiply(y, self.normal[1])
        return self.height - across / self.normal[2]

    def normal_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Upward unit normal of the surface over places, shape (..., 3); x and y [m] of any one shape."""
        return np.broadcast_to(np.array(self.normal), (*np.broadcast_shapes(np.shape(x), np.shape(y)), 3))


def slope_normal(along_x: ArrayLike, along_y: ArrayLike) -> Array:
    """Upward unit normal of a surface that rises by slopes along x and y [-], shape (..., 3)."""
    across = np.stack(np.broadcast_arrays(-np.asarray(along_x), -np.asarray(along_y), 1.0), axis=-1)
    normal: Array = across / np.linalg.norm(across, axis=-1, keepdims=True)
    return normal
