"""The look of a model on sand where it is drawn: as fine as its size wants, in room enough for a picture."""

import contextlib
from collections.abc import Iterator
from typing import Final

import mujoco
import numpy as np

from rftsim.model.readout import sand_planes
from rftsim.surface.triangles import Array

GRAINS: Final = 900
"""Pixels of the sand's texture over the extent of what can move."""
WIDE: Final = 60.0
"""Half the width of the block of sand in pictures, over the same."""
THICK: Final = 0.3
"""Half its thickness, over the same."""
SHADED: Final = 3.0
"""Half the width of what a distant light's shadows cover, over the same."""


def repeats(model: mujoco.MjModel, extent: float) -> dict[int, float]:
    """How often the texture of each drawn sand repeats in a metre, by the id of its geom.

    Args:
        model: Compiled.
        extent: The extent of what can move [m].
    """
    role = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
    textures = {geom: int(model.mat_texid[model.geom_matid[geom], role]) for geom in sand_planes(model)}
    return {geom: GRAINS / (extent * float(model.tex_width[texture])) for geom, texture in textures.items()}


def dress(model: mujoco.MjModel, extent: float) -> None:
    """Fit a model's drawn sand and shadows to the extent of what can move [m], for good."""
    for geom, repeat in repeats(model, extent).items():
        model.mat_texrepeat[model.geom_matid[geom]] = repeat
    model.vis.map.shadowclip = SHADED * extent / model.stat.extent


@contextlib.contextmanager
def roomy(model: mujoco.MjModel, extent: float, width: int, height: int) -> Iterator[None]:
    """A context in which a model's offscreen buffer has room for a picture [pixels], and shadows fit an extent [m].

    OpenGL contexts that are made within it keep that; the model does not.
    """
    size, shades = model.vis.global_, model.vis.map
    kept = size.offwidth, size.offheight, shades.shadowclip
    size.offwidth, size.offheight = max(width, kept[0]), max(height, kept[1])
    shades.shadowclip = SHADED * extent / model.stat.extent
    try:
        yield
    finally:
        size.offwidth, size.offheight, shades.shadowclip = kept


def make_solid(geom: mujoco.MjvGeom, repeat: float, extent: float, eye: Array) -> None:
    """Make the plane of sand in a scene an opaque block, which unlike a plane casts no shadows on itself.

    Args:
        geom: The plane, as the scene has it.
        repeat: How often its texture repeats in a metre.
        extent: The extent of what can move [m].
        eye: Place of the camera, around which the block lies, in whole periods of its texture [m], shape (3,).
    """
    axes = np.asarray(geom.mat, dtype=float).reshape(3, 3).T
    period = 2.0 / repeat
    for axis in axes[:2]:
        geom.pos[:] += period * round(float((eye - geom.pos) @ axis) / period) * axis
    thickness = THICK * extent
    geom.pos[:] -= thickness * axes[2]
    geom.type, geom.size[:] = mujoco.mjtGeom.mjGEOM_BOX, (WIDE * extent, WIDE * extent, thickness)
    geom.rgba[3], geom.transparent, geom.texrepeat[:] = 1.0, 0, repeat
