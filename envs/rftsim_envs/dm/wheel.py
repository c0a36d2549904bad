"""What the wheel's domains share: the model on its sand, the quantities that tasks speak of, the common task."""

import collections
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from dm_control import mujoco as dm_mujoco
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control
from dm_control.suite import base
from dm_env import specs
from numpy.typing import NDArray
from rftsim_models.wheels import CARRIAGE, WHEEL, WheelParameters, build_wheel

from rftsim.law.layout import STRENGTHS
from rftsim.model.add_sand import add_sand
from rftsim.model.readout import instances, wrenches
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Wheel

Array = NDArray[np.float64]
Observation = collections.OrderedDict[str, Array]

CONTROL_TIMESTEP: Final = 0.02
TIMESTEP: Final = 0.001
STRENGTH: Final = (0.5, 2.0)
"""Range of the factor on the sand's strength where it is random; log-uniform."""
_COLOURS: Final = {"": (0.7, 0.5, 0.3, 1.0), "_default": (0.7, 0.5, 0.3, 1.0), "_highlight": (0.0, 0.5, 0.3, 1.0)}


class Ground(NamedTuple):
    """What a domain's wheel runs on."""

    sand: Sand
    law: str
    structural: bool
    """Whether the free surface drops behind the wheel."""


class Physics(dm_mujoco.Physics):
    """A wheel on its carriage, on sand."""

    def step(self, nstep: int = 1) -> None:
        """Advance by whole steps, as the sand's force is solved for with the step's own controls in hand."""
        with self.check_invalid_state():
            mujoco.mj_step(self.model.ptr, self.data.ptr, nstep)
            if self.legacy_step:  # positions, velocities and the sand's force of where it has come to
                mujoco.mj_step1(self.model.ptr, self.data.ptr)

    def radius(self) -> float:
        """Outer radius [m]."""
        return float(self.named.model.numeric_data["radius"][0])

    def speed(self) -> float:
        """Horizontal speed [m/s]."""
        return float(self.named.data.qvel["x"][0])

    def climb(self) -> float:
        """Vertical speed of the axle [m/s]."""
        return float(self.named.data.qvel["z"][0])

    def rate(self) -> float:
        """Angular velocity [rad/s]."""
        return float(self.named.data.qvel["axle"][0])

    def phase(self) -> Array:
        """Cosine and sine of the wheel's angle."""
        angle = self.named.data.qpos["axle"][0]
        return np.array([np.cos(angle), np.sin(angle)])

    def sinkage(self) -> float:
        """Outer radius less the axle's height above the sand [m]."""
        return self.radius() - float(self.named.data.xpos[WHEEL, "z"])

    def slip(self) -> float:
        """Slip, 1 - v/(R omega) of a driven wheel and R omega/v - 1 of a towed one; in [-1, 1], negative where towed.

        Where rim and axle move in opposite directions it is 1 or -1.
        """
        rim, speed = self.radius() * self.rate(), self.speed()
        faster = max(abs(rim), abs(speed))
        return float(np.clip((rim - speed) * np.sign(rim + speed) / faster, -1.0, 1.0)) if faster > 0.0 else 0.0

    def sand_force(self) -> Array:
        """Force of the sand on the wheel [N], world frame, (3,)."""
        return np.array(self.named.data.sensordata[f"{WHEEL}_sand"][:3])

    def sand_power(self) -> float:
        """Power of the sand on the wheel [W]; negative where it resists."""
        return float(wrenches(self.model.ptr, self.data.ptr).power.sum())

    def power(self) -> float:
        """Power of the drive [W], with the torque of the last step."""
        return float(self.named.data.sensordata["torque"][0]) * self.rate()


class Task(base.Task):
    """A wheel whose rate is the action [rad/s]; subclasses reward it."""

    def __init__(self, ground: Ground, random_sand: bool, random: "np.random.RandomState | int | None") -> None:
        """A task.

        Args:
            ground: What the wheel runs on.
            random_sand: Whether each episode draws the sand's strength, within STRENGTH.
            random: A state or a seed.
        """
        self._ground, self._random_sand = ground, random_sand
        super().__init__(random=random)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """The rate [rad/s], (1,)."""
        low, high = physics.named.model.actuator_ctrlrange["rate"]
        return specs.BoundedArray((1,), float, low, high, name="rate")

    def initialize_episode(self, physics: Physics) -> None:
        """Start near rolling, at a random rate and angle."""
        physics.reset(keyframe_id=0)  # for the constant push
        if self._random_sand:
            low, high = np.log(STRENGTH)
            set_strength(physics, self._ground.sand, np.exp(self.random.uniform(low, high)))
        rate = self.random.uniform(*physics.named.model.actuator_ctrlrange["rate"])
        physics.named.data.ctrl["rate"] = rate
        physics.named.data.qpos["axle"] = self.random.uniform(0.0, 2 * np.pi)
        physics.named.data.qvel[["x", "axle"]] = 0.8 * physics.radius() * rate, rate
        super().initialize_episode(physics)

    def before_step(self, action: Array, physics: Physics) -> None:
        """Command the rate."""
        physics.named.data.ctrl["rate"] = np.asarray(action).item()

    def get_observation(self, physics: Physics) -> Observation:
        """The wheel's motion and the sand's force, in SI units."""
        motion = [physics.speed(), physics.climb(), physics.rate()]
        return collections.OrderedDict(
            phase=physics.phase(),
            sinkage=np.array([physics.sinkage()]),
            velocity=np.array(motion),
            slip=np.array([physics.slip()]),
            sand_force=physics.sand_force(),
        )


def set_strength(physics: Physics, sand: Sand, factor: float) -> None:
    """Give the sand under a model this multiple of a sand's strength, in 2D and 3D laws."""
    assert sand.xi_n is not None
    assert sand.zeta is not None
    for bed in instances(physics.model.ptr):
        bed.sand[STRENGTHS] = factor * sand.xi_n, factor * sand.zeta


def make_physics(parameters: WheelParameters, ground: Ground, top_rate: float) -> Physics:
    """A wheel on its sand, whose rate is commanded between zero and the top rate [rad/s]."""
    spec = build_wheel(parameters, rpm=0.0)
    spec.option.timestep = TIMESTEP
    servo = spec.actuator("rate")
    servo.ctrlrange, servo.ctrllimited = [0.0, top_rate], True
    spec.add_numeric(name="radius", data=[parameters.outer_radius], size=1)
    for name in ("self", "effector", "target"):  # which dm_control colours by the reward
        for suffix, rgba in _COLOURS.items():
            spec.add_material(name=name + suffix, rgba=rgba)
    looks = spec.geom("looks")
    looks.material, looks.rgba = "self", [0.5, 0.5, 0.5, 1.0]  # MuJoCo's default, which lets the material show
    away = 5 * parameters.outer_radius + parameters.width
    spec.body(CARRIAGE).add_camera(name="side", pos=[0, -away, 0.3 * away], xyaxes=[1, 0, 0, 0, 0.3, 1])
    rolling = Wheel((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), parameters.outer_radius)
    add_sand(
        spec,
        ground.sand,
        ground.law,
        max_edge=2 * parameters.width,  # as fine as the outline
        wheels={WHEEL: rolling} if ground.structural else (),
    )
    physics: Physics = Physics.from_model(MjModel(spec.compile()))
    return physics


def make_environment(
    physics: Physics, task: Task, time_limit: float, environment_kwargs: Mapping[str, Any] | None
) -> control.Environment:
    """The environment of a task, with actions every CONTROL_TIMESTEP [s] unless its arguments say otherwise."""
    kwargs = dict(environment_kwargs or {})
    if "n_sub_steps" not in kwargs:
        kwargs.setdefault("control_timestep", CONTROL_TIMESTEP)
    return control.Environment(physics, task, time_limit=time_limit, **kwargs)
