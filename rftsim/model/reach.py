"""The reach of a model's bodies as their joints let them go: orientations, motions, nearness to the sand."""

import math
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.reduction.samples import POSES, Reach, free_reach, middle, turned_by
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.terrain import Terrain
from rftsim.surface.triangles import Array, Surface

_JOINT = mujoco.mjtJoint
GIVE: Final = 0.05
"""Share of its range by which a joint may pass its limits, which are soft."""


class Slopes(NamedTuple):
    """The slopes on which a body may stand, in whose frame it is seen: there the sand is level."""

    steepest: float = 0.0
    """The steepest of them [rad]."""
    across: Array | None = None
    """The axis about which all of them lean, shape (3,): the normal of a plane of motion; None for any heading."""


LEVEL: Final = Slopes()
"""The one slope of a plane, in whose frame it is level."""


def slopes_of(terrain: "FreeSurface | Terrain", plane: Array | None) -> Slopes:
    """The slopes that a surface has, or may have where it is moved in place.

    Args:
        terrain: Surface of the sand.
        plane: Normal of the plane of motion, shape (3,); None where the bodies move in space.
    """
    return LEVEL if isinstance(terrain, FreeSurface) else Slopes(terrain.steepest, plane)


def sampled_reach(model: mujoco.MjModel, body: int, surface: Surface, seed: int, slopes: Slopes = LEVEL) -> Reach:
    """Orientations and motions of a body at joint positions drawn within their ranges, on slopes drawn among some.

    Args:
        model: Compiled.
        body: The body's id.
        surface: Its surface.
        seed: Seed of the joint positions and of the slopes.
        slopes: Slopes of the sand, which the orientations and motions are relative to.
    """
    if _hangs_on_nothing(model, body):
        return free_reach(seed)
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    turn, jacobians = np.empty((POSES, 3, 3)), np.empty((POSES, 2, 3, model.nv))
    positions = _scattered(model, rng)
    for i in range(POSES):
        data.qpos[:] = positions[i]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        turn[i] = data.xmat[body].reshape(3, 3)
        point = data.xpos[body] + turn[i] @ middle(surface)
        mujoco.mj_jac(model, data, jacobians[i, 0], jacobians[i, 1], point, body)
    scaled = jacobians.reshape(POSES, 6, -1) * np.repeat([1.0, surface.size / 2], 3)[:, None]
    basis, share, _ = np.linalg.svd(scaled, full_matrices=False)
    basis = basis * (share > 1e-9 * share[:, :1])[:, None]
    reach = Reach(turn, basis @ basis.transpose(0, 2, 1))
    return _leaned(reach, slopes, rng) if slopes.steepest > 0.0 else reach


def _leaned(reach: Reach, slopes: Slopes, rng: np.random.Generator) -> Reach:
    """The orientations and motions as they are seen from slopes, one for each: evenly steep, of any heading."""
    heading = rng.uniform(-math.pi, math.pi, size=POSES)
    axis = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(POSES)])
    if slopes.across is not None:
        axis = np.sign(heading)[:, None] * slopes.across
    half = rng.uniform(0.0, slopes.steepest / 2, size=(POSES, 1))
    lean = turned_by(np.hstack([np.cos(half), np.sin(half) * axis]))
    both = np.zeros((POSES, 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = lean
    return Reach(lean @ reach.rotations, both @ reach.motions @ both.transpose(0, 2, 1))


def _hangs_on_nothing(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body's tree has a free joint: then every orientation is as likely, and every motion allowed."""
    root = model.body_rootid[body]
    return bool(model.body_jntnum[root]) and model.jnt_type[model.body_jntadr[root]] == int(_JOINT.mjJNT_FREE)


def _scattered(model: mujoco.MjModel, rng: np.random.Generator) -> Array:
    """Joint positions drawn within their ranges, (POSES, nq); where a body stands does not matter, so free ones stay.

    That turns them any way within their range, if they have one.
    """
    positions = np.tile(model.qpos0, (POSES, 1))
    for joint in range(model.njnt):
        kind, at = _JOINT(model.jnt_type[joint]), model.jnt_qposadr[joint]
        limited, (low, high) = bool(model.jnt_limited[joint]), model.jnt_range[joint]
        if kind == _JOINT.mjJNT_BALL:
            positions[:, at : at + 4] = _quaternions(high if limited else None, rng)
        elif kind == _JOINT.mjJNT_FREE:
            positions[:, at + 3 : at + 7] = _quaternions(None, rng)
        elif limited:
            positions[:, at] = rng.uniform(low, high, size=POSES)
        elif kind == _JOINT.mjJNT_HINGE:
            positions[:, at] = rng.uniform(-math.pi, math.pi, size=POSES)
    return positions


def _quaternions(largest: float | None, rng: np.random.Generator) -> Array:
    """Unit quaternions, (POSES, 4): of any turn, or of turns by up to the largest angle [rad] about any axis."""
    drawn = rng.normal(size=(POSES, 4))
    if largest is None:
        return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)  # type: ignore[no-any-return]
    half = rng.uniform(0.0, largest / 2, size=(POSES, 1))
    axis = drawn[:, 1:] / np.linalg.norm(drawn[:, 1:], axis=1, keepdims=True)
    return np.hstack([np.cos(half), np.sin(half) * axis])


def clearance(model: mujoco.MjModel, body: int, surface: Surface, terrain: "FreeSurface | Terrain") -> float:
    """A height over the sand that a body cannot come below, by its tree and its joints' ranges [m]; or -inf.

    Of a terrain counts the highest point, wherever it lies.

    Along the way from the world, a slide lowers what hangs on it by its range, and a hinge that is not upright, or a
    ball, may turn it about its anchor any way: less than what the joints allow is never assumed.
    """
    chain = [body]
    while chain[-1] != 0:
        chain.append(int(model.body_parentid[chain[-1]]))
    plane = terrain.ceiling
    height = -float(plane.depth(np.zeros(3)))
    tilt: Array | None = np.array(plane.normal)
    """Up in the frame so far; None where a joint may have turned it any way."""

    def along(vector: Array) -> float:
        return float(tilt @ vector) if tilt is not None else -float(np.linalg.norm(vector))

    for part in reversed(chain[:-1]):
        height += along(model.body_pos[part])
        if tilt is not None:
            tilt = _turned_back(model.body_quat[part], tilt)
        for joint in range(model.body_jntadr[part], model.body_jntadr[part] + model.body_jntnum[part]):
            kind, axis = _JOINT(model.jnt_type[joint]), model.jnt_axis[joint]
            if kind == _JOINT.mjJNT_FREE:
                return -math.inf
            if kind == _JOINT.mjJNT_SLIDE:
                height += _lowered(model, joint, None if tilt is None else float(tilt @ axis))
            elif tilt is None or kind == _JOINT.mjJNT_BALL or abs(tilt @ axis) < 1.0 - 1e-9:
                anchor = model.jnt_pos[joint]
                height += along(anchor) - float(np.linalg.norm(anchor))
                tilt = None
    if tilt is None:
        return height - float(np.linalg.norm(surface.corners, axis=1).max())
    return height + float((surface.corners @ tilt).min())


def _lowered(model: mujoco.MjModel, joint: int, slope: float | None) -> float:
    """The most that a slide lowers what hangs on it [m], not positive; slope: rise per travel, None for any."""
    if slope is not None and abs(slope) < 1e-9:
        return 0.0
    if not model.jnt_limited[joint]:
        return -math.inf
    low, high = model.jnt_range[joint] - model.qpos0[model.jnt_qposadr[joint]]
    give = GIVE * (high - low)
    if slope is None:
        return -float(max(abs(low), abs(high)) + give)
    return float(min(slope * (low - give), slope * (high + give)))


def _turned_back(quat: Array, vector: Array) -> Array:
    out, inverse = np.empty(3), np.empty(4)
    mujoco.mju_negQuat(inverse, quat)
    mujoco.mju_rotVecQuat(out, vector, inverse)
    return out
