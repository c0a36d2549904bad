"""How deep a model stands in its sand: each tree moved along the sand's normal until the sand carries its weight."""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rftsim.law import evaluate, layout
from rftsim.model.readout import instances
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


class Foot(NamedTuple):
    """A body that is in the sand where its tree stands."""

    body: int
    """The body's id."""
    sinkage: float
    """Depth of its lowest corner [m], see `sinkage`."""
    share: float
    """Share of the tree's weight that the sand carries by it."""


class Tree(NamedTuple):
    """Bodies that move together along the sand's normal, and how they stand in it."""

    root: int
    """Id of the first body that moves."""
    bodies: "NDArray[np.intp]"
    """Ids of all that move, shape (n,)."""
    weight: float
    """Their weight along the sand's normal [N]."""
    lowered: float
    """How far they were moved down along the normal [m], negative where they were raised; infinite where the sand
    does not carry them at any depth, and nothing was moved."""
    feet: tuple[Foot, ...]
    """The bodies in the sand, by their share of the weight, the largest first."""
    rise: Array
    """Change of the joints' positions for each metre up along the normal, shape (nq,)."""


class Standing(NamedTuple):
    """The places at which a model stands in its sand, in the pose that it had."""

    qpos: Array
    """Positions of the joints, shape (nq,)."""
    trees: tuple[Tree, ...]
    """Those that can move along the sand's normal, have weight, and have a body that feels the sand."""

    def raised(self, share: float) -> Array:
        """Positions with each tree higher by a share of its largest sinkage, shape (nq,)."""
        heights = [share * max((foot.sinkage for foot in tree.feet), default=0.0) for tree in self.trees]
        up = [height * tree.rise for height, tree in zip(heights, self.trees, strict=True)]
        return self.qpos + np.sum(up, axis=0) if up else self.qpos.copy()


class _Mover(NamedTuple):
    """A body and the positions that move it, and all that hang on it, along the sand's normal."""

    body: int
    places: "NDArray[np.intp]"
    """Indices into qpos, shape (k,)."""
    rates: Array
    """How far each position moves per metre along the normal, shape (k,)."""


def standing(model: mujoco.MjModel, data: mujoco.MjData) -> Standing:
    """Find how deep a compiled model with sand stands, in the pose that its data have; the data stay as they are.

    The forces are those of a straight push down, slow and along the normal, by the law of each bed. Trees keep their
    pose: what would tilt or bend under the load does not.
    """
    found = Standing(data.qpos.copy(), ())
    moved: set[int] = set()
    posed = mujoco.MjData(model)
    posed.qpos[:] = data.qpos
    for bed in instances(model):
        own = {body: surface for body, surface in bed.bodies.items() if body not in moved}
        more = stand(model, posed, bed.packed, own)
        posed.qpos[:] = more.qpos
        moved.update(int(body) for tree in more.trees for body in tree.bodies)
        found = Standing(more.qpos, found.trees + more.trees)
    return found


def stand(model: mujoco.MjModel, data: mujoco.MjData, bed: Array, surfaces: Mapping[int, Array]) -> Standing:
    """Find how deep a model stands in one bed of sand, which need not be in the model yet.

    Trees that touch, or that an equality joins, are moved as one.

    Args:
        model: Compiled.
        data: Its data, of which only qpos is read.
        bed: Packed sand.
        surfaces: Packed surface of each body that feels the sand, by body id.
    """
    posed = mujoco.MjData(model)
    posed.qpos[:] = data.qpos
    mujoco.mj_kinematics(model, posed)
    mujoco.mj_comPos(model, posed)
    mujoco.mj_collision(model, posed)
    up = layout.record(bed, layout.BED).up
    qpos, trees = data.qpos.copy(), []
    for group in _groups(model, posed, list(_movers(model, posed, up))):
        bodies = np.concatenate([_subtree(model, mover.body) for mover in group])
        felt = {body: surfaces[body] for body in bodies.tolist() if body in surfaces}
        weight = _weight(model, bodies, up)
        if not felt or not weight > 0.0:
            continue
        rise = np.zeros(model.nq)
        for mover in group:
            rise[mover.places] += mover.rates
        tree = _stand_tree(posed, bed, felt, Tree(int(bodies.min()), bodies, weight, 0.0, (), rise))
        qpos -= (tree.lowered if np.isfinite(tree.lowered) else 0.0) * rise
        trees.append(tree)
    return Standing(qpos, tuple(trees))


def sinkage(bed: Array, surface: Array, xpos: Array, xmat: Array) -> float:
    """The depth of a body's lowest corner below the free surface [m], negative above it; within a triangle's size.

    A packed surface knows its triangles' centres and areas, and its box: the lowest corner is no lower than the box's,
    and no farther from a centre than the corners of a triangle with equal sides.

    Args:
        bed: Packed sand.
        surface: Packed surface.
        xpos: Position of the body's origin [m], shape (3,).
        xmat: Rotation to the world frame, shape (9,) or (3, 3).
    """
    sand, header = layout.record(bed, layout.BED), layout.record(surface, layout.HEADER)
    up = sand.up @ np.reshape(xmat, (3, 3))
    below = float(sand.offset - sand.up @ xpos)
    box = -np.minimum(up * header.lowest, up * header.highest).sum()
    *columns, area = layout.read_columns(surface)
    tilt = np.sqrt(np.maximum(1.0 - (up @ np.array(columns[3:])) ** 2, 0.0))
    corners = (REACH * np.sqrt(area) * tilt - up @ np.array(columns[:3])).max()
    return below + float(min(box, corners))


def moving_weight(model: mujoco.MjModel) -> float:
    """The weight of everything that can move, less what MuJoCo compensates [N]."""
    own = model.body_mass * (1.0 - model.body_gravcomp)
    return float(own[model.body_weldid != 0].sum() * np.linalg.norm(model.opt.gravity))


def _stand_tree(posed: mujoco.MjData, bed: Array, felt: Mapping[int, Array], tree: Tree) -> Tree:
    """The tree as it stands: lowered as far as its weight wants, with its feet."""
    up = layout.record(bed, layout.BED).up
    lowered = _lowered(posed, bed, felt, tree.weight)
    if not np.isfinite(lowered):
        return tree._replace(lowered=lowered)
    feet = []
    for body, surface in felt.items():
        share = float(_lifts(posed, bed, {body: surface}, np.array([lowered]))[0]) / tree.weight
        if share != 0.0:
            depth = sinkage(bed, surface, posed.xpos[body] - lowered * up, posed.xmat[body])
            feet.append(Foot(body, depth, share))
    return tree._replace(lowered=lowered, feet=tuple(sorted(feet, key=lambda foot: -foot.share)))


def _lowered(posed: mujoco.MjData, bed: Array, felt: Mapping[int, Array], weight: float) -> float:
    """How far down the sand carries a weight [m]; infinite where it does not at any depth."""
    touching = -max(sinkage(bed, surface, posed.xpos[body], posed.xmat[body]) for body, surface in felt.items())
    step = max(layout.extent(surface) for surface in felt.values())
    tried = np.concatenate([[touching - step], touching + step * 2.0 ** np.arange(-8, DOUBLINGS - 8)])
    for _ in range(ROUNDS + 1):
        lifts = _lifts(posed, bed, felt, tried)
        enough = np.flatnonzero(lifts >= weight)
        if not enough.size or enough[0] == 0:
            return float(np.inf)
        ends = slice(enough[0] - 1, enough[0] + 1)
        low, high = tried[ends]
        tried = np.linspace(low, high, POINTS)
    return float(np.interp(weight, lifts[ends], [low, high]))


def _lifts(posed: mujoco.MjData, bed: Array, felt: Mapping[int, Array], lowered: Array) -> Array:
    """The sand's force along its normal on some bodies [N], pushed straight down to depths [m], both (n,)."""
    up = layout.record(bed, layout.BED).up
    n, total = len(lowered), np.zeros(len(lowered))
    down, still = np.tile(-SLOW * up, (n, 1)), np.zeros((n, 3))
    for body, surface in felt.items():
        places, turn = posed.xpos[body] - lowered[:, None] * up, np.tile(posed.xmat[body], (n, 1))
        total += evaluate.body_wrenches(bed, surface, places, turn, down, still)[:, :3] @ up
    return total


def _movers(model: mujoco.MjModel, posed: mujoco.MjData, up: Array) -> Iterator[_Mover]:
    """The bodies that free joints, or slides that nothing drives, let move along the normal with all that they bear."""
    bearing = np.zeros(model.nbody, dtype=bool)
    for body in range(1, model.nbody):
        bearing[body] = bearing[model.body_parentid[body]]
        mover = None if bearing[body] else _mover(model, posed, body, up)
        if mover is not None:
            bearing[body] = True
            yield mover


def _mover(model: mujoco.MjModel, posed: mujoco.MjData, body: int, up: Array) -> _Mover | None:
    if not model.body_jntnum[body]:
        return None
    first = int(model.body_jntadr[body])
    if model.jnt_type[first] == _JOINT.mjJNT_FREE:
        return _Mover(body, model.jnt_qposadr[first] + np.arange(3), up.copy())
    slides = _slides(model, body)
    if not slides:
        return None
    axes = posed.xaxis[slides].T
    rates = np.linalg.lstsq(axes, up, rcond=None)[0]
    if np.linalg.norm(axes @ rates - up) > 1e-6:
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
