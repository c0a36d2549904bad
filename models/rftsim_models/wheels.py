"""Wheels on a carriage: the grousered wheel and the four-flap runner of [Agarwal] chapter 4.

Both move in the x-z plane: a carriage slides along x, an axle slides along z in it, and the wheel turns about the axle
(axis y, so that positive spin rolls it towards +x), by default at a rate that a stiff servo imposes.
"""

import dataclasses
import math
from typing import Final, Literal, get_args

import mujoco
import numpy as np

from rftsim_models import parts
from rftsim_models.outline import Array, extruded, lugged_outline
from rftsim_models.studio import new_scene

WHEEL: Final = "wheel"
CARRIAGE: Final = "carriage"
SERVO: Final = 1e4
"""Gain of the rate servo [N m s], stiff enough to impose the rate to a few parts in 1e4."""
Drive = Literal["rate", "torque"]
DRIVES: Final = get_args(Drive)


@dataclasses.dataclass(frozen=True)
class WheelParameters:
    """A lugged wheel on a carriage.

    Attributes:
        radius: Radius of the disc without lugs [m].
        width: Width along the axle [m].
        lugs: Number of lugs.
        lug_height: Radial height of a lug [m].
        lug_width: Width of a lug along the rim [m].
        felt_height: Lug height that the sand feels, as a share of the true one; one third accounts for the shadow that
            a grouser lies in, [Agarwal] section 4.6.2.
        vertical_mass: Mass that moves vertically, the wheel's [kg].
        horizontal_mass: Mass that moves horizontally, wheel and carriage [kg].
        forward_force: Constant force on the carriage along x [N].
        gravity: Acceleration along -z [m/s^2].
        arc: Segments of the rim between two lugs.
        flank: Segments of a lug's side.
        top: Segments of a lug's outer end.
        rings: Rings of triangles in each side face.
    """

    radius: float
    width: float
    lugs: int
    lug_height: float
    lug_width: float
    felt_height: float
    vertical_mass: float
    horizontal_mass: float
    forward_force: float = 0.0
    gravity: float = 9.8
    arc: int = 6
    flank: int = 3
    top: int = 2
    rings: int = 2

    def __post_init__(self) -> None:
        positive = ("radius", "width", "lug_width", "vertical_mass", "horizontal_mass", "gravity")
        parts.check_positive(self, positive)
        if self.horizontal_mass < self.vertical_mass:
            raise ValueError(
                f"horizontal_mass = {self.horizontal_mass} includes vertical_mass = {self.vertical_mass}: give at "
                "least that"
            )
        if not 0.0 <= self.felt_height <= 1.0:
            raise ValueError(f"felt_height must be between 0 and 1, not {self.felt_height}")
        if not self.lug_height >= 0.0:
            raise ValueError(f"lug_height must be zero or more, not {self.lug_height}")
        if self.lugs < 1 or self.lugs * self.lug_width >= 2 * np.pi * self.radius:
            raise ValueError(f"{self.lugs} lugs of {self.lug_width} m do not fit on a radius of {self.radius} m")

    @property
    def outer_radius(self) -> float:
        """Radius to the ends of the lugs [m]."""
        return self.radius + self.lug_height

    def scaled(self, factor: float, **changes: float) -> "WheelParameters":
        """The same wheel with lengths times factor and masses times factor^3, gravity unchanged."""
        lengths = ("radius", "width", "lug_height", "lug_width")
        masses = ("vertical_mass", "horizontal_mass", "forward_force")
        sizes = {name: factor * getattr(self, name) for name in lengths}
        weights = {name: factor**3 * getattr(self, name) for name in masses}
        return dataclasses.replace(self, **(sizes | weights | changes))

    def outline(self, felt: bool) -> Array:
        """Outline in x and z [m], (n, 2): as the sand feels it, or as it looks."""
        height = self.lug_height * (self.felt_height if felt else 1.0)
        return lugged_outline(
            self.radius, self.lugs, height, self.lug_width, arc=self.arc, flank=self.flank, top=self.top
        )


GROUSER_WHEEL: Final = WheelParameters(
    radius=0.094,
    width=0.140,
    lugs=20,
    lug_height=0.012,
    lug_width=0.006,
    felt_height=1 / 3,
    vertical_mass=6.3,
    horizontal_mass=23.0,
    forward_force=4.0,
)
"""[Agarwal] Table 4.1: the grousered wheel on its gravity-compensated carriage."""

HALF_GROUSER_WHEEL: Final = GROUSER_WHEEL.scaled(0.5, width=0.070)
"""Half-size twin of the grousered wheel, [Agarwal] appendix B.1: lengths halved, masses an eighth."""

FOUR_FLAP_RUNNER: Final = WheelParameters(
    radius=0.025,
    width=1.0,
    lugs=4,
    lug_height=0.070,
    lug_width=0.014,
    felt_height=1.0,
    vertical_mass=10.5,
    horizontal_mass=10.5,
    arc=6,
    flank=20,
    top=4,
    rings=1,
)
"""[Agarwal] Table 4.3: the four-flap runner."""


def build_wheel(
    parameters: WheelParameters,
    rpm: float,
    *,
    drive: Drive = "rate",
    gain: float = SERVO,
    torque_limit: float = math.inf,
) -> mujoco.MjSpec:
    """A wheel on its carriage, touching level ground at z = 0.

    The first actuator has its drive's name and turns the wheel, the second, `push`, pushes the carriage along x.
    Sensors: `x` and `z` of the axle, `speed`, `rate`, `torque`. Camera: `follow`.

    Args:
        parameters: The wheel's.
        rpm: Rate at the start, and that the rate servo aims at [revolutions per minute].
        drive: What the first control is: a servo's `rate` [rad/s], or the axle's `torque` [N m], zero at the start.
        gain: Gain of the rate servo [N m s]; where its torque is limited, above twice the wheel's inertia over the time
            step the torque jumps from limit to limit.
        torque_limit: Largest torque [N m].

    Raises:
        ValueError: No such drive, or a gain or limit that is not positive.
    """
    if drive not in DRIVES:
        raise ValueError(f"no drive {drive!r}; drives are {', '.join(DRIVES)}")
    for name, value in (("gain", gain), ("torque_limit", torque_limit)):
        if not value > 0.0:
            raise ValueError(f"{name} must be positive, not {value}")
    spec = new_scene("wheel", gravity=parameters.gravity, timestep=5e-4)
    add_wheel_meshes(spec, parameters)
    carriage = _add_carriage(spec, parameters)
    _add_wheel(carriage, parameters)
    _add_actuators(spec, drive, gain, torque_limit)
    rate = rpm * 2 * np.pi / 60
    rolling = 0.8 * parameters.outer_radius * rate  # near the steady state, seconds away from rest
    spec.add_key(
        name="start", qvel=[rolling, 0, rate], ctrl=[rate if drive == "rate" else 0.0, parameters.forward_force]
    )
    _add_sensors(spec, drive)
    return spec


def add_wheel_meshes(spec: mujoco.MjSpec, parameters: WheelParameters, prefix: str = "") -> list[mujoco.MjsMesh]:
    """Add the meshes `felt`, which the sand presses on, and `looks`; a prefix goes before these names."""
    meshes = []
    for name, felt in (("felt", True), ("looks", False)):
        vertices, faces = extruded(parameters.outline(felt), parameters.width, rings=parameters.rings)
        meshes.append(spec.add_mesh(name=prefix + name, uservert=vertices.ravel(), userface=faces.ravel()))
    return meshes


def _add_carriage(spec: mujoco.MjSpec, parameters: WheelParameters) -> mujoco.MjsBody:
    """The carriage at the axle's height, weightless on its slide along x, with the camera `follow`."""
    height = parameters.outer_radius
    carriage = spec.worldbody.add_body(name=CARRIAGE, pos=[0, 0, height])
    _weigh(carriage, max(parameters.horizontal_mass - parameters.vertical_mass, 1e-6), 0.1)
    carriage.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    carriage.gravcomp = 1
    parts.add_camera(carriage, 5.0 * height + 1.2 * parameters.width)
    return carriage


def _add_wheel(carriage: mujoco.MjsBody, parameters: WheelParameters) -> None:
    """The wheel on its axle, which slides along z in the carriage; it is felt as one mesh and looks like another."""
    wheel = carriage.add_body(name=WHEEL)
    _weigh(wheel, parameters.vertical_mass, parameters.radius)
    wheel.add_joint(name="z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    wheel.add_joint(name="axle", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    wheel.add_geom(name="felt", type=mesh, meshname="felt", group=parts.SAND_GROUP, rgba=[0.5, 0.5, 0.5, 1])
    wheel.add_geom(
        name="looks",
        type=mesh,
        meshname="looks",
        group=parts.SEEN_GROUP,
        contype=0,
        conaffinity=0,
        rgba=parts.LIMB_RGBA,
    )


def _add_actuators(spec: mujoco.MjSpec, drive: Drive, gain: float, torque_limit: float) -> None:
    """The drive of the axle, and the push of the carriage."""
    motor = spec.add_actuator(name=drive, trntype=mujoco.mjtTrn.mjTRN_JOINT, target="axle")
    if drive == "rate":
        motor.set_to_velocity(kv=gain)
    else:
        motor.set_to_motor()
    if math.isfinite(torque_limit):
        motor.forcerange = [-torque_limit, torque_limit]
    push = spec.add_actuator(name="push", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="x")
    push.set_to_motor()


def _add_sensors(spec: mujoco.MjSpec, drive: Drive) -> None:
    """Place and speed of the axle, rate of the wheel, and the torque of its drive."""
    sensor = mujoco.mjtSensor
    for name, kind, joint in (
        ("x", sensor.mjSENS_JOINTPOS, "x"),
        ("z", sensor.mjSENS_JOINTPOS, "z"),
        ("speed", sensor.mjSENS_JOINTVEL, "x"),
        ("rate", sensor.mjSENS_JOINTVEL, "axle"),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint)
    spec.add_sensor(name="torque", type=sensor.mjSENS_ACTUATORFRC, objtype=mujoco.mjtObj.mjOBJ_ACTUATOR, objname=drive)


def _weigh(body: mujoco.MjsBody, mass: float, radius: float) -> None:
    """Give a body its mass, with the inertia of a sphere."""
    body.explicitinertial = True
    body.mass = mass
    body.ipos = [0, 0, 0]
    body.inertia = [0.4 * mass * radius**2] * 3
