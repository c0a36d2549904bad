"""A hopper that moves in the x-z plane on one leg with a flat foot.

Root joints: slides `root_x` and `root_z` and the hinge `root_pitch` about y, positive nose down; the torso's origin is
its hip, so `root_z` is the hip's height. The leg's hinges turn about y, too: positive rates swing what hangs on them
backward. The knee bends forward.
"""

import dataclasses
from typing import Final

import mujoco
import numpy as np

from rftsim_models import parts
from rftsim_models.outline import box

JOINTS: Final = ("hip", "knee", "ankle")
"""Hinges and servos of the leg, in the order of qpos[3:], qvel[3:] and ctrl."""
SEGMENTS: Final = ("thigh", "shank", "foot")
"""Bodies of the leg, each moved by its joint."""
RANGES: Final = ((-1.8, 0.8), (0.05, 2.5), (-1.3, 0.8))
"""Lowest and highest angle of each joint [rad]."""


@dataclasses.dataclass(frozen=True)
class HopperParameters:
    """A planar hopper; the defaults are 9 kg on a leg of 0.49 m.

    Attributes:
        torso_height: Height of the torso's top above the hip [m].
        thigh: Length from hip to knee [m].
        shank: Length from knee to ankle [m].
        foot_length: Length of the foot, along x [m].
        foot_width: Width of the foot, along y [m].
        foot_height: Thickness of the foot's plate [m].
        foot_ahead: How far the foot's middle is ahead of the ankle [m].
        ankle_height: Height of the ankle above the sole [m].
        torso_mass: Mass of the torso [kg].
        thigh_mass: Mass of the thigh [kg].
        shank_mass: Mass of the shank [kg].
        foot_mass: Mass of the foot [kg].
        crouch: Angle of thigh and shank to the vertical in the keyframe [rad].
        torques: Largest torque of hip, knee and ankle [N m].
        stiffness: Position gain of the servos [N m/rad].
        damping: Rate gain of the servos [N m s/rad].
        armature: Inertia of a motor behind its gear [kg m^2].
    """

    torso_height: float = 0.26
    thigh: float = 0.22
    shank: float = 0.22
    foot_length: float = 0.16
    foot_width: float = 0.10
    foot_height: float = 0.02
    foot_ahead: float = 0.02
    ankle_height: float = 0.05
    torso_mass: float = 5.6
    thigh_mass: float = 1.7
    shank_mass: float = 1.1
    foot_mass: float = 0.6
    crouch: float = 0.55
    torques: tuple[float, float, float] = (60.0, 60.0, 40.0)
    stiffness: float = 300.0
    damping: float = 6.0
    armature: float = 0.03

    def __post_init__(self) -> None:
        free = ("foot_ahead", "crouch", "torques")
        parts.check_positive(self, [field.name for field in dataclasses.fields(self) if field.name not in free])
        if not min(self.torques) > 0.0:
            raise ValueError(f"torques must be positive, not {self.torques}")
        if not RANGES[1][0] <= 2 * self.crouch <= RANGES[1][1]:
            low, high = np.array(RANGES[1]) / 2
            raise ValueError(f"crouch must be between {low} and {high}, where the knee's range ends, not {self.crouch}")
        if not self.foot_height < self.ankle_height:
            raise ValueError(f"ankle_height = {self.ankle_height} must exceed foot_height = {self.foot_height}")


HOPPER: Final = HopperParameters()


def build_hopper(parameters: HopperParameters = HOPPER) -> mujoco.MjSpec:
    """A hopper above level ground at z = 0; its keyframe `start` crouches on a flat foot.

    Bodies: `torso`, `thigh`, `shank`, `foot`; torso and foot touch the ground. Sensors: `gyro`, `velocimeter`,
    `accelerometer`, `orientation`.
    """
    p = parameters
    spec = parts.new_robot("hopper")
    torso = spec.worldbody.add_body(name=parts.TORSO)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    torso.add_joint(name="root_x", type=slide, axis=[1, 0, 0])
    torso.add_joint(name="root_z", type=slide, axis=[0, 0, 1])
    torso.add_joint(name="root_pitch", type=hinge, axis=[0, 1, 0])
    _add_torso(spec, torso, p)
    thigh = _add_segment(spec, torso, 0, 0.0, p)
    parts.add_rod(thigh, [0, 0, 0], [0, 0, -p.thigh], 0.026, p.thigh_mass)
    shank = _add_segment(spec, thigh, 1, -p.thigh, p)
    parts.add_rod(shank, [0, 0, 0], [0, 0, -p.shank], 0.020, p.shank_mass)
    foot = _add_segment(spec, shank, 2, -p.shank, p)
    plate = box(p.foot_length, p.foot_width, p.foot_height, along=6, across=3)
    middle = [p.foot_ahead, 0, p.foot_height / 2 - p.ankle_height]
    parts.add_felt(spec, foot, plate, p.foot_mass, pos=middle)
    parts.add_rod(foot, [0, 0, 0], [0, 0, p.foot_height - p.ankle_height], 0.018)
    parts.add_senses(spec, torso)
    parts.add_camera(torso, 1.8 * (p.torso_height + p.thigh + p.shank))
    pose = [-p.crouch, 2 * p.crouch, -p.crouch]
    parts.add_start(spec, [0, 0, 0, *pose], pose)
    return spec


def _add_torso(spec: mujoco.MjSpec, torso: mujoco.MjsBody, p: HopperParameters) -> None:
    solid = box(0.16, 0.14, p.torso_height - 0.04, along=2, across=2)
    parts.add_felt(spec, torso, solid, p.torso_mass, pos=[0, 0, p.torso_height / 2 + 0.02], rgba=parts.BODY_RGBA)
    parts.add_rod(torso, [0, -0.06, 0], [0, 0.06, 0], 0.03)


def _add_segment(
    spec: mujoco.MjSpec, above: mujoco.MjsBody, number: int, height: float, p: HopperParameters
) -> mujoco.MjsBody:
    """A body of the leg on its hinge, with a position servo."""
    joint, limit = JOINTS[number], RANGES[number]
    body = above.add_body(name=SEGMENTS[number], pos=[0, 0, height])
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=joint, type=hinge, axis=[0, 1, 0], range=limit, armature=p.armature, damping=0.2)
    parts.add_servo(spec, joint, p.torques[number], limit, kp=p.stiffness, kv=p.damping)
    return body
