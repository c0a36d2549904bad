"""The floor that a model stands on: where it lies, so that the sand takes its place, and how it stops carrying."""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from rftsim.model.draft import geom_of, shown
from rftsim.model.geometry import colliding
from rftsim.model.height_field import field_terrain
from rftsim.model.start import standing_trees
from rftsim.model.tops import LEVEL, POINTS, Top, top_at, top_points
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array

_GEOM = mujoco.mjtGeom
FLUSH: Final = 0.02
"""Distance from the sand's surface, over the reach, within which a face counts as part of it."""
ACROSS: Final = 9
"""Places along each side of a geom at which its top is held against a terrain."""
FEW: Final = 3
"""Names that a line tells before it counts the others."""


class Support(NamedTuple):
    """A geom whose place the sand takes, and the surface of its top."""

    geom: int
    """Id of the geom."""
    terrain: "FreeSurface | Terrain"
    """The plane of its top where the model stands, or the relief of a height field."""


class Floors(NamedTuple):
    """Static geoms that would carry the bodies a second time, or hide the sand, by their names in the draft."""

    terrain: "FreeSurface | Terrain"
    """The sand's surface."""
    flush: float
    """Distance from it within which a face counts as part of it [m]."""
    depths: dict[str, float]
    """Depth below the sand's surface of those that collide [m]."""
    drawn: list[str]
    """Those that are only drawn in the sand's surface."""


def find_support(model: mujoco.MjModel, data: mujoco.MjData) -> Support | None:
    """Find the geom that a model's heaviest tree stands on at the start: the highest top below its centre of mass.

    Trees that can fall count first, and then those whose base is fixed. What is narrower than the tree carries it only
    where nothing else does, and what lies above only where nothing lies below.

    Args:
        model: Compiled.
        data: Its data at the start, with kinematics and centres of mass.

    Raises:
        SceneError: It is a height field that is tilted.
    """
    candidates = _static(model, can_touch(model))
    moving = [body for body in range(1, model.nbody) if model.body_weldid[body] == body]
    for root in [*standing_trees(model), *moving]:
        place = data.subtree_com[root]
        tops = {geom: top for geom in candidates if (top := top_at(model, data, geom, place)) is not None}
        if tops:
            below = {geom: top for geom, top in tops.items() if top.height <= place[2]}
            wide = {geom: top for geom, top in below.items() if _radius(model, geom) >= _spread(model, data, root)}
            under = wide or below
            geom = max(under, key=lambda g: under[g].height) if under else min(tops, key=lambda g: tops[g].height)
            return Support(geom, _surface(model, data, geom, tops[geom], place))
    return None


def _radius(model: mujoco.MjModel, geom: int) -> float:
    """Radius of the ball around a geom [m], infinite of planes."""
    return float(model.geom_rbound[geom]) or np.inf


def _spread(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> float:
    """How far the geoms of a tree lie from its centre of mass, along the level [m]."""
    own = data.geom_xpos[model.body_rootid[model.geom_bodyid] == model.body_rootid[root]]
    return float(np.linalg.norm(own[:, :2] - data.subtree_com[root][:2], axis=1).max(initial=0.0))


def _surface(model: mujoco.MjModel, data: mujoco.MjData, geom: int, top: Top, place: Array) -> "FreeSurface | Terrain":
    """The relief of a height field, or the plane through the top of another geom at a place."""
    if model.geom_type[geom] == int(_GEOM.mjGEOM_HFIELD):
        return field_terrain(model, data, geom)
    normal = np.where(np.abs(top.normal) < 1e-9, 0.0, top.normal)
    at = np.array([place[0], place[1], top.height])
    height = float(normal @ at / normal[2])
    return FreeSurface(round(height, 12) + 0.0, tuple(normal.tolist()))


def can_touch(model: mujoco.MjModel) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Whether each geom can collide with a geom that moves, by bits or by a contact pair, shape (ngeom,)."""
    moves = model.body_weldid[model.geom_bodyid] != 0
    types, affinities = model.geom_contype, model.geom_conaffinity
    bits = {(int(t), int(a)) for t, a in zip(types[moves], affinities[moves], strict=True)}
    touches = np.zeros(model.ngeom, dtype=bool)
    for contype, conaffinity in bits:
        touches |= ((types & conaffinity) != 0) | ((affinities & contype) != 0)
    for one, other in ((model.pair_geom1, model.pair_geom2), (model.pair_geom2, model.pair_geom1)):
        touches[one[moves[other]]] = True
    return touches


def _static(model: mujoco.MjModel, among: Any) -> list[int]:
    """Those among the geoms that nothing moves, mocap bodies included."""
    held = (model.body_weldid == 0) & (model.body_mocapid[model.body_rootid] < 0)
    return np.flatnonzero(held[model.geom_bodyid] & among).tolist()


def find_floors(model: mujoco.MjModel, data: mujoco.MjData, terrain: "FreeSurface | Terrain", reach: float) -> Floors:
    """The floors of a model near the terrain.

    Planes and height fields are floors where they are nearer than the reach above or below it. Others have edges: those
    that stand out of the sand are obstacles, and stay.

    Args:
        model: Compiled.
        data: Its data at the start, with kinematics and centres of mass.
        terrain: Surface of the sand.
        reach: Size of the largest body that feels the sand [m].
    """
    trees = standing_trees(model)
    start = data.subtree_com[trees[0]] if trees else np.zeros(3)
    endless = (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_HFIELD)
    collides, flush, depths, drawn = colliding(model), FLUSH * reach, {}, []
    for geom in _static(model, np.ones(model.ngeom, dtype=bool)):
        kind, name = _GEOM(model.geom_type[geom]), model.geom(geom).name
        at = start if kind == _GEOM.mjGEOM_PLANE else data.geom_xpos[geom]
        points = top_points(model, data, geom, _places(terrain, at, _radius(model, geom)))
        if not len(points):
            continue
        depth = terrain.depth(points)
        nearest = float(depth[np.argmin(np.abs(depth))])
        if collides[geom] and abs(nearest) <= reach and (kind in endless or depth.min() >= -flush):
            depths[name] = nearest
        elif not collides[geom] and np.abs(depth).max() <= flush and _parallel(model, data, geom, terrain, at):
            drawn.append(name)
    return Floors(terrain, flush, depths, drawn)


def _places(terrain: "FreeSurface | Terrain", at: Array, radius: float) -> Array:
    """Places over which a geom's top is held against the sand [m], shape (n, 3): of a plane one shows them all.

    Args:
        terrain: Surface of the sand.
        at: The middle of them, shape (3,).
        radius: How far the geom goes about it [m]; infinite for as far as the terrain does.
    """
    if isinstance(terrain, FreeSurface):
        return at[None]
    (x0, y0), (x1, y1) = terrain.window
    if not np.isfinite(radius):
        x, y = np.linspace(x0, x1, POINTS), np.linspace(y0, y1, POINTS)
    else:
        x, y = (np.linspace(c - radius, c + radius, ACROSS) for c in at[:2])
    across = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
    return np.concatenate([at[None], across])


def _parallel(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, terrain: "FreeSurface | Terrain", at: Array
) -> bool:
    """Whether a geom's top is parallel to the sand in its middle; a height field, whose points were held to it, is."""
    top = top_at(model, data, geom, at)
    normal = terrain.normal_at(at[0], at[1])
    is_field = model.geom_type[geom] == int(_GEOM.mjGEOM_HFIELD)
    return is_field or (top is not None and bool(top.normal @ normal > 1.0 - 1e-6))


def remove_floors(spec: mujoco.MjSpec, floors: Floors) -> int:
    """Take collision from floors, pairs included, and hide them; returns how many pairs went."""
    for name in (*floors.depths, *floors.drawn):
        geom = geom_of(spec, name)
        geom.contype = geom.conaffinity = 0
        geom.rgba = [0.0, 0.0, 0.0, 0.0]
    pairs = [pair for pair in spec.pairs if {pair.geomname1, pair.geomname2} & floors.depths.keys()]
    for pair in pairs:
        spec.delete(pair)
    return len(pairs)


def say_ground(support: str | None, floors: Floors, pairs: int) -> list[str]:
    """The line that says whose place the sand takes.

    Args:
        support: Name of the height field whose relief the sand takes, if it is one.
        floors: The floors, which were removed.
        pairs: How many contact pairs went with them.
    """
    if not floors.depths:
        return []
    many = len(floors.depths) > 1
    gone = "which no longer collide and are hidden" if many else "which no longer collides and is hidden"
    more = f", nor {'do' if pairs > 1 else 'does'} {pairs} contact pair{'s' if pairs > 1 else ''}" if pairs else ""
    others = [name for name in floors.depths if name != support]
    place = f"in the place of {_list(others)}"
    if len(others) < len(floors.depths) and support is not None:
        place = f"in the place and with the relief of {shown(support)}" + (f", and {place}" if others else "")
    line = f"the sand lies at {_said(floors.terrain)}, {place}"
    return [f"{line}, {gone}{more} (keep_floor=True keeps {'them' if many else 'it'})"]


def _said(terrain: "FreeSurface | Terrain") -> str:
    """The height of a surface in words."""
    if isinstance(terrain, Terrain):
        return f"z = {terrain.heights.min():.4g} to {terrain.heights.max():.4g} m"
    tilt = f", tilted by {np.degrees(np.arccos(terrain.normal[2])):.3g} degrees" if terrain.normal[2] < 1.0 else ""
    return f"z = {terrain.height:.6g} m{tilt}"


def floor_doubts(floors: Floors) -> list[str]:
    """The warning of floors that were kept, if there are any."""
    if not floors.depths:
        return []
    depth = min(floors.depths.values(), key=abs)
    return [
        f"{_list(floors.depths)} lies {depth:.3g} m below the sand's surface and collides: it supports the bodies a "
        "second time. Let the sand take its place (keep_floor=False) or lower it"
    ]


def _list(names: Mapping[str, Any] | Iterable[str]) -> str:
    told = [shown(name) for name in names]
    return " and ".join([", ".join(told[:FEW]), f"{len(told) - FEW} more"] if len(told) > FEW else [", ".join(told)])


def carrying(model: mujoco.MjModel, qpos: Array, floors: Floors) -> list[str]:
    """The warning of static geoms that still carry bodies at the sand's level, by their contacts, if there are any.

    Args:
        model: Compiled; the floors stop colliding in it.
        qpos: Positions at which it stands in the sand, shape (nq,).
        floors: Those that are known.
    """
    gone, terrain = [model.geom(name).id for name in floors.depths], floors.terrain
    model.geom_contype[gone] = model.geom_conaffinity[gone] = 0
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    static, found = set(_static(model, np.ones(model.ngeom, dtype=bool))) - set(gone), {}
    for contact in data.contact:
        pair = {int(g) for g in contact.geom}
        normal = terrain.normal_at(contact.pos[0], contact.pos[1])
        if len(pair & static) != 1 or pair & set(gone) or abs(contact.frame[:3] @ normal) < LEVEL:
            continue
        (geom,), (other,) = pair & static, pair - static
        if model.body_weldid[model.geom_bodyid[other]] != 0 and terrain.depth(contact.pos) >= -floors.flush:
            found[model.geom(geom).name] = model.body(model.geom_bodyid[other]).name
    if not found:
        return []
    return [
        f"{_list(found)} still carries body {next(iter(found.values()))} at the sand's level, beside the sand: move "
        "it, or take its collision away"
    ]
