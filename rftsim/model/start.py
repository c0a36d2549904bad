"""The start of a model before it has sand: its pose, and which of its trees something has to carry."""

import mujoco
import numpy as np

from rftsim.model.poses import posed

_JOINT = mujoco.mjtJoint


def start(model: mujoco.MjModel) -> mujoco.MjData:
    """Data in the pose in which a compiled model starts, see `posed`, with its kinematics and centres of mass."""
    data = posed(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def standing_trees(model: mujoco.MjModel) -> list[int]:
    """Roots of the trees that something has to carry: those whose own joints let them fall, the heaviest first."""
    found = []
    for body in range(1, model.nbody):
        if model.body_parentid[body] != 0 and model.body_weldid[model.body_parentid[body]] != 0:
            continue
        if _can_fall(model, body):
            found.append(body)
    return sorted(found, key=lambda body: -float(model.body_subtreemass[body]))


def _can_fall(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body's own joints let it move along gravity."""
    down = model.opt.gravity / max(float(np.linalg.norm(model.opt.gravity)), 1e-300)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.body_quat[body])
    for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
        kind = _JOINT(model.jnt_type[joint])
        if kind == _JOINT.mjJNT_FREE:
            return True
        along = abs(float(rotation.reshape(3, 3) @ model.jnt_axis[joint] @ down))
        if kind == _JOINT.mjJNT_SLIDE and along > 0.5:
            return True
    return False
