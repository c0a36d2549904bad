"""Colours of traction, from none to the strongest."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rftsim.surface.triangles import Array

INACTIVE: Final = (150, 150, 150)
"""Colour of triangles that the sand does not act on: grey."""
STOPS: Final = ((252, 197, 192), (250, 159, 181), (247, 104, 161), (197, 27, 138), (122, 1, 119))
"""Colours of traction from none to the strongest, evenly spaced, ever darker: ColorBrewer's RdPu."""


def shade(share: NDArray[np.floating[Any]]) -> Array:
    """Colours of shares of the strongest traction, 0 to 1, (..., 3)."""
    places = np.linspace(0.0, 1.0, len(STOPS))
    return np.stack([np.interp(share, places, channel) for channel in np.array(STOPS).T / 255.0], axis=-1)


def traction_colours(traction: NDArray[np.floating[Any]], scale: float) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of tractions [Pa], the darkest from scale on; grey where they are negative, or not numbers."""
    strength = np.minimum(np.where(traction >= 0.0, traction, 0.0) / scale, 1.0)
    return _PALETTE[np.where(traction >= 0.0, 1.0 + 254.0 * strength, 0.0).astype(np.intp)]


def packed(rgb: NDArray[Any]) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA, opaque, of red, green and blue from 0 to 255, (..., 3)."""
    whole = np.rint(rgb).astype(np.uint32)
    found: NDArray[np.uint32] = (whole[..., 0] << 24) + (whole[..., 1] << 16) + (whole[..., 2] << 8) + np.uint32(255)
    return found


_PALETTE: Final = packed(np.vstack([INACTIVE, 255.0 * shade(np.linspace(0.0, 1.0, 255))]))
"""The inactive colour, then 255 shades."""
