"""Doubts about a model on sand that its numbers tell before it runs: units, footprints, and how deep it will sink."""

import math
from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from rftsim.model.geometry import colliding, geom_triangles, own_geoms
from rftsim.model.standing import Foot, Standing
from rftsim.sand.free_surface import FreeSurface, slope_normal
from rftsim.sand.medium import Sand
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array, Surface

SMALL: Final = 0.25
"""Footprint of what collides over that of what is seen below which the difference is said [-]."""
SOLE: Final = 0.5
"""Part of a foot's height, from below, whose outline is its footprint [-]."""
ROUNDING: Final = 0.01
"""Angle that is rounding [degrees]."""
_UNITS: Final = {100.0: "centimetres", 1000.0: "millimetres"}


def gravity_doubts(model: mujoco.MjModel, sand: Sand) -> list[str]:
    """The doubt about another gravity than the sand's, or about units that cannot be SI, if there is any."""
    gravity = float(np.linalg.norm(model.opt.gravity))
    if abs(gravity - sand.g) <= 0.02 * sand.g:
        return []
    if gravity == 0.0:
        return [f"the model has no gravity: nothing lies on the sand, whose strength is that under {sand.g:.3g} m/s^2"]
    for factor, unit in _UNITS.items():
        if abs(gravity - 9.81 * factor) <= 0.02 * gravity:
            return [
                f"the model's gravity is {gravity:.4g}, so its lengths are in {unit} and not in metres: the sand's "
                f"force would be wrong by a factor of about {factor**2:.0e}. Scale the model to SI units"
            ]
    return [
        f"the model's gravity is {gravity:.3g} m/s^2 and the sand's strength belongs to {sand.g:.3g}: if the sand "
        f"is under the model's gravity, pass sand.replace(g={gravity:.4g}), which scales it"
    ]


def slope_doubts(model: mujoco.MjModel, sand: Sand, terrain: "FreeSurface | Terrain") -> list[str]:
    """The doubt about sand too steep to lie, or about gravity that does not point along -z, if there is any."""
    gravity = np.array(model.opt.gravity)
    strength = float(np.linalg.norm(gravity))
    if strength == 0.0:
        return []
    is_plane = isinstance(terrain, FreeSurface)
    normals = np.array(terrain.normal) if isinstance(terrain, FreeSurface) else slope_normal(*terrain.slopes())
    tilts, aside = (
        np.degrees(np.arccos(np.clip(-up @ gravity / strength, -1.0, 1.0)))
        for up in (normals, np.array([0.0, 0.0, 1.0]))
    )
    tilt, repose = float(tilts.max()), math.degrees(sand.repose)
    if tilt > repose + ROUNDING:
        friction = "" if sand.mu_int is None else f" (mu_int {sand.mu_int:g})"
        part = "" if is_plane else f"on {100.0 * float((tilts > repose).mean()):.2g} % of its area, "
        return [
            f"the sand's surface is tilted by {'' if is_plane else 'up to '}{tilt:.3g} degrees against gravity, {part}"
            f"beyond its angle of repose of {repose:.3g}{friction}: such sand flows, which the laws do not know. Make "
            "it flatter, or turn gravity"
        ]
    if min(aside, tilt) > ROUNDING:
        return [
            f"gravity points {aside:.3g} degrees away from -z, so that the sand lies as on a slope of {tilt:.3g} "
            "degrees: depth counts along its normal, and the laws were measured on level ground. Its normal is "
            "that of terrain="
        ]
    return []


def sinkage_doubts(model: mujoco.MjModel, found: Standing, surfaces: Mapping[str, Surface]) -> list[str]:
    """The doubt about trees that the sand does not carry, or whose feet sink deeper than they are long, if any."""
    lost = [model.body(tree.root).name for tree in found.trees if not np.isfinite(tree.lowered)]
    if lost:
        return [f"the sand does not carry {', '.join(lost)} at any depth: take stronger sand, or larger feet"]
    feet = [foot for tree in found.trees for foot in tree.feet]
    deep = [foot for foot in feet if foot.sinkage > surfaces[model.body(foot.body).name].size]
    if not deep:
        return []
    worst = max(deep, key=lambda foot: foot.sinkage)
    name = model.body(worst.body).name
    return [
        f"{name} will sink {1e3 * worst.sinkage:.0f} mm to carry its share of the weight, deeper than it is long "
        f"({1e3 * surfaces[name].size:.0f} mm){_others(len(deep) - 1)}: take stronger sand, or larger feet"
    ]


def footprint_doubts(model: mujoco.MjModel, found: Standing, terrain: "FreeSurface | Terrain") -> list[str]:
    """The doubt about feet of which much less collides than is seen, if there are any.

    Args:
        model: Compiled.
        found: How it stands in the sand.
        terrain: Surface of the sand.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = found.qpos
    mujoco.mj_kinematics(model, data)
    small: list[tuple[float, float, Foot]] = []
    for foot in (foot for tree in found.trees for foot in tree.feet):
        felt, seen = (_footprint(model, data, foot.body, collides, terrain) for collides in (True, False))
        if 0.0 < felt < SMALL * seen:
            small.append((felt, seen, foot))
    if not small:
        return []
    felt, seen, foot = min(small, key=lambda one: one[0] / one[1])
    return [
        f"of the sole of {model.body(foot.body).name} {1e4 * felt:.3g} of {1e4 * seen:.3g} cm^2 collide"
        f"{_others(len(small) - 1)}: the sand feels only that; give it geoms that collide over the whole sole"
    ]


def _footprint(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, collides: bool, terrain: "FreeSurface | Terrain"
) -> float:
    """Area of the outline, from above, of the lower part of a body's geoms that collide, or of the others [m^2]."""
    can = colliding(model)
    corners = [_placed(model, data, geom) for geom in own_geoms(model, body) if bool(can[geom]) == collides]
    if not corners:
        return 0.0
    depths = [terrain.depth(points) for points in corners]
    deepest = max(depth.max() for depth in depths)
    sole = deepest - SOLE * (deepest - min(depth.min() for depth in depths))
    low = [points[depth >= sole] for points, depth in zip(corners, depths, strict=True)]
    normal = terrain.normal_at(*data.xpos[body][:2])
    if not collides:
        return _outline(np.concatenate(low), normal)
    return sum(_outline(points, normal) for points in low)  # as if none overlapped another: at most what is felt


def _placed(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Array:
    """Vertices of a geom in the world frame [m], shape (nvert, 3)."""
    placed: Array = geom_triangles(model, geom)[0] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return placed


def _outline(points: Array, normal: Array) -> float:
    """Area of the convex hull of points seen along a normal [m^2]; zero of fewer than three."""
    import manifold3d  # not at start-up, where few models need it

    flat = points @ np.linalg.svd(normal[None])[2][1:].T
    return float(manifold3d.CrossSection.hull_points(np.ascontiguousarray(flat)).area())


def _others(count: int) -> str:
    return f" (and {count} more bodies)" if count > 1 else " (and another body)" if count else ""
