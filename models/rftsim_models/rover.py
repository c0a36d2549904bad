"""A rover of Sojourner's size: six grousered wheels on rockers and bogies, steered by its wheels' rates.

On each side a rocker turns about a hinge at the torso and carries the rear wheel and, at its front end, a bogie with
the middle and the front wheel. A differential makes the rockers turn against each other, so that the torso's pitch is
their mean. All hinges lie along y; positive wheel rates roll forward (+x), positive rockers and bogies are nose down.
"""

import dataclasses
from typing import Final

import mujoco
import numpy as np

from rftsim_models import parts
from rftsim_models.outline import box
from rftsim_models.wheels import WheelParameters, add_wheel_meshes

WHEELS: Final = tuple(f"wheel_{side}_{place}" for side in ("left", "right") for place in ("front", "middle", "rear"))
"""Bodies, hinges and servos of the wheels, in the order of ctrl."""
ROCKER_LIMIT: Final = 0.5
BOGIE_LIMIT: Final = 0.6
"""Largest angles of their hinges, both ways [rad]."""

ROVER_WHEEL: Final = WheelParameters(
    radius=0.062,
    width=0.06,
    lugs=12,
    lug_height=0.006,
    lug_width=0.004,
    felt_height=1 / 3,
    vertical_mass=0.35,
    horizontal_mass=0.35,
    gravity=9.81,
    arc=4,
    flank=1,
    top=1,
    rings=1,
)
"""About Sojourner's wheels, of 65 mm radius and 60 mm width, with fewer cleats. Coarser rims cost more than they save:
the sand then takes more iterations a step."""


@dataclasses.dataclass(frozen=True)
class RoverParameters:
    """A rover; the defaults are about Sojourner's size, 11 kg on wheels of 0.136 m diameter.

    Attributes:
        wheel: Shape and, as vertical_mass, mass of each wheel.
        spacing: Distance between neighbouring wheels of a side along x [m].
        track: Distance between the wheels of left and right [m].
        pivot_height: Height of the rockers' hinges above the wheels' [m].
        bogie_height: Height of the bogies' hinges above the wheels' [m].
        length: Length of the torso [m].
        width: Width of the torso [m].
        height: Height of the torso [m].
        torso_mass: Mass of the torso [kg].
        rocker_mass: Mass of a rocker [kg].
        bogie_mass: Mass of a bogie [kg].
        torque: Largest torque of a wheel [N m].
        rate: Largest rate of a wheel [rad/s].
        gain: Gain of the rate servos [N m s/rad].
        armature: Inertia of a motor behind its gear [kg m^2].
    """

    wheel: WheelParameters = ROVER_WHEEL
    spacing: float = 0.23
    track: float = 0.42
    pivot_height: float = 0.10
    bogie_height: float = 0.045
    length: float = 0.42
    width: float = 0.28
    height: float = 0.12
    torso_mass: float = 7.5
    rocker_mass: float = 0.5
    bogie_mass: float = 0.3
    torque: float = 4.0
    rate: float = 6.0
    gain: float = 3.0
    armature: float = 0.01

    def __post_init__(self) -> None:
        parts.check_positive(self, [field.name for field in dataclasses.fields(self) if field.name != "wheel"])
        if not 2 * self.wheel.outer_radius < self.spacing:
            raise ValueError(
                f"wheels of {self.wheel.outer_radius} m outer radius overlap at a spacing of {self.spacing} m"
            )
        if not self.width + self.wheel.width < self.track:
            raise ValueError(f"a torso {self.width} m wide does not fit between wheels on a track of {self.track} m")


ROVER: Final = RoverParameters()


def build_rover(parameters: RoverParameters = ROVER) -> mujoco.MjSpec:
    """A rover above level ground at z = 0; its keyframe `start` rests on the felt lugs of its wheels.

    Bodies: `torso`, `rocker_left`, `bogie_left` and their like on the right, and `WHEELS`; torso and wheels touch the
    ground. Rockers and bogies have a hinge of their own name. The torso's origin is amid the rockers' hinges. Sensors:
    `gyro`, `velocimeter`, `accelerometer`, `orientation`.
    """
    p = parameters
    spec = parts.new_robot("rover")
    for mesh in add_wheel_meshes(spec, p.wheel, prefix="wheel_"):
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
    torso = spec.worldbody.add_body(name=parts.TORSO, pos=[0, 0, p.pivot_height + p.wheel.outer_radius])
    torso.add_freejoint(name="root")
    solid = box(p.length, p.width, p.height, along=5, across=3)
    above = [0, 0, p.height / 2 - 0.03]
    parts.add_felt(spec, torso, solid, p.torso_mass, pos=above, rgba=parts.LIMB_RGBA)
    panel = [p.length * 0.55, p.width * 0.62, 0.006]
    parts.add_seen(torso, mujoco.mjtGeom.mjGEOM_BOX, panel, [0, 0, p.height - 0.024], parts.BODY_RGBA)
    for side in ("left", "right"):
        _add_side(spec, torso, side, p)
    differential = spec.add_equality(
        name="differential",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1="rocker_left",
        name2="rocker_right",
    )
    differential.data[:2] = 0, -1
    parts.add_senses(spec, torso)
    parts.add_camera(torso, 3.0 * p.length)
    parts.add_start(spec, [0, 0, 0, 1, 0, 0, 0] + [0] * 10, [0] * 6)
    return spec


def _add_side(spec: mujoco.MjSpec, torso: mujoco.MjsBody, side: str, p: RoverParameters) -> None:
    """A rocker with its bogie and wheels; the rocker's hinge lies where all wheels bear alike."""
    out = (1 if side == "left" else -1) * p.track / 2
    inner = out * (1 - (p.wheel.width / 2 + 0.02) / (p.track / 2))
    rear, bogie_at = [-p.spacing, 0, -p.pivot_height], [p.spacing / 2, 0, p.bogie_height - p.pivot_height]
    rocker = _add_hinged(torso, f"rocker_{side}", [0, inner, 0], ROCKER_LIMIT)
    for end in (rear, bogie_at):
        parts.add_rod(rocker, [0, 0, 0], end, 0.009, p.rocker_mass / 2)
    bogie = _add_hinged(rocker, f"bogie_{side}", bogie_at, BOGIE_LIMIT)
    front, middle = ([x * p.spacing / 2, 0, -p.bogie_height] for x in (1, -1))
    for end in (front, middle):
        parts.add_rod(bogie, [0, 0, 0], end, 0.008, p.bogie_mass / 2)
    for above, place, at in ((bogie, "front", front), (bogie, "middle", middle), (rocker, "rear", rear)):
        _add_wheel(spec, above, f"wheel_{side}_{place}", at, out - inner, p)


def _add_hinged(above: mujoco.MjsBody, name: str, pos: list[float], limit: float) -> mujoco.MjsBody:
    """A body on a passive hinge."""
    body = above.add_body(name=name, pos=pos)
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=name, type=hinge, axis=[0, 1, 0], range=[-limit, limit], damping=0.1, armature=0.002)
    return body


def _add_wheel(
    spec: mujoco.MjSpec, above: mujoco.MjsBody, name: str, at: list[float], out: float, p: RoverParameters
) -> None:
    """A wheel beside the end of its arm, with a rate servo."""
    wheel = above.add_body(name=name, pos=[at[0], out, at[2]])
    wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=p.armature)
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    wheel.add_geom(
        name=name,
        type=mesh,
        meshname="wheel_felt",
        mass=p.wheel.vertical_mass,
        group=parts.SAND_GROUP,
        contype=1,
        conaffinity=0,
    )
    wheel.add_geom(
        type=mesh,
        meshname="wheel_looks",
        mass=0,
        contype=0,
        conaffinity=0,
        group=parts.SEEN_GROUP,
        rgba=parts.LIMB_RGBA,
    )
    hub = 0.6 * p.wheel.width * np.sign(out)
    parts.add_rod(wheel, [0, -out, 0], [0, hub, 0], 0.012, rgba=parts.FOOT_RGBA)
    parts.add_servo(spec, name, p.torque, [-p.rate, p.rate], kv=p.gain)
