"""Dunes: a terrain that is drawn from a seed, with the height and the wavelength that were asked for."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from rftsim.sand.medium import STEEPEST
from rftsim.sand.terrain import Terrain, grid

WIDTH: Final = 0.15
"""Standard deviation of the waves' wave numbers, over that of the dominant wavelength."""
WAVES: Final = 16.0
"""Size of the field that is drawn unless another is asked for, in wavelengths."""
VALUES: Final = 12.0
"""Values to a wavelength, unless another spacing is asked for."""
FEWEST: Final = 2.0
"""Wavelengths that the field holds at least each way, and values to a wavelength."""


def dunes(
    amplitude: float = 0.04,
    wavelength: float = 2.0,
    size: ArrayLike | None = None,
    spacing: ArrayLike | None = None,
    seed: int = 0,
    *,
    repose: float = STEEPEST,
) -> Terrain:
    """A field of random dunes that repeats for ever: waves of all headings whose lengths lie about the dominant one.

    Their heights are those of a Gaussian random field of mean zero, whose spectrum is a ring about the wave number of
    the dominant wavelength; the same seed gives the same dunes.

    Args:
        amplitude: Root mean square of the heights [m].
        wavelength: Dominant wavelength [m].
        size: Period along x and along y [m], by default 16 wavelengths; one number stands for both.
        spacing: Distance between values [m], by default a twelfth of the wavelength.
        seed: What the waves are drawn from.
        repose: Angle of repose [rad], which no slope may pass.

    Raises:
        ValueError: A slope is steeper than that, or the field is too small or too coarse for the wavelength.
    """
    for name, value in (("amplitude", amplitude), ("wavelength", wavelength)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"the dunes' {name} must be positive, in metres, not {value:g}")
    size = WAVES * wavelength if size is None else size
    counts, steps = grid(size, wavelength / VALUES if spacing is None else spacing, repeat=True)
    period = np.multiply(counts, steps)
    if period.min() < FEWEST * wavelength:
        raise ValueError(
            f"a field of {period.min():.3g} m is too small for dunes of {wavelength:g} m: take a size of "
            f"{FEWEST * wavelength:g} m or more"
        )
    if max(steps) > wavelength / FEWEST:
        raise ValueError(
            f"a spacing of {max(steps):.3g} m is too coarse for dunes of {wavelength:g} m: take "
            f"{wavelength / VALUES:.3g} m or so"
        )
    shape = counts[1], counts[0]
    ky, kx = np.meshgrid(np.fft.fftfreq(shape[0], steps[1]), np.fft.rfftfreq(shape[1], steps[0]), indexing="ij")
    ring = np.exp(-0.5 * ((np.hypot(kx, ky) * wavelength - 1.0) / WIDTH) ** 2)
    ring[0, 0] = 0.0  # mean zero
    noise = np.random.default_rng(seed).normal(size=shape)
    heights = np.fft.irfft2(ring * np.fft.rfft2(noise), shape)
    heights *= amplitude / math.sqrt(float((heights**2).mean()))
    made = Terrain(heights, steps, (-period[0] / 2, -period[1] / 2), repeat=True)
    if made.steepest > repose:
        most = amplitude * math.tan(repose) / math.tan(made.steepest)
        raise ValueError(
            f"dunes of amplitude {amplitude:g} m and wavelength {wavelength:g} m are as steep as "
            f"{math.degrees(made.steepest):.3g} degrees, beyond the angle of repose of {math.degrees(repose):.3g}: "
            f"take an amplitude of {most:.3g} m at most, or longer waves"
        )
    return made
