"""A hexapod on C-shaped legs, of the RHex family and about the size of SandBot.

SandBot: C. Li et al., Sensitive dependence of the motion of a legged robot on granular media, PNAS 2009.

Each leg is a half cylinder's shell that turns without limit about a hinge at its upper end, under a rate servo;
positive rates roll it forward (+x). The order of legs, joints and servos is `LEGS`. The sand presses on both sides of
the shell; MuJoCo's contact with a rigid floor takes its convex hull, the filled half disc.
"""

import dataclasses
from typing import Final

import mujoco
import numpy as np

from rftsim_models import parts
from rftsim_models.outline import Array, Faces, box, lofted

LEGS: Final = tuple(f"leg_{side}_{place}" for side in ("left", "right") for place in ("front", "middle", "rear"))
"""Bodies, hinges and servos of the legs, in the order of qpos[7:], qvel[6:] and ctrl."""
TRIPODS: Final = ((0, 2, 4), (1, 3, 5))
"""The legs, by their place in `LEGS`, that step together in the alternating tripod gait."""


@dataclasses.dataclass(frozen=True)
class HexapodParameters:
    """A hexapod; the defaults are about SandBot's, 2.3 kg and 0.30 m long.

    Attributes:
        length: Length of the torso [m].
        width: Width of the torso [m].
        height: Height of the torso [m].
        hip_spacing: Distance between neighbouring hips along x [m].
        stagger: How much further out the middle legs are than the others [m].
        leg_radius: Outer radius of a leg's half circle [m].
        leg_width: Width of a leg along its hinge [m].
        leg_thickness: Thickness of a leg's shell [m].
        mass: Mass of the whole robot [kg].
        leg_mass: Mass of one leg [kg].
        torque: Largest torque of a hip [N m].
        rate: Largest rate of a hip [rad/s].
        gain: Gain of the rate servos [N m s/rad].
        armature: Inertia of a motor behind its gear [kg m^2].
        friction: Torque of dry friction in a gear, which holds the robot at rest [N m].
        segments: Number of straight segments in a leg's half circle.
    """

    length: float = 0.30
    width: float = 0.11
    height: float = 0.05
    hip_spacing: float = 0.115
    stagger: float = 0.018
    leg_radius: float = 0.036
    leg_width: float = 0.012
    leg_thickness: float = 0.003
    mass: float = 2.3
    leg_mass: float = 0.02
    torque: float = 1.5
    rate: float = 30.0
    gain: float = 1.0
    armature: float = 0.012
    friction: float = 0.05
    segments: int = 7

    def __post_init__(self) -> None:
        parts.check_positive(self, [field.name for field in dataclasses.fields(self) if field.name != "stagger"])
        if not self.leg_thickness < self.leg_radius:
            raise ValueError(f"leg_thickness = {self.leg_thickness} must be less than leg_radius = {self.leg_radius}")
        if not 6 * self.leg_mass < self.mass:
            raise ValueError(f"six legs of {self.leg_mass} kg leave nothing of a mass of {self.mass} kg")
        if not 2 * self.hip_spacing <= self.length:
            raise ValueError(f"hips {self.hip_spacing} m apart do not fit on a torso {self.length} m long")

    @property
    def hip_height(self) -> float:
        """Height of the hips above the toes when the legs' diameters point down [m]."""
        return 2 * self.leg_radius - self.leg_thickness / 2

    def leg(self) -> tuple[Array, Faces]:
        """A leg, from the hinge at the origin round behind it to the toe below: vertices and faces."""
        angle = np.linspace(0.0, np.pi, self.segments + 1)
        outward = np.column_stack([-np.sin(angle), np.zeros_like(angle), np.cos(angle)])
        inner, outer = self.leg_radius - self.leg_thickness, self.leg_radius
        centre = np.array([0.0, 0.0, -(inner + outer) / 2])
        ring = [(inner, -1), (inner, 1), (outer, 1), (outer, -1)]
        side = np.array([0.0, self.leg_width / 2, 0.0])
        return lofted(np.stack([centre + r * outward + s * side for r, s in ring], axis=1))


HEXAPOD: Final = HexapodParameters()


def build_hexapod(parameters: HexapodParameters = HEXAPOD) -> mujoco.MjSpec:
    """A hexapod above level ground at z = 0; its keyframe `start` stands on six legs with their diameters down.

    Bodies: `torso` and `LEGS`. The torso's origin is amid the hips. Sensors: `gyro`, `velocimeter`, `accelerometer`,
    `orientation`.
    """
    p = parameters
    spec = parts.new_robot("hexapod")
    torso = spec.worldbody.add_body(name=parts.TORSO, pos=[0, 0, p.hip_height])
    torso.add_freejoint(name="root")
    solid = box(p.length, p.width, p.height, along=4, across=2)
    parts.add_felt(spec, torso, solid, p.mass - 6 * p.leg_mass, rgba=parts.BODY_RGBA)
    for name in LEGS:
        _add_leg(spec, torso, name, p)
    deck = [p.length * 0.42, p.width * 0.36, 0.004]
    parts.add_seen(torso, mujoco.mjtGeom.mjGEOM_BOX, deck, [0, 0, p.height / 2 + 0.004], parts.LIMB_RGBA)
    parts.add_senses(spec, torso)
    parts.add_camera(torso, 2.0 * p.length)
    parts.add_start(spec, [0, 0, 0, 1, 0, 0, 0] + [0] * 6, [0] * 6)
    return spec


def _add_leg(spec: mujoco.MjSpec, torso: mujoco.MjsBody, name: str, p: HexapodParameters) -> None:
    _, side, place = name.split("_")
    left = 1 if side == "left" else -1
    ahead = {"front": 1, "middle": 0, "rear": -1}[place]
    out = p.width / 2 + p.leg_width + (p.stagger if ahead == 0 else 0.0)
    leg = torso.add_body(name=name, pos=[ahead * p.hip_spacing, left * out, 0])
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    leg.add_joint(name=name, type=hinge, axis=[0, 1, 0], armature=p.armature, frictionloss=p.friction)
    parts.add_felt(spec, leg, p.leg(), p.leg_mass)
    inward = left * (p.width / 2 - out)
    parts.add_rod(leg, [0, inward, 0], [0, left * p.leg_width / 2, 0], 0.006)
    parts.add_servo(spec, name, p.torque, [-p.rate, p.rate], kv=p.gain)
