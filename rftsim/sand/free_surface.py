"""The free surface: what bounds the sand from above."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


@dataclasses.dataclass(frozen=True)
class FreeSurface:
    """The plane that bounds the sand from above: the terrain of a scene.

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

    def depth(self, points: ArrayLike) -> Any:
        """Depth of points below the surface along its normal [m], positive in the sand.

        Args:
            points: World frame [m], shape (3,) or (n, 3).

        Returns:
            A number, or an array of shape (n,).
        """
        return self.offset - np.dot(points, self.normal)
