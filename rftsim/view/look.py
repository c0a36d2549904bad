"""The look of sand where it is drawn: its grain, the sun above it, and the haze before its horizon."""

import contextlib
from collections.abc import Iterator
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from rftsim.model.drawing import DRAWING_MARKER, SAND_RGB
from rftsim.model.readout import instances
from rftsim.surface.triangles import Array
from rftsim.view.canvas import SHADED, Shot

WIDE: Final = 60.0
"""Half the width of the block of sand in pictures, over the extent of what can move."""
THICK: Final = 0.3
"""Half its thickness, over the same."""
CLEAR: Final = 30.0
"""Distance from which haze prevails, over the same."""
BACKGROUND: Final = (0.87, 0.89, 0.91)
"""Colour of the sky where a model has none."""
GRAINS: Final = ((0.6, 0.12), (1.6, 0.09))
"""Sizes [pixels] of what makes the grain, and how much each changes its brightness [-]."""
PATCHES: Final = 5.0
"""Size from which on the grain has none [pixels]: from afar it is even, so that it is not seen to repeat itself."""
WARMTH: Final = (0.015, 0.0, -0.03)
"""How much grains differ in red, green and blue [-]."""
SUN: Final = (0.75, 0.45, -0.62)
"""Direction of the light of the sun that models get that have no light with shadows."""
SUNLIGHT: Final = (0.80, 0.77, 0.71)
"""Its colour."""
SHADE: Final = 0.6
"""Factor of all other light then."""
EXPOSED: Final = 1.1
"""Most light that falls on level ground; with more all lights are dimmed, or the sand would be white."""


def sand_geoms(model: mujoco.MjModel) -> dict[int, str]:
    """The bed that each geom draws that draws one, by its id: those of a bed's material."""
    names = {bed.name for bed in instances(model)}
    drawn = {}
    for geom, material in enumerate(model.geom_matid):
        before, marker, after = (
            model.material(material).name.rpartition(DRAWING_MARKER) if material >= 0 else ("", "", "")
        )
        if marker and before + after in names:  # what a model was attached under may stand around
            drawn[geom] = before + after
    return drawn


def period(model: mujoco.MjModel, geom: int) -> float:
    """The side of the texture of grains on a geom that draws sand [m], which repeats."""
    return 2.0 / float(model.mat_texrepeat[model.geom_matid[geom], 0])


def paint(model: mujoco.MjModel) -> None:
    """Paint the grain of a model's drawn sand into its textures, for good."""
    role = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
    for texture in {int(model.mat_texid[model.geom_matid[geom], role]) for geom in sand_geoms(model)}:
        pixels = _pixels(model, texture)
        pixels[:] = _grain(len(pixels)).reshape(pixels.shape)


@contextlib.contextmanager
def painted(model: mujoco.MjModel) -> Iterator[None]:
    """A context in which a model's drawn sand has grain; what takes over its textures meanwhile keeps that."""
    kept = model.tex_data.copy()
    paint(model)
    try:
        yield
    finally:
        model.tex_data[:] = kept


def dress(model: mujoco.MjModel, extent: float) -> None:
    """Give a model's drawn sand its grain, haze, and shadows that fit the extent of what can move [m], for good."""
    paint(model)
    model.vis.map.shadowclip = SHADED * extent / model.stat.extent
    sky = horizon(model)
    if sky is not None:
        model.vis.rgba.haze[:3] = sky


def _pixels(model: mujoco.MjModel, texture: int) -> "NDArray[np.uint8]":
    """A view of a texture's numbers, (height, width * channels)."""
    height, row = int(model.tex_height[texture]), int(model.tex_width[texture] * model.tex_nchannel[texture])
    start = int(model.tex_adr[texture])
    pixels: NDArray[np.uint8] = model.tex_data[start : start + height * row].reshape(height, row)
    return pixels


def _grain(side: int) -> "NDArray[np.uint8]":
    """Sand as a texture that repeats without seams, (side, side, 3): noise of few pixels, each grain of its tint."""
    rng = np.random.default_rng(19)

    def noise(size: float) -> Array:
        smooth: Array = gaussian_filter(rng.standard_normal((side, side)), size, mode="wrap")
        smooth -= gaussian_filter(smooth, PATCHES, mode="wrap")
        smooth /= smooth.std()
        return smooth

    brightness: Array = np.ones((side, side)) + sum(share * noise(size) for size, share in GRAINS)
    tint = 1.0 + noise(GRAINS[0][0])[..., None] * np.array(WARMTH)
    shades = np.array(SAND_RGB) * brightness[..., None] * tint
    pixels: NDArray[np.uint8] = (255.0 * np.clip(shades, 0.0, 1.0)).round().astype(np.uint8)
    return pixels


def shine(scene: mujoco.MjvScene) -> None:
    """Let the sun into a scene in which no light casts shadows, and dim all lights where sand would be washed out."""
    _let_in_the_sun(scene)
    most = float(np.max(_on_level_ground(scene)))
    for i in range(scene.nlight if most > EXPOSED else 0):
        light = scene.lights[i]
        for part in (light.ambient, light.diffuse, light.specular):
            part[:] *= EXPOSED / most


def _on_level_ground(scene: mujoco.MjvScene) -> Array:
    """What light a scene's lights throw on level ground, of which 1 gives things their own colour, (3,)."""
    total = np.zeros(3)
    for i in range(scene.nlight):
        light = scene.lights[i]
        down = -float(scene.camera[0].forward[2]) if light.headlight else -float(light.dir[2])
        total += light.ambient + max(down, 0.0) * light.diffuse
    return total


def _let_in_the_sun(scene: mujoco.MjvScene) -> None:
    """Add the sun where no light casts shadows, and dim the others."""
    lights = [scene.lights[i] for i in range(scene.nlight)]
    if any(light.castshadow for light in lights if not light.headlight) or scene.nlight >= len(scene.lights):
        return
    for light in lights:
        light.ambient[:] *= 1.0 + SHADE
        light.diffuse[:] *= SHADE
    sun = scene.lights[scene.nlight]
    direction = np.array(SUN) / np.linalg.norm(SUN)
    sun.id, sun.headlight, sun.castshadow, sun.texid = -1, 0, 1, -1
    sun.type, sun.bulbradius, sun.intensity, sun.range = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, 0.02, 0.0, 10.0
    sun.dir[:], sun.pos[:] = direction, np.asarray(scene.camera[0].pos) - 10.0 * direction
    sun.attenuation[:], sun.cutoff, sun.exponent = (1.0, 0.0, 0.0), 45.0, 10.0
    sun.ambient[:], sun.diffuse[:], sun.specular[:] = 0.0, SUNLIGHT, (0.1, 0.1, 0.1)
    scene.nlight += 1


def veil(shot: Shot, sky: Any, clear: float) -> "NDArray[np.uint8]":
    """The colours of a shot with haze in the distance, which goes over into the sky's colour, (height, width, 3).

    Args:
        shot: The shot.
        sky: The sky's colour at the horizon, 0 to 1, or None of a model that has none.
        clear: Distance at which haze prevails [m].
    """
    far = shot.distance > 0.04 * clear  # nearer, it changes no colour by a step
    if sky is not None:
        far &= np.isfinite(shot.distance)
    haze = 1.0 - np.exp(-np.square(np.minimum(shot.distance[far] / clear, 10.0)))
    towards = 255.0 * np.array(BACKGROUND if sky is None else sky, dtype=np.float32)
    picture: NDArray[np.uint8] = shot.colours.copy()
    picture[far] = (picture[far] + haze[:, None] * (towards - picture[far])).round()
    return picture


def horizon(model: mujoco.MjModel) -> Array | None:
    """The colour of a model's sky at the horizon, 0 to 1, shape (3,); None where it has no sky."""
    skies = np.flatnonzero(model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX))
    if not skies.size:
        return None
    texture = int(skies[0])
    faces = _pixels(model, texture).reshape(-1, int(model.tex_width[texture]), int(model.tex_nchannel[texture]))
    side = faces.shape[1]
    rows = [face * side + side // 2 for face in (0, 1, 4, 5) if (face + 1) * side <= len(faces)]
    colour: Array = faces[rows][..., :3].mean(axis=(0, 1)) / 255.0
    return colour


def make_solid(geom: mujoco.MjvGeom, period: float, extent: float, eye: Array) -> None:
    """Make the plane of sand in a scene an opaque block, which unlike a plane casts no shadows on itself.

    Args:
        geom: The plane, as the scene has it.
        period: Side of its texture [m].
        extent: The extent of what can move [m].
        eye: Place of the camera, around which the block lies, in whole periods of its texture [m], shape (3,).
    """
    axes = np.asarray(geom.mat, dtype=float).reshape(3, 3).T
    for axis in axes[:2]:
        geom.pos[:] += period * round(float((eye - geom.pos) @ axis) / period) * axis
    thickness = THICK * extent
    geom.pos[:] -= thickness * axes[2]
    geom.type, geom.size[:] = mujoco.mjtGeom.mjGEOM_BOX, (WIDE * extent, WIDE * extent, thickness)
    geom.rgba[3], geom.transparent, geom.texrepeat[:] = 1.0, 0, 2.0 / period
