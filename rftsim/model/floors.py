"""Floors beneath sand: what would support the bodies a second time, because MuJoCo lets them collide with it."""

from collections.abc import Iterable, Mapping

import mujoco

from rftsim.model.draft import geom_of, shown
from rftsim.model.geometry import is_colliding
from rftsim.sand.free_surface import FreeSurface
from rftsim.surface.triangles import Surface

_GEOM = mujoco.mjtGeom


def find_floors(model: mujoco.MjModel, surfaces: Mapping[str, Surface], terrain: FreeSurface) -> dict[str, float]:
    """Depths of colliding planes and height fields near the terrain by their names [m], positive below it.

    Near is nearer than the largest body that feels the sand is long; those of bodies that can move are no floors.
    """
    reach = max(surface.size for surface in surfaces.values())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = {}
    for geom in range(model.ngeom):
        kind = _GEOM(model.geom_type[geom])
        if kind not in (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_HFIELD) or not is_colliding(model, geom):
            continue
        depth = float(terrain.depth(data.geom_xpos[geom]))
        if model.body_weldid[model.geom_bodyid[geom]] == 0 and abs(depth) <= reach:
            found[model.geom(geom).name] = depth
    return found


def disable_floors(spec: mujoco.MjSpec, floors: Iterable[str]) -> None:
    """Take collision from floors, given by their names in the draft."""
    for floor in floors:
        geom = geom_of(spec, floor)
        geom.contype = geom.conaffinity = 0


def floor_doubts(floors: Mapping[str, float]) -> list[str]:
    """Warnings of floors that stay as they are, one sentence or two for each."""
    return [
        f"{shown(floor)} lies {depth:.3g} m below the sand's surface and collides: it supports the bodies a "
        "second time. Take its collision away (disable_floor=True) or lower it"
        for floor, depth in floors.items()
    ]
