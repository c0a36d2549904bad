"""`rftsim/Quadruped-v0`: a quadruped walks at a commanded velocity."""

import dataclasses
from typing import Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.quadruped import FEET, JOINTS, QUADRUPED, RANGES, build_quadruped

from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Training
from rftsim_envs.settings import check_positive
from rftsim_envs.task import Config, ConfigError, Moment, Task, to_body, yaw_of

REACH: Final = np.tile([0.15, 0.35, 0.35], 4)
"""Changes of abduction, hip and knee from the standing pose for an action of 1 [rad]."""
LOW, HIGH = np.tile(RANGES, (4, 1)).T
"""Ranges of the joints [rad], (12,) each."""
JOINT_RATE: Final = 10.0
"""Rate in which those of the joints are observed [rad/s]."""
TIPPED: Final = 0.5
"""Cosine of the torso's lean from the vertical below which it has tipped over."""
GROUNDED: Final = QUADRUPED.height
"""Height of the torso's middle above the ground below which it is down [m]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class QuadrupedConfig(Config):
    """Settings of the quadruped, beside those of all environments.

    Attributes:
        forward: Range of the commanded velocity ahead, drawn for each episode [m/s].
        sideways: Range of the commanded velocity to the left [m/s].
        turning: Range of the commanded yaw rate [rad/s].
        spread: Error of the velocity at which its reward has fallen to 1/e [m/s].
        turning_spread: Error of the yaw rate at which its reward has fallen to 1/e [rad/s].
        energy: Weight of the power in the reward.
        haste: Weight of the actions' changes in the reward.
        tilt: Weight of the torso's lean in the reward.
    """

    sand: str = "close-poppy-seeds"
    amplitude: float = 0.03
    wavelength: float = 1.5
    period: float = 0.04
    forward: tuple[float, float] = (0.2, 0.6)
    sideways: tuple[float, float] = (-0.1, 0.1)
    turning: tuple[float, float] = (-0.2, 0.2)
    spread: float = 0.25
    turning_spread: float = 0.5
    energy: float = 0.2
    haste: float = 0.02
    tilt: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("forward", "sideways", "turning"):
            low, high = getattr(self, name)
            if not -3.0 <= low <= high <= 3.0:
                raise ConfigError(f"{name} must be a range within -3 and 3, low to high, not {(low, high)}")
        check_positive(self, ("spread", "turning_spread"), ConfigError)


class Quadruped(Task):
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

    Reward per second: exp(-|v - commanded v|^2 / spread^2) + exp(-(w - commanded w)^2 / turning_spread^2) / 2
    - energy P / (m g 1 m/s) - haste |a - last a|^2 - tilt (g_x^2 + g_y^2), v the velocity over the ground in the
    heading's axes and w the yaw rate, both means over the control step as is the servos' positive power P, and g the
    direction of gravity in the torso's axes.
    The episode ends in failure where the torso leans 60 deg from the vertical, or its middle is less than 0.1 m above
    the ground.

    `info`: `speed`, ahead, `sideways` [m/s], `turning` [rad/s], `error`, of the velocity over the ground [m/s],
    `height` of the torso's middle [m], `tilt` from the vertical [rad], and what all tasks tell.
    """

    Settings = QuadrupedConfig
    felt = (parts.TORSO, *FEET)
    length = QUADRUPED.length
    edge = parts.AS_MESHED
    ncommand = 3
    naction = len(JOINTS)
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
    config: QuadrupedConfig

    def build(self) -> mujoco.MjSpec:
        """The quadruped, whose first keyframe stands on four bent legs."""
        return build_quadruped()

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up the robot's weight and its standing pose in the compiled model."""
        super().prepare(model)
        self._stance: Array = model.key_ctrl[0].copy()

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Let the robot stand, joints off by up to 0.05 rad, and command velocities [m/s] and a yaw rate [rad/s]."""
        qpos[7:] += rng.uniform(-0.05, 0.05, len(JOINTS))
        c = self.config
        return np.array([rng.uniform(*pair) for pair in (c.forward, c.sideways, c.turning)])

    def controls(self, action: Array, moment: Moment) -> Array:
        """Targets of the joints [rad], (n, 12), within their ranges."""
        return np.clip(self._stance + REACH * action, LOW, HIGH)

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 48)."""
        turn = moment.qpos[:, 3:7]
        return np.column_stack(
            [
                moment.command,
                to_body(turn, moment.gravity),
                to_body(turn, moment.qvel[:, :3]),
                moment.qvel[:, 3:6],
                moment.qpos[:, 7:] - self._stance,
                moment.qvel[:, 6:] / JOINT_RATE,
                moment.action,
            ]
        )

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for velocity, turning, power, haste and tilt, (n,) each."""
        c, down = self.config, to_body(moment.qpos[:, 3:7], moment.gravity)
        return {
            "velocity": closeness(_velocity(moment) - moment.command[:, :2], c.spread),
            "turning": 0.5 * closeness(_turning(moment)[:, None] - moment.command[:, 2:], c.turning_spread),
            "power": -c.energy * moment.power / self.weight,
            "haste": -c.haste * ((moment.action - moment.last) ** 2).sum(axis=1),
            "tilt": -c.tilt * (down[:, :2] ** 2).sum(axis=1),
        }

    def failed(self, moment: Moment) -> Flags:
        """Whether the torso has tipped over or is down on the ground, (n,)."""
        upright = -to_body(moment.qpos[:, 3:7], moment.gravity)[:, 2]
        return (upright < TIPPED) | (self._height(moment) < GROUNDED)

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Velocity ahead and to the left, yaw rate, error, height and tilt, as the class says, (n,) each."""
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
        """Height of the torso's middle above the ground [m], (n,)."""
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
