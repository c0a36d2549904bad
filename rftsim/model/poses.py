"""Poses in which a model starts: a keyframe, or its initial positions with joints in range, servos that hold."""

import mujoco
import numpy as np

from rftsim.errors import SceneError

_JOINT = mujoco.mjtJoint


def posed(model: mujoco.MjModel, keyframe: "int | str | None" = None) -> mujoco.MjData:
    """Make data of a model in a keyframe, with its controls; forces and sensors are not computed yet.

    Servos of position hold the pose where the keyframe has no controls. Without keyframes the pose is the model's
    initial one, joints that are out of their range at its nearest end.

    Args:
        model: Compiled.
        keyframe: Its name or number; by default the first.

    Raises:
        SceneError: The model has no such keyframe.
    """
    data = mujoco.MjData(model)
    number = _number(model, keyframe)
    if number is None:
        _bring_into_range(model, data)
    else:
        mujoco.mj_resetDataKeyframe(model, data, number)
    if not data.ctrl.any():
        _hold(model, data)
    return data


def _number(model: mujoco.MjModel, keyframe: "int | str | None") -> int | None:
    """The number of a keyframe, or None where the model has none and none was asked for."""
    names = [model.key(i).name for i in range(model.nkey)]
    if keyframe is None:
        return 0 if names else None
    if keyframe in names:
        return names.index(str(keyframe))
    try:
        number = int(keyframe)
    except ValueError:
        number = -1
    if not 0 <= number < model.nkey:
        known = ", ".join(name or str(i) for i, name in enumerate(names)) or "none"
        raise SceneError(f"no keyframe {keyframe!r}; the model has {known}")
    return number


def _bring_into_range(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Move hinges and slides that are out of their range to its nearest end."""
    scalar = np.isin(model.jnt_type, [int(_JOINT.mjJNT_HINGE), int(_JOINT.mjJNT_SLIDE)])
    joints = np.flatnonzero(scalar & (model.jnt_limited != 0))
    places = model.jnt_qposadr[joints]
    data.qpos[places] = np.clip(data.qpos[places], *model.jnt_range[joints].T)


def _hold(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set the controls of servos of position, and their filters, so that they exert nothing in the pose of the data."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    mujoco.mj_transmission(model, data)
    gain, bias = model.actuator_gainprm[:, 0], model.actuator_biasprm
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    servos = affine & (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED) & (gain != 0.0) & (bias[:, 1] != 0.0)
    wanted = -(bias[servos, 0] + bias[servos, 1] * data.actuator_length[servos]) / gain[servos]
    limited = model.actuator_ctrllimited[servos] != 0
    low, high = model.actuator_ctrlrange[servos].T
    data.ctrl[servos] = np.where(limited, np.clip(wanted, low, high), wanted)
    filters = [int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)]
    filtered = servos & np.isin(model.actuator_dyntype, filters)
    data.act[model.actuator_actadr[filtered]] = data.ctrl[filtered]
