"""The free surface: what bounds the sand from above."""

import dataclasses
import math

import numpy as np


@dataclasses.dataclass(frozen=True)
class FreeSurface:
    """The plane that bounds the sand from above.

    Depth and the laws' "up" follow the normal. RFT was measured and fitted on level ground: on slopes it is
    uncalibrated.

    Attributes:
        height: Where the surface meets the world's z axis [m].
        normal: Its upward normal; made a unit vector.

    Raises:
        ValueError: The normal does not point upward.
    """

    height: float = 0.0
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

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
        """The product normal . x of the points x on the surface [m]."""
        return self.height * self.normal[2]
