"""How a bed of sand is drawn: the MJCF elements that show its surface and collide with nothing."""

import math
from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np

from rftsim.errors import SceneError
from rftsim.model.bounds import bounds
from rftsim.model.draft import Draft
from rftsim.model.relief import Field, Fineness, Level, make_levels, period, sample_fields
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.ruts import Ruts
from rftsim.sand.terrain import Terrain

SAND_RGB: Final = (0.70, 0.60, 0.45)
"""Colour of the drawn sand, in the mean."""
GRAIN_RGB: Final = (0.50, 0.42, 0.30)
"""Colour of the grains on it, where MuJoCo marks some."""
PERIOD: Final = 0.2
"""Side of the texture of grains, which repeats, over the extent of what can move."""
PIXELS: Final = 256
"""Side of the texture [pixels]."""
SHINE: Final = 0.1
"""Light that the drawn sand gives off itself."""
THICK: Final = 0.3
"""Thickness of fields below their lowest vertex, over the extent of what can move."""
DRAWING_MARKER: Final = "_surface"
"""End of the name of the geoms, the texture and the material that draw a bed; its name stands before."""


def check_drawing(spec: mujoco.MjSpec, name: str) -> None:
    """Refuse a bed whose drawing would have the name of something else.

    Raises:
        SceneError: The model has a geom, height field, texture or material of that name.
    """
    lists = {"geom": spec.geoms, "height field": spec.hfields, "texture": spec.textures, "material": spec.materials}
    for kind, elements in lists.items():
        taken = [one.name for one in elements if one.name.rstrip("0123456789") == _drawing(name)]
        if taken:
            raise SceneError(f"the model has a {kind} {taken[0]!r} already: rename it, or pass draw=False")


def write_drawing(
    spec: mujoco.MjSpec, name: str, terrain: FreeSurface | Terrain, draft: Draft, ruts: Ruts | None = None
) -> None:
    """Draw the surface of a bed of sand, which collides with nothing and hides what is buried.

    A plane without marks has no end; else there are height fields around what can move, which end where the horizon is.
    They leave the model's statistics, by which viewers place their cameras, as they were.

    Args:
        spec: The model; changed in place.
        name: Name of the bed.
        terrain: Its surface, undisturbed.
        draft: The model before it had sand.
        ruts: The marks that bodies leave in the sand; None where they leave none.
    """
    marks = None if ruts is None else Fineness(ruts.spacing, max(ruts.cells) * ruts.spacing)
    centre, extent = bounds(draft.model, draft.data)
    grain = period(terrain, marks, PERIOD * extent)
    _write_grains(spec, _drawing(name), grain)
    if isinstance(terrain, FreeSurface) and marks is None:
        _write_plane(spec, _drawing(name), terrain)
        return
    levels = make_levels(terrain, marks, grain, extent)
    fields = sample_fields(levels, centre, terrain.height_at, grain)
    _write_fields(spec, _drawing(name), fields, levels, THICK * extent)
    if not np.isfinite(spec.stat.extent):
        spec.stat.extent = draft.model.stat.extent
    if not np.isfinite(spec.stat.center).all():
        spec.stat.center = draft.model.stat.center


def _write_grains(spec: mujoco.MjSpec, drawing: str, period: float) -> None:
    """Add the material: noise, which far away becomes an even colour, and which shines a little under any light."""
    spec.add_texture(
        name=drawing,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_RANDOM,
        random=0.35,
        rgb1=SAND_RGB,
        markrgb=GRAIN_RGB,
        width=PIXELS,
        height=PIXELS,
    )
    repeat = 2.0 / period  # MuJoCo counts in half units
    grains = spec.add_material(
        name=drawing,
        texrepeat=[repeat, repeat],
        texuniform=True,
        emission=SHINE,
        specular=0.0,
        shininess=0.0,
        rgba=[1.0, 1.0, 1.0, 1.0],
    )
    grains.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = drawing


def _write_plane(spec: mujoco.MjSpec, drawing: str, terrain: FreeSurface) -> None:
    normal = terrain.normal
    half = 0.5 * math.acos(min(normal[2], 1.0))
    length = math.hypot(normal[0], normal[1]) or 1.0
    quat = [math.cos(half), -math.sin(half) * normal[1] / length, math.sin(half) * normal[0] / length, 0.0]
    _add_geom(
        spec, drawing, drawing, mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], pos=[0, 0, terrain.height], quat=quat
    )


def _write_fields(
    spec: mujoco.MjSpec, drawing: str, fields: Sequence[Field], levels: Sequence[Level], thick: float
) -> None:
    """Add height fields, finest first; their geoms have the bed's drawing's name and, from the second on, a number."""
    for k, (field, level) in enumerate(zip(fields, levels, strict=True)):
        name = f"{drawing}{k or ''}"
        low, high = float(field.heights.min()), float(field.heights.max())
        top = high - low if high - low > 1e-6 * level.width else level.width
        spec.add_hfield(
            name=name,
            nrow=level.cells + 1,
            ncol=level.cells + 1,
            size=[level.width / 2, level.width / 2, top, thick],
            userdata=field.heights.ravel(),
        )
        kind = mujoco.mjtGeom.mjGEOM_HFIELD
        _add_geom(spec, name, drawing, kind, hfieldname=name, pos=[*field.centre, low])


def _add_geom(spec: mujoco.MjSpec, name: str, material: str, kind: mujoco.mjtGeom, **rest: Any) -> None:
    spec.worldbody.add_geom(
        name=name, type=kind, contype=0, conaffinity=0, material=material, rgba=[1.0, 1.0, 1.0, 1.0], **rest
    )


def _drawing(bed: str) -> str:
    return bed + DRAWING_MARKER
