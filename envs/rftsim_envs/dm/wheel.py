"""Parts that the wheels' domains share: a model whose rate is commanded, its physics, the suite's form of a task."""

import collections
from collections.abc import Mapping
from typing import Any, Final

import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control
from dm_control.suite import base
from dm_env import specs
from rftsim_models.wheels import CARRIAGE, WHEEL, WheelParameters, build_wheel

from rftsim.model.readout import instances, wrenches
from rftsim.sand.medium import Sand
from rftsim.sand.presets import make_sand
from rftsim_envs.dm.whole_steps import WholeSteps
from rftsim_envs.ground import lay
from rftsim_envs.physics import Array
from rftsim_envs.task import Moment, Task

Observation = collections.OrderedDict[str, Array]

TIMESTEP: Final = 0.001
"""Time step of the physics [s]."""
TIME_LIMIT: Final = 10.0
"""Duration of an episode [s]."""
DOWN: Final = np.array([0.0, 0.0, -1.0])
"""Direction of gravity, (3,)."""
STRENGTH: Final = (0.5, 2.0)
"""Range of the factor of the sand's strength where it is random, drawn log-uniform."""
_COLOURS: Final = {"": (0.7, 0.5, 0.3, 1.0), "_default": (0.7, 0.5, 0.3, 1.0), "_highlight": (0.0, 0.5, 0.3, 1.0)}


class Physics(WholeSteps):
    """A wheel on its carriage, on sand, in physical quantities."""

    def radius(self) -> float:
        """Outer radius of the wheel [m]."""
        return float(self.named.model.numeric_data["radius"][0])

    def speed(self) -> float:
        """Speed of the axle along x [m/s]."""
        return float(self.named.data.qvel["x"][0])

    def climb(self) -> float:
        """Speed of the axle along z, upward [m/s]."""
        return float(self.named.data.qvel["z"][0])

    def rate(self) -> float:
        """Rate at which the wheel turns [rad/s]."""
        return float(self.named.data.qvel["axle"][0])

    def phase(self) -> Array:
        """Cosine and sine of the wheel's angle, (2,)."""
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

    def effort(self) -> float:
        """Positive power of drive and push [W], with the forces of the last step."""
        push = float(self.named.data.actuator_force["push"]) * self.speed()
        return max(self.power(), 0.0) + max(push, 0.0)


class WheelTask(base.Task):
    """A task of `rftsim_envs` for a wheel whose rate is the action [rad/s], in the style of the suite.

    Attributes:
        asked: The task, which says what the wheel runs on and what that is worth.
    """

    def __init__(self, asked: Task, random_sand: bool, random: "np.random.RandomState | int | None") -> None:
        """Make a task in the style of the suite.

        Args:
            asked: The task of `rftsim_envs`.
            random_sand: Whether each episode draws the sand's strength, within STRENGTH.
            random: A state or a seed.
        """
        self.asked, self._random_sand = asked, random_sand
        super().__init__(random=random)

    def command(self) -> Array:
        """The command of this episode, as the task of `rftsim_envs` has it, (ncommand,)."""
        return np.zeros(self.asked.ncommand)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """The range of the rate that is commanded [rad/s], (1,)."""
        low, high = physics.named.model.actuator_ctrlrange["rate"]
        return specs.BoundedArray((1,), float, low, high, name="rate")

    def initialize_episode(self, physics: Physics) -> None:
        """Start near rolling, at a random rate and angle."""
        physics.reset(keyframe_id=0)  # for the constant push
        if self._random_sand:
            low, high = np.log(STRENGTH)
            sand = make_sand(self.asked.config.sand)
            set_strength(physics, sand, np.exp(self.random.uniform(low, high)))
        rate = self.random.uniform(*physics.named.model.actuator_ctrlrange["rate"])
        physics.named.data.ctrl["rate"] = rate
        physics.named.data.qpos["axle"] = self.random.uniform(0.0, 2 * np.pi)
        physics.named.data.qvel[["x", "axle"]] = 0.8 * physics.radius() * rate, rate
        super().initialize_episode(physics)

    def before_step(self, action: Array, physics: Physics) -> None:
        """Command the rate that the action is [rad/s], (1,)."""
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

    def get_reward(self, physics: Physics) -> float:
        """The reward per second of the task of `rftsim_envs` at this moment, cut to the suite's range of 0 to 1."""
        terms = self.asked.rewards(self._moment(physics))
        return float(np.clip(sum(terms.values()), 0.0, 1.0).item())

    def _moment(self, physics: Physics) -> Moment:
        """This moment, as the end of a control step at the present speed and power, for a task that asks no action."""
        qpos, qvel, period = physics.data.qpos[None], physics.data.qvel[None], self.asked.config.period
        none = np.zeros((1, self.asked.naction))
        return Moment(
            before=qpos - period * qvel,
            qpos=qpos,
            qvel=qvel,
            sensors=physics.data.sensordata[None],
            gravity=DOWN[None],
            command=self.command()[None],
            action=none,
            last=none,
            power=np.array([physics.effort()]),
            period=period,
        )


def set_strength(physics: Physics, sand: Sand, factor: float) -> None:
    """Give the sand under a model this multiple of a sand's strength, in 2D and 3D laws."""
    assert sand.xi_n is not None
    assert sand.zeta is not None
    for bed in instances(physics.model.ptr):
        bed.bed.xi_n, bed.bed.zeta = factor * sand.xi_n, factor * sand.zeta


def rate_driven(parameters: WheelParameters, top_rate: float) -> mujoco.MjSpec:
    """A wheel whose rate is commanded between zero and the top rate [rad/s], in colours that show the reward."""
    spec = build_wheel(parameters, rpm=0.0)
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
    return spec


def make_environment(
    robot: mujoco.MjSpec, task: WheelTask, time_limit: float, environment_kwargs: Mapping[str, Any] | None
) -> control.Environment:
    """The environment of a task and its robot, with the task's control period unless its arguments say otherwise."""
    physics = Physics.from_model(MjModel(lay(task.asked, robot)))
    task.asked.prepare(physics.model.ptr)
    kwargs = dict(environment_kwargs or {})
    if "n_sub_steps" not in kwargs:
        kwargs.setdefault("control_timestep", task.asked.config.period)
    return control.Environment(physics, task, time_limit=time_limit, **kwargs)
