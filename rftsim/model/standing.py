"""How deep a model stands in its sand: each tree lowered or raised until the sand carries its weight.

Trees stay over the places where they are, and keep their pose. Under each the sand counts as the slope that it has in
the mean: the weight along its normal is what the sand has to carry.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.law import evaluate, layout
from rftsim.model.ground import ground
from rftsim.model.readout import instances
from rftsim.sand.free_surface import GroundLike
from rftsim.surface.triangles import Array

_JOINT = mujoco.mjtJoint
SLOW: Final = 1e-6
"""Speed of the straight push down [m/s], at which no inertia counts."""
DOUBLINGS: Final = 20
"""How often the depth that is tried is doubled before the sand counts as too weak."""
POINTS: Final = 33
"""Depths at which the force is evaluated at once."""
ROUNDS: Final = 5
"""How often the interval between two of these depths is divided again."""
REACH: Final = 0.88
"""Distance from a triangle's centre to its corners, over the root of its area, were its sides equal."""


VERTICAL: Final = np.array([0.0, 0.0, 1.0])
"""The way along which trees are lowered, shape (3,)."""
ACROSS: Final = 9
"""Places each way at which the ground's normal under a tree is taken."""


class Foot(NamedTuple):
    """A body that is in the sand where its tree stands."""

    body: int
    """The body's id."""
    sinkage: float
    """Depth of its lowest corner [m], see `sinkage`."""
    share: float
    """Share of the tree's weight that the sand carries by it."""


class Tree(NamedTuple):
    """Bodies that move up and down together, and how they stand in the sand."""

    root: int
    """Id of the first body that moves."""
    bodies: "NDArray[np.intp]"
    """Ids of all that move, shape (n,)."""
    weight: float
    """Their weight along `up` [N]."""
    up: Array
    """The sand's normal under them in the mean, shape (3,)."""
    lowered: float
    """How far they were moved down [m], negative where they were raised; infinite where the sand does not carry them
    at any depth, and nothing was moved."""
    feet: tuple[Foot, ...]
    """The bodies in the sand, by their share of the weight, the largest first."""
    rise: Array
    """Change of the joints' positions for each metre up, shape (nq,)."""


class Standing(NamedTuple):
    """The places at which a model stands in its sand, in the pose that it had."""

    qpos: Array
    """Positions of the joints, shape (nq,)."""
    trees: tuple[Tree, ...]
    """Those that can move up and down, have weight, and have a body that feels the sand."""

    def raised(self, share: float) -> Array:
        """Positions with each tree higher by a share of its largest sinkage, shape (nq,)."""
        heights = [share * max((foot.sinkage for foot in tree.feet), default=0.0) for tree in self.trees]
        up = [height * tree.rise for height, tree in zip(heights, self.trees, strict=True)]
        return self.qpos + np.sum(up, axis=0) if up else self.qpos.copy()


class _Mover(NamedTuple):
    """A body and the positions that move it, and all that hang on it, up and down."""

    body: int
    places: "NDArray[np.intp]"
    """Indices into qpos, shape (k,)."""
    rates: Array
    """How far each position moves per metre up, shape (k,)."""


def standing(model: mujoco.MjModel, data: mujoco.MjData) -> Standing:
    """Find how deep a compiled model with sand stands, in the pose that its data have; the data stay as they are.

    The forces are those of a straight push down, slow and along the normal, by the law of each bed. Trees keep their
    pose and their place: what would tilt, bend or slide under the load does not.
    """
    found = Standing(data.qpos.copy(), ())
    moved: set[int] = set()
    posed = mujoco.MjData(model)
    posed.qpos[:] = data.qpos
    for bed in instances(model):
        own = {body: surface for body, surface in bed.bodies.items() if body not in moved}
        more = stand(model, posed, PackedBed(bed.whole, own, ground(model, data, bed.name)))
        posed.qpos[:] = more.qpos
        moved.update(int(body) for tree in more.trees for body in tree.bodies)
        found = Standing(more.qpos, found.trees + more.trees)
    return found


class PackedBed(NamedTuple):
    """A bed of sand, which need not be in the model yet, and what feels it."""

    packed: Array
    """Packed sand."""
    surfaces: Mapping[int, Array]
    """Packed surface of each body that feels it, by body id."""
    ground: GroundLike
    """The surface that bounds it from above."""


def stand(model: mujoco.MjModel, data: mujoco.MjData, bed: PackedBed) -> Standing:
    """Find how deep a model stands in one bed of sand.

    Trees that touch, or that an equality joins, are moved as one.

    Args:
        model: Compiled.
        data: Its data, of which only qpos is read.
        bed: The sand, and what feels it.
    """
    posed = mujoco.MjData(model)
    posed.qpos[:] = data.qpos
    mujoco.mj_kinematics(model, posed)
    mujoco.mj_comPos(model, posed)
    mujoco.mj_collision(model, posed)
    qpos, trees = data.qpos.copy(), []
    for group in _groups(model, posed, list(_movers(model, posed))):
        bodies = np.concatenate([_subtree(model, mover.body) for mover in group])
        felt = {body: bed.surfaces[body] for body in bodies.tolist() if body in bed.surfaces}
        if not felt:
            continue
        up = _mean_normal(posed, felt, bed.ground)
        weight = _weight(model, bodies, up)
        if not weight > 0.0:
            continue
        rise = np.zeros(model.nq)
        for mover in group:
            rise[mover.places] += mover.rates
        tree = _stand_tree(
            posed, bed._replace(surfaces=felt), Tree(int(bodies.min()), bodies, weight, up, 0.0, (), rise)
        )
        qpos -= (tree.lowered if np.isfinite(tree.lowered) else 0.0) * rise
        trees.append(tree)
    return Standing(qpos, tuple(trees))


def _mean_normal(posed: mujoco.MjData, felt: Mapping[int, Array], ground: GroundLike) -> Array:
    """The ground's normal in the mean over the rectangle around some bodies, seen from above, shape (3,)."""
    corners = np.concatenate([_outline(surface, posed.xpos[b], posed.xmat[b]) for b, surface in felt.items()])
    x, y = np.linspace(corners.min(axis=0), corners.max(axis=0), ACROSS).T[:2]
    normal: Array = ground.normal_at(*np.meshgrid(x, y)).reshape(-1, 3).mean(axis=0)
    return normal / np.linalg.norm(normal)


def _box(surface: Array, xpos: Array, xmat: Array) -> Array:
    """Corners of the box around a packed surface, world frame [m], shape (8, 3)."""
    header = layout.record(surface, layout.HEADER)
    ends = np.stack([header.lowest, header.highest])
    corners = np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3)
    return corners @ np.reshape(xmat, (3, 3)).T + xpos


def _outline(surface: Array, xpos: Array, xmat: Array) -> Array:
    """Corners of the box around a packed surface, and centres of its triangles, world frame [m], shape (n, 3)."""
    centres = np.array(layout.read_columns(surface)[:3]).T @ np.reshape(xmat, (3, 3)).T + xpos
    return np.concatenate([_box(surface, xpos, xmat), centres])


def sinkage(ground: GroundLike, surface: Array, xpos: Array, xmat: Array) -> float:
    """The depth of a body's lowest corner below the free surface [m], negative above it; within a triangle's size.

    A packed surface knows its triangles' centres and areas, and its box: the lowest corner is no lower than the box's,
    and no farther from a centre than the corners of a triangle with equal sides.

    Args:
        ground: The sand's surface.
        surface: Packed surface.
        xpos: Position of the body's origin [m], shape (3,).
        xmat: Rotation to the world frame, shape (9,) or (3, 3).
    """
    rotation = np.reshape(xmat, (3, 3))
    *columns, area = layout.read_columns(surface)
    centre, normal = (np.array(columns[k : k + 3]).T @ rotation.T for k in (0, 3))
    centre += xpos
    along = (normal * ground.normal_at(centre[:, 0], centre[:, 1])).sum(axis=1)
    corners = ground.depth(centre) + REACH * np.sqrt(area * np.maximum(1.0 - along**2, 0.0))
    return float(min(ground.depth(_box(surface, xpos, xmat)).max(), corners.max()))


def moving_weight(model: mujoco.MjModel) -> float:
    """The weight of everything that can move, less what MuJoCo compensates [N]."""
    own = model.body_mass * (1.0 - model.body_gravcomp)
    return float(own[model.body_weldid != 0].sum() * np.linalg.norm(model.opt.gravity))


def _stand_tree(posed: mujoco.MjData, bed: PackedBed, tree: Tree) -> Tree:
    """The tree as it stands: lowered as far as its weight wants, with its feet."""
    lowered = _lowered(posed, bed, tree)
    if not np.isfinite(lowered):
        return tree._replace(lowered=lowered)
    feet = []
    for body, surface in bed.surfaces.items():
        alone = bed._replace(surfaces={body: surface})
        share = float(_lifts(posed, alone, tree.up, np.array([lowered]))[0]) / tree.weight
        if share != 0.0:
            depth = sinkage(bed.ground, surface, posed.xpos[body] - lowered * VERTICAL, posed.xmat[body])
            feet.append(Foot(body, depth, share))
    return tree._replace(lowered=lowered, feet=tuple(sorted(feet, key=lambda foot: -foot.share)))


def _lowered(posed: mujoco.MjData, bed: PackedBed, tree: Tree) -> float:
    """How far down the sand carries a tree's weight [m]; infinite where it does not at any depth."""
    points = np.concatenate([_outline(surface, posed.xpos[b], posed.xmat[b]) for b, surface in bed.surfaces.items()])
    touching = float((points[:, 2] - bed.ground.height_at(points[:, 0], points[:, 1])).min())
    step = max(layout.extent(surface) for surface in bed.surfaces.values())
    tried = np.concatenate([[touching - step], touching + step * 2.0 ** np.arange(-8, DOUBLINGS - 8)])
    for _ in range(ROUNDS + 1):
        lifts = _lifts(posed, bed, tree.up, tried)
        enough = np.flatnonzero(lifts >= tree.weight)
        if not enough.size or enough[0] == 0:
            return float(np.inf)
        ends = slice(enough[0] - 1, enough[0] + 1)
        low, high = tried[ends]
        tried = np.linspace(low, high, POINTS)
    return float(np.interp(tree.weight, lifts[ends], [low, high]))


def _lifts(posed: mujoco.MjData, bed: PackedBed, up: Array, lowered: Array) -> Array:
    """The sand's force along a normal on some bodies [N], lowered to depths [m] and pushed against it, both (n,)."""
    n, total = len(lowered), np.zeros(len(lowered))
    down, still = np.tile(-SLOW * up, (n, 1)), np.zeros((n, 3))
    for body, surface in bed.surfaces.items():
        places, turn = posed.xpos[body] - lowered[:, None] * VERTICAL, np.tile(posed.xmat[body], (n, 1))
        total += evaluate.body_wrenches(bed.packed, surface, places, turn, down, still)[:, :3] @ up
    return total


def _movers(model: mujoco.MjModel, posed: mujoco.MjData) -> Iterator[_Mover]:
    """The bodies that free joints, or slides that nothing drives, let move up and down with all that they bear."""
    bearing = np.zeros(model.nbody, dtype=bool)
    for body in range(1, model.nbody):
        bearing[body] = bearing[model.body_parentid[body]]
        mover = None if bearing[body] else _mover(model, posed, body)
        if mover is not None:
            bearing[body] = True
            yield mover


def _mover(model: mujoco.MjModel, posed: mujoco.MjData, body: int) -> _Mover | None:
    if not model.body_jntnum[body]:
        return None
    first = int(model.body_jntadr[body])
    if model.jnt_type[first] == _JOINT.mjJNT_FREE:
        return _Mover(body, model.jnt_qposadr[first] + np.arange(3), VERTICAL)
    slides = _slides(model, body)
    if not slides:
        return None
    axes = posed.xaxis[slides].T
    rates = np.linalg.lstsq(axes, VERTICAL, rcond=None)[0]
    if np.linalg.norm(axes @ rates - VERTICAL) > 1e-6:
        return None
    return _Mover(body, model.jnt_qposadr[slides], rates)


def _slides(model: mujoco.MjModel, body: int) -> list[int]:
    """The slides from the world down to a body, as far as no joint before them turns; none that is driven or sprung."""
    chain = [body]
    while model.body_parentid[chain[0]]:
        chain.insert(0, int(model.body_parentid[chain[0]]))
    driven = set(model.actuator_trnid[model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, 0].tolist())
    found: list[int] = []
    for one in chain:
        for joint in range(model.body_jntadr[one], model.body_jntadr[one] + model.body_jntnum[one]):
            if model.jnt_type[joint] != _JOINT.mjJNT_SLIDE:
                return found if one == body else []
            if joint not in driven and not np.any(model.jnt_stiffness[joint]):
                found.append(joint)
    return found


def _groups(model: mujoco.MjModel, posed: mujoco.MjData, movers: list[_Mover]) -> list[list[_Mover]]:
    """The movers, those together whose bodies touch or are joined by an equality."""
    owner = np.full(model.nbody, -1)
    for number, mover in enumerate(movers):
        owner[_subtree(model, mover.body)] = number
    group = np.arange(len(movers))
    for one, other in _joined(model, posed):
        a, b = owner[one], owner[other]
        if a >= 0 and b >= 0:
            group[group == group[b]] = group[a]
    return [[movers[i] for i in np.flatnonzero(group == label)] for label in np.unique(group)]


def _joined(model: mujoco.MjModel, posed: mujoco.MjData) -> Iterator[Any]:
    """Pairs of bodies that touch, or that an active equality holds together."""
    for contact in posed.contact:
        if min(contact.geom) >= 0 and contact.dist <= 0.0:
            yield model.geom_bodyid[contact.geom]
    for equality in np.flatnonzero(posed.eq_active):
        pair = model.eq_obj1id[equality], model.eq_obj2id[equality]
        if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_BODY:
            yield pair
        elif model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
            yield model.site_bodyid[list(pair)]


def _subtree(model: mujoco.MjModel, root: int) -> "NDArray[np.intp]":
    """Ids of a body and of all that hang on it, shape (n,)."""
    inside = np.zeros(model.nbody, dtype=bool)
    inside[root] = True
    for body in range(root + 1, model.nbody):
        inside[body] = inside[model.body_parentid[body]]
    return np.flatnonzero(inside)


def _weight(model: mujoco.MjModel, bodies: "NDArray[np.intp]", up: Array) -> float:
    """The weight of bodies along a normal [N], less what MuJoCo compensates."""
    return float((model.body_mass[bodies] * (1.0 - model.body_gravcomp[bodies])).sum() * -(model.opt.gravity @ up))
