"""A quadruped with twelve joints and rounded feet, about the size of a small research robot.

Each leg hangs on an abduction hinge along x, positive outward on both sides, then hip and knee about y: positive rates
swing what hangs on them backward, so the knees (always negative) point backward. `JOINTS` gives the order of joints
and servos.
"""

import dataclasses
from typing import Final

import mujoco
import numpy as np

from rftsim_models import parts
from rftsim_models.outline import box, pad

LEGS: Final = tuple(f"{side}_{place}" for side in ("left", "right") for place in ("front", "rear"))
"""Ends of the names of what belongs to a leg, in the order of its joints."""
JOINTS: Final = tuple(f"{joint}_{leg}" for leg in LEGS for joint in ("abduction", "hip", "knee"))
"""Hinges and servos, in the order of qpos[7:], qvel[6:] and ctrl."""
FEET: Final = tuple(f"foot_{leg}" for leg in LEGS)
"""Bodies that touch the ground, beside the torso; they are fixed to the shanks."""
DIAGONALS: Final = ((0, 3), (1, 2))
"""The legs, by their place in `LEGS`, that step together in a trot."""
RANGES: Final = ((-0.6, 0.9), (-0.9, 2.2), (-2.6, -0.3))
"""Lowest and highest angle of abduction, hip and knee [rad]."""


@dataclasses.dataclass(frozen=True)
class QuadrupedParameters:
    """A quadruped; the defaults are 11 kg and 0.42 m long.

    Attributes:
        length: Length of the torso [m].
        width: Width of the torso [m].
        height: Height of the torso [m].
        hip_spacing: Distance between front and rear hips [m].
        hip_width: Distance between the abduction hinges of left and right [m].
        hip_offset: Distance from the abduction hinge out to the leg's plane [m].
        thigh: Length from hip to knee [m].
        shank: Length from knee to the middle of the foot [m].
        foot_radius: Radius of a foot's pad, which is level in the keyframe [m].
        foot_height: Height of a foot's pad [m].
        torso_mass: Mass of the torso [kg].
        hip_mass: Mass of the motors that turn with one abduction hinge [kg].
        thigh_mass: Mass of a thigh [kg].
        shank_mass: Mass of a shank [kg].
        foot_mass: Mass of a foot [kg].
        crouch: Angle of thigh and shank to the vertical in the keyframe [rad].
        torque: Largest torque of a joint [N m].
        stiffness: Position gain of the servos [N m/rad].
        damping: Rate gain of the servos [N m s/rad].
        armature: Inertia of a motor behind its gear [kg m^2].
    """

    length: float = 0.42
    width: float = 0.14
    height: float = 0.10
    hip_spacing: float = 0.38
    hip_width: float = 0.10
    hip_offset: float = 0.08
    thigh: float = 0.20
    shank: float = 0.20
    foot_radius: float = 0.045
    foot_height: float = 0.04
    torso_mass: float = 5.6
    hip_mass: float = 0.5
    thigh_mass: float = 0.65
    shank_mass: float = 0.15
    foot_mass: float = 0.06
    crouch: float = 0.75
    torque: float = 33.0
    stiffness: float = 150.0
    damping: float = 4.0
    armature: float = 0.01

    def __post_init__(self) -> None:
        parts.check_positive(self, [field.name for field in dataclasses.fields(self)])
        if not self.hip_spacing <= self.length:
            raise ValueError(f"hip_spacing = {self.hip_spacing} must be at most the torso's length = {self.length}")
        low, high = -np.array(RANGES[2])[::-1] / 2
        if not low <= self.crouch <= high:
            raise ValueError(f"crouch must be between {low} and {high}, where the knee's range ends, not {self.crouch}")


QUADRUPED: Final = QuadrupedParameters()


def build_quadruped(parameters: QuadrupedParameters = QUADRUPED) -> mujoco.MjSpec:
    """A quadruped above level ground at z = 0; its keyframe `start` stands on four bent legs.

    Bodies: `torso` and, for each of `LEGS`, `hip_`, `thigh_`, `shank_` and `foot_`; torso and feet touch the ground.
    Sensors: `gyro`, `velocimeter`, `accelerometer`, `orientation`.
    """
    p = parameters
    spec = parts.new_robot("quadruped")
    torso = spec.worldbody.add_body(name=parts.TORSO, pos=[0, 0, p.thigh + p.shank + p.foot_height / 2])
    torso.add_freejoint(name="root")
    solid = box(p.length, p.width, p.height, along=6, across=2)
    parts.add_felt(spec, torso, solid, p.torso_mass, rgba=parts.BODY_RGBA)
    nose = [0.02, p.width * 0.4, p.height * 0.3]
    parts.add_seen(torso, mujoco.mjtGeom.mjGEOM_BOX, nose, [p.length / 2 + 0.02, 0, 0.01], parts.FOOT_RGBA)
    for leg in LEGS:
        _add_leg(spec, torso, leg, p)
    parts.add_senses(spec, torso)
    parts.add_camera(torso, 3.2 * p.length)
    pose = 4 * [0, p.crouch, -2 * p.crouch]
    parts.add_start(spec, [0, 0, 0, 1, 0, 0, 0, *pose], pose)
    return spec


def _add_leg(spec: mujoco.MjSpec, torso: mujoco.MjsBody, leg: str, p: QuadrupedParameters) -> None:
    side = 1 if leg.startswith("left") else -1
    ahead = 1 if leg.endswith("front") else -1
    out = side * p.hip_offset
    place = [ahead * p.hip_spacing / 2, side * p.hip_width / 2, 0]
    hip = _add_moved(spec, torso, "hip_" + leg, "abduction_" + leg, place, [side, 0, 0], p)
    parts.add_rod(hip, [0, 0, 0], [0, 0.75 * out, 0], 0.036, p.hip_mass, parts.FOOT_RGBA)
    thigh = _add_moved(spec, hip, "thigh_" + leg, "hip_" + leg, [0, out, 0], [0, 1, 0], p)
    parts.add_rod(thigh, [0, 0, 0], [0, 0, -p.thigh], 0.022, p.thigh_mass)
    shank = _add_moved(spec, thigh, "shank_" + leg, "knee_" + leg, [0, 0, -p.thigh], [0, 1, 0], p)
    parts.add_rod(shank, [0, 0, 0], [0, 0, -p.shank], 0.013, p.shank_mass)
    level = [np.cos(p.crouch / 2), 0, np.sin(p.crouch / 2), 0]
    foot = shank.add_body(name="foot_" + leg, pos=[0, 0, -p.shank], quat=level)
    parts.add_felt(spec, foot, pad(p.foot_radius, p.foot_height, sections=10, rings=6), p.foot_mass)


def _add_moved(
    spec: mujoco.MjSpec,
    above: mujoco.MjsBody,
    name: str,
    joint: str,
    pos: list[float],
    axis: list[float],
    p: QuadrupedParameters,
) -> mujoco.MjsBody:
    """A body on a hinge with a position servo."""
    limit = RANGES[("abduction", "hip", "knee").index(joint.partition("_")[0])]
    body = above.add_body(name=name, pos=pos)
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=joint, type=hinge, axis=axis, range=limit, armature=p.armature, damping=0.1)
    parts.add_servo(spec, joint, p.torque, limit, kp=p.stiffness, kv=p.damping)
    return body
