"""`rftsim/Quadruped-v0`: a quadruped walks at a commanded velocity."""

import dataclasses
from typing import Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.quadruped import FEET, JOINTS, QUADRUPED, build_quadruped

from rftsim_envs.physics import Array
from rftsim_envs.walking import Walking, WalkingConfig

REACH: Final = np.tile([0.15, 0.35, 0.35], 4)
"""Changes of abduction, hip and knee from the standing pose for an action of 1 [rad]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class QuadrupedConfig(WalkingConfig):
    """Settings of the quadruped: those of walking, on looser sand."""

    sand: str = "close-poppy-seeds"


class Quadruped(Walking):
    """A quadruped (11 kg, twelve joints, rounded feet) that follows a velocity in its own heading.

    Action, 12 numbers: targets of the joints' position servos less the standing pose, in the order of
    `rftsim_models.quadruped.JOINTS`: -1 to 1 for 0.15 rad of abduction and 0.35 rad of hips and knees either way.

    | observation | size | unit |
    |---|---|---|
    | commanded velocity ahead and to the left | 2 | m/s |
    | commanded yaw rate | 1 | rad/s |
    | gravity, in the torso's axes | 3 | g |
    | linear velocity, in the torso's axes | 3 | m/s |
    | angular velocity, in the torso's axes | 3 | rad/s |
    | angles of the joints less the standing pose | 12 | rad |
    | rates of the joints | 12 | 10 rad/s |
    | last action | 12 | - |

    Reward per second: velocity exp(-|v - commanded v|^2 / spread^2)
    + yaw exp(-(w - commanded w)^2 / turning_spread^2) + survival - energy P / (m g 1 m/s) - haste |a - last a|^2
    - tilt (g_x^2 + g_y^2) - crouch max(0, 1 - z / z_pose)^2, v the velocity over the ground in the heading's axes and w
    the yaw rate, both means over the control step as is the servos' positive power P, z the height of the torso above
    the ground, and g the direction of gravity in the torso's axes.
    The episode ends in failure where the torso leans 60 deg from the vertical, or its middle is less than 0.1 m above
    the ground.

    `info`: `speed`, ahead, `sideways` [m/s], `turning` [rad/s], `error`, of the velocity over the ground [m/s],
    `height` of the torso's middle [m], `tilt` from the vertical [rad], and what all tasks tell.
    """

    Settings = QuadrupedConfig
    felt = (parts.TORSO, *FEET)
    length = QUADRUPED.length
    edge = parts.AS_MESHED
    joints = driven = JOINTS
    grounded = QUADRUPED.height
    config: QuadrupedConfig

    def build(self) -> mujoco.MjSpec:
        """The quadruped, whose first keyframe stands on four bent legs."""
        return build_quadruped()

    def reach(self, model: mujoco.MjModel) -> tuple[Array, Array]:
        """Targets of the joints in the standing pose, and their change for an action of 1 [rad], (12,) each."""
        return model.key_ctrl[0].copy(), REACH
