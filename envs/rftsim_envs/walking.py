"""Walking at a commanded velocity: what it asks of any robot on legs whose base is free."""

import abc
import dataclasses
from typing import Any, Final

import mujoco
import numpy as np

from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Training
from rftsim_envs.settings import check_positive
from rftsim_envs.task import Config, ConfigError, Moment, Task, to_body, yaw_of

JOINT_RATE: Final = 10.0
"""Rate in which those of the joints are observed [rad/s]."""
TIPPED: Final = 0.5
"""Cosine of the base's lean from the vertical below which it has tipped over."""
VARIED: Final = 0.05
"""Largest change of a joint's position at an episode's start [rad or m]."""
FASTEST: Final = 10.0
"""Largest velocity that may be commanded [m/s or rad/s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class WalkingConfig(Config):
    """Settings of walking, beside those of all environments.

    Attributes:
        forward: Range of the commanded velocity ahead, drawn for each episode [m/s].
        sideways: Range of the commanded velocity to the left [m/s].
        turning: Range of the commanded yaw rate [rad/s].
        spread: Error of the velocity at which its reward has fallen to 1/e [m/s].
        turning_spread: Error of the yaw rate at which its reward has fallen to 1/e [rad/s].
        velocity: Weight of the velocity's closeness in the reward.
        yaw: Weight of the yaw rate's closeness in the reward.
        survival: Reward per second for every second that the episode goes on.
        energy: Weight of the power in the reward.
        haste: Weight of the actions' changes in the reward.
        tilt: Weight of the base's lean in the reward.
        crouch: Weight in the reward of how much lower the base is than in the pose, for what is to wade in weak sand.
        reduction: Error of a body's wrench, relative, up to which its surface is felt by fewer elements, see
            `rftsim.add_sand`; with zero every triangle is felt.
    """

    period: float = 0.04
    amplitude: float = 0.03
    wavelength: float = 1.5
    forward: tuple[float, float] = (0.2, 0.6)
    sideways: tuple[float, float] = (-0.1, 0.1)
    turning: tuple[float, float] = (-0.2, 0.2)
    spread: float = 0.25
    turning_spread: float = 0.5
    velocity: float = 1.0
    yaw: float = 0.5
    survival: float = 0.0
    energy: float = 0.2
    haste: float = 0.02
    tilt: float = 2.0
    crouch: float = 0.0
    reduction: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("forward", "sideways", "turning"):
            low, high = getattr(self, name)
            if not -FASTEST <= low <= high <= FASTEST:
                raise ConfigError(
                    f"{name} must be a range within -{FASTEST:g} and {FASTEST:g}, low to high, not {(low, high)}"
                )
        check_positive(self, ("spread", "turning_spread"), ConfigError)
        if not 0.0 <= self.reduction < 1.0:
            raise ConfigError(f"reduction must be at least 0 and below 1, not {self.reduction:g}")


class Walking(Task):
    """A robot on legs that follows a velocity in its own heading, one number of an action for each actuator it drives.

    Its base has the free joint, whose positions and velocities come first, and the first keyframe is the start. Those
    that inherit say what robot that is.

    Attributes:
        joints: Names of the joints that are observed, k of them.
        driven: Names of the actuators that actions move.
        grounded: Height of the base above the ground below which it is down [m].
    """

    ncommand = 3
    training = Training(
        steps=1_000_000,
        n_steps=48,
        batch_size=768,
        n_epochs=4,
        gamma=0.98,
        learning_rate=5e-4,
        layers=(128, 128),
        log_std_init=-1.2,
    )
    config: WalkingConfig
    joints: tuple[str, ...]
    driven: tuple[str, ...]
    grounded: float

    @abc.abstractmethod
    def reach(self, model: mujoco.MjModel) -> tuple[Array, Array]:
        """Controls for actions of zero, and their change for actions of 1, of the driven actuators, (naction,) each."""

    @property
    def naction(self) -> int:
        """Number of actuators that are driven."""
        return len(self.driven)

    def options(self) -> dict[str, Any]:
        """Bodies felt by as few elements as the sand needs."""
        return {"reduction": self.config.reduction}

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up the robot's weight, joints, actuators and standing pose in the compiled model."""
        super().prepare(model)
        joints = [model.joint(name) for name in self.joints]
        self._places = np.array([joint.qposadr[0] for joint in joints], dtype=int)
        self._dofs = np.array([joint.dofadr[0] for joint in joints], dtype=int)
        self._pose: Array = model.key_qpos[0][self._places]
        self._tall = float(model.key_qpos[0][2])
        self._held: Array = model.key_ctrl[0].copy()
        self._actuators = np.array([model.actuator(name).id for name in self.driven], dtype=int)
        self._middle, self._reach = self.reach(model)
        ranges = model.actuator_ctrlrange[self._actuators]
        limited = model.actuator_ctrllimited[self._actuators, None].astype(bool)
        self._low, self._high = np.where(limited, ranges, [-np.inf, np.inf]).T

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Let the robot stand, joints off by up to 0.05 rad, and command velocities [m/s] and a yaw rate [rad/s]."""
        qpos[self._places] += rng.uniform(-VARIED, VARIED, len(self.joints))
        c = self.config
        return np.array([rng.uniform(*pair) for pair in (c.forward, c.sideways, c.turning)])

    def controls(self, action: Array, moment: Moment) -> Array:
        """Controls of the actuators, (n, nu), within their ranges; those that are not driven hold the pose."""
        found = np.tile(self._held, (len(action), 1))
        found[:, self._actuators] = np.clip(self._middle + self._reach * action, self._low, self._high)
        return found

    def observe(self, moment: Moment) -> Array:
        """The command, gravity and velocities in the base's axes, joints, rates and last action, (n, 12 + 2 k + na)."""
        turn = moment.qpos[:, 3:7]
        return np.column_stack(
            [
                moment.command,
                to_body(turn, moment.gravity),
                to_body(turn, moment.qvel[:, :3]),
                moment.qvel[:, 3:6],
                moment.qpos[:, self._places] - self._pose,
                moment.qvel[:, self._dofs] / JOINT_RATE,
                moment.action,
            ]
        )

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for velocity, turning, survival, power, haste, tilt and crouching, (n,) each."""
        c, down = self.config, to_body(moment.qpos[:, 3:7], moment.gravity)
        return {
            "velocity": c.velocity * closeness(_velocity(moment) - moment.command[:, :2], c.spread),
            "turning": c.yaw * closeness(_turning(moment)[:, None] - moment.command[:, 2:], c.turning_spread),
            "survival": np.where(self.failed(moment), 0.0, c.survival),
            "power": -c.energy * moment.power / self.weight,
            "haste": -c.haste * ((moment.action - moment.last) ** 2).sum(axis=1),
            "tilt": -c.tilt * (down[:, :2] ** 2).sum(axis=1),
            "crouch": -c.crouch * np.maximum(1.0 - self._height(moment) / self._tall, 0.0) ** 2,
        }

    def failed(self, moment: Moment) -> Flags:
        """Whether the base has tipped over or is down on the ground, (n,)."""
        upright = -to_body(moment.qpos[:, 3:7], moment.gravity)[:, 2]
        return (upright < TIPPED) | (self._height(moment) < self.grounded)

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Velocity ahead and to the left, yaw rate, error, height and tilt, (n,) each."""
        ahead, sideways = _velocity(moment).T
        down = to_body(moment.qpos[:, 3:7], moment.gravity)
        return {
            "speed": ahead,
            "sideways": sideways,
            "turning": _turning(moment),
            "error": np.linalg.norm(_velocity(moment) - moment.command[:, :2], axis=1),
            "height": self._height(moment),
            "tilt": np.arccos(np.clip(-down[:, 2], -1.0, 1.0)),
        }

    def speed(self, moment: Moment) -> Array:
        """Mean speed ahead over the step [m/s], (n,)."""
        return _velocity(moment)[:, 0]

    def _height(self, moment: Moment) -> Array:
        """Height of the base above the ground [m], (n,)."""
        height: Array = moment.qpos[:, 2] - self.ground_below(moment)
        return height


def closeness(error: Array, spread: float) -> Array:
    """Reward that is 1 where the error (n, k) is zero and 1/e where it is as large as the spread, (n,)."""
    value: Array = np.exp(-(error**2).sum(axis=1) / spread**2)
    return value


def _velocity(moment: Moment) -> Array:
    """Mean velocity over the ground over the step, ahead and to the left [m/s], (n, 2)."""
    moved, yaw = (moment.qpos - moment.before)[:, :2] / moment.period, yaw_of(moment.before[:, 3:7])
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.column_stack([cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]])


def _turning(moment: Moment) -> Array:
    """Mean yaw rate over the step [rad/s], (n,)."""
    turned = yaw_of(moment.qpos[:, 3:7]) - yaw_of(moment.before[:, 3:7])
    return np.arctan2(np.sin(turned), np.cos(turned)) / moment.period
