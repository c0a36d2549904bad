"""How a bed of sand is drawn: the MJCF elements that show its surface and collide with nothing."""

import math
from typing import Final

import mujoco

from rftsim.errors import SceneError
from rftsim.sand.free_surface import FreeSurface

SAND_RGBA: Final = (1.0, 1.0, 1.0, 0.75)
"""Colour by which the texture of the drawn sand is multiplied, and its opacity."""
GRAIN_RGB: Final = ((0.60, 0.52, 0.39), (0.45, 0.385, 0.285))
"""Colours of the drawn sand and of the grains on it."""
GRAIN_SIZE: Final = 0.001
"""Side of a pixel of the drawn sand [m]."""
PIXELS: Final = 256
"""Side of its texture, which repeats [pixels]."""
SHINE: Final = 0.2
"""Light that the drawn sand gives off itself."""
DRAWING_MARKER: Final = "_surface"
"""End of the name of the geom, texture and material that draw a bed; its name stands before."""


def check_drawing(spec: mujoco.MjSpec, name: str) -> None:
    """Refuse a bed whose drawing would have the name of something else.

    Raises:
        SceneError: The model has a geom, texture or material of that name.
    """
    for kind, elements in (("geom", spec.geoms), ("texture", spec.textures), ("material", spec.materials)):
        if _drawing(name) in {element.name for element in elements}:
            raise SceneError(f"the model has a {kind} {_drawing(name)!r} already: rename it, or pass draw=False")


def write_drawing(spec: mujoco.MjSpec, name: str, terrain: FreeSurface) -> None:
    """Draw the surface of a bed of sand as a plane of grains, which collides with nothing and lets what is buried show.

    The grains are noise, which far away becomes an even colour; they shine a little, so that sand looks like sand
    under a model's own lights, whatever these are.
    """
    normal, drawing = terrain.normal, _drawing(name)
    half = 0.5 * math.acos(min(normal[2], 1.0))
    length = math.hypot(normal[0], normal[1]) or 1.0
    quat = [math.cos(half), -math.sin(half) * normal[1] / length, math.sin(half) * normal[0] / length, 0.0]
    spec.add_texture(
        name=drawing,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_RANDOM,
        random=0.35,
        rgb1=GRAIN_RGB[0],
        markrgb=GRAIN_RGB[1],
        width=PIXELS,
        height=PIXELS,
    )
    repeat = 1.0 / (PIXELS * GRAIN_SIZE)
    grains = spec.add_material(
        name=drawing, texrepeat=[repeat, repeat], texuniform=True, emission=SHINE, specular=0.0, shininess=0.0
    )
    grains.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = drawing
    spec.worldbody.add_geom(
        name=drawing,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        pos=[0, 0, terrain.height],
        quat=quat,
        contype=0,
        conaffinity=0,
        material=drawing,
        rgba=SAND_RGBA,
    )


def _drawing(bed: str) -> str:
    return bed + DRAWING_MARKER
