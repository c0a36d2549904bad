"""Where the sand lies: as the caller says, as another bed of the model does, or in the place of the floor."""

from typing import NamedTuple

import mujoco

from rftsim.errors import SandError, SceneError
from rftsim.law import layout
from rftsim.model.draft import Draft
from rftsim.model.floors import find_support
from rftsim.model.height_field import field_terrain
from rftsim.model.readout import Instance, instances
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import PAD, Terrain
from rftsim.sand.terrains import make_terrain

_HFIELD = int(mujoco.mjtGeom.mjGEOM_HFIELD)


class Site(NamedTuple):
    """The surface of the sand, and what it was taken from."""

    terrain: "FreeSurface | Terrain"
    """Its surface."""
    field: str | None
    """Name in the draft of the height field whose relief it has, if it has one's."""


def find_site(draft: Draft, terrain: "FreeSurface | Terrain | float | str | None") -> Site:
    """The free surface that was asked for, or that of another bed of the model, or that of its floor, or z = 0.

    Args:
        draft: The draft of the model that is to have sand.
        terrain: A surface, or what names one: a height field geom of the model, or see `make_terrain`; None for none.

    Raises:
        SceneError: It names nothing, or a height field is tilted.
        ValueError: There is no such surface.
    """
    if isinstance(terrain, str):
        return _named(draft, terrain)
    if terrain is not None:
        return Site(make_terrain(terrain), None)
    for bed in instances(draft.model):
        return Site(_surface(bed), None)
    support = find_support(draft.model, draft.data)
    if support is None:
        return Site(FreeSurface(), None)
    is_field = draft.model.geom_type[support.geom] == _HFIELD
    return Site(support.terrain, draft.model.geom(support.geom).name if is_field else None)


def _surface(bed: Instance) -> "FreeSurface | Terrain":
    """The free surface of another bed."""
    if bed.relief is None:
        return FreeSurface(float(bed.bed.offset / bed.bed.up[2]), tuple(bed.bed.up.tolist()))
    head = layout.record(bed.relief, layout.TERRAIN)
    shape = (int(head.rows) + 2 * PAD, int(head.columns) + 2 * PAD)
    heights = bed.relief[layout.TERRAIN_NUMBERS :].reshape(shape) + float(bed.bed.offset)
    return Terrain.from_coefficients(heights, (head.dx, head.dy), (head.x, head.y), bool(head.repeat))


def _named(draft: Draft, name: str) -> Site:
    """The relief of a height field of the model, or the surface that a text stands for."""
    model, data = draft.model, draft.data
    kinds = {model.geom(geom).name: int(model.geom_type[geom]) for geom in range(model.ngeom)}
    if kinds.get(name) == _HFIELD:
        return Site(field_terrain(model, data, model.geom(name).id), name)
    try:
        return Site(make_terrain(name), None)
    except SandError as error:
        if not str(error).startswith("no terrain"):
            raise
        fields = [other for other, kind in kinds.items() if kind == _HFIELD]
        known = f"which has {', '.join(map(repr, fields))}" if fields else "which has none"
        said = f"{error}, or the name of a height field geom of the model, {known}"
        raise SceneError(said) from None
