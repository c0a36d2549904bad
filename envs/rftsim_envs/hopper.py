"""`rftsim/Hopper-v0`: one leg with a flat foot hops in the x-z plane at a commanded speed."""

import dataclasses
from typing import Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.hopper import HOPPER, JOINTS, RANGES, build_hopper

from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Drive, Training
from rftsim_envs.task import Config, ConfigError, Moment, Task

POSE: Final = np.array([-HOPPER.crouch, 2 * HOPPER.crouch, -HOPPER.crouch])
"""Angles of hip, knee and ankle about which actions move them [rad], (3,)."""
REACH: Final = np.array([0.7, 0.9, 0.7])
"""Change of these angles for an action of one [rad], (3,)."""
LOWEST: Final = 0.22
"""Height of the hip below which the hopper has fallen [m]."""
STEEPEST: Final = 0.9
"""Lean of the torso beyond which it has fallen [rad]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class HopperConfig(Config):
    """Settings of the hopper, beside those of all environments.

    Attributes:
        speed: Range of the commanded speed, drawn for each episode [m/s].
        energy: Weight of the power, over m g times 1 m/s, in the reward.
        smooth: Weight of the squared change of the action from step to step in the reward.
    """

    sand: str = "close-poppy-seeds"
    duration: float = 8.0
    speed: tuple[float, float] = (0.3, 0.7)
    energy: float = 0.05
    smooth: float = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.speed[0] <= self.speed[1]:
            raise ConfigError(f"speed must be a range above 0 m/s, low to high, not {self.speed}")


class Hopper(Task):
    """A planar hopper of 9 kg on a flat foot of 0.16 x 0.10 m, from a crouch.

    Action, 3 numbers: targets of the position servos of hip, knee and ankle, -1 to 1 for 0.7, 0.9 and 0.7 rad about the
    crouch.

    | observation | size | unit |
    |---|---|---|
    | commanded speed | 1 | m/s |
    | height of the hip | 1 | 0.5 m |
    | downward along x and z, in the torso's axes | 2 | - |
    | angles of hip, knee and ankle from the crouch | 3 | rad |
    | velocity along x and z | 2 | m/s |
    | rate of the pitch | 1 | 5 rad/s |
    | rates of hip, knee and ankle | 3 | 10 rad/s |
    | last action | 3 | - |

    Reward per second: 1 - |v - command| / command, at least -1, + 0.2 - energy P / (m g 1 m/s)
    - smooth |change of action|^2, v the speed along x and P the motors' positive power.
    The episode ends early where the hopper has fallen: hip below 0.22 m, or torso leaning by more than 0.9 rad.

    `info`: `speed` and `command` [m/s], `height` of the hip [m], and what all tasks tell.
    """

    Settings = HopperConfig
    planar = True
    length = HOPPER.torso_height + HOPPER.thigh + HOPPER.shank
    edge = parts.AS_MESHED
    ncommand = 1
    naction = len(JOINTS)
    training = Training(
        steps=600_000, n_steps=64, batch_size=512, n_epochs=10, learning_rate=8e-4, layers=(128, 128), log_std_init=-0.7
    )
    config: HopperConfig

    def build(self) -> mujoco.MjSpec:
        """The hopper, whose first keyframe crouches on its flat foot."""
        return build_hopper()

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Put the hopper near its crouch, nearly at rest, and command a speed [m/s]."""
        qpos[2:] += rng.uniform(-0.03, 0.03, size=4)
        qvel[:] = rng.uniform(-0.03, 0.03, size=qvel.size)
        return np.array([rng.uniform(*self.config.speed)])

    def controls(self, action: Array, moment: Moment) -> Array:
        """Targets of hip, knee and ankle [rad], (n, 3), within their ranges."""
        target: Array = np.clip(POSE + REACH * action, *np.transpose(RANGES))
        return target

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 16)."""
        columns = [
            moment.command,
            self._height(moment)[:, None] / 0.5,
            _lean(moment),
            moment.qpos[:, 3:] - POSE,
            moment.qvel[:, :2],
            moment.qvel[:, 2:3] / 5.0,
            moment.qvel[:, 3:] / 10.0,
            moment.action,
        ]
        return np.hstack(columns)

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for tracking, standing upright, power and jerks, (n,) each."""
        return hopping(
            self.speed(moment) / moment.command[:, 0],
            moment.power / self.weight,
            moment.action - moment.last,
            self.config.energy,
            self.config.smooth,
        )

    def failed(self, moment: Moment) -> Flags:
        """Whether the hip is below LOWEST or the torso leans beyond STEEPEST, (n,)."""
        fallen: Flags = (self._height(moment) < LOWEST) | (_lean(moment)[:, 1] > -np.cos(STEEPEST))
        return fallen

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Speed along x, command [m/s] and height of the hip [m], (n,) each."""
        return {
            "speed": self.speed(moment),
            "command": moment.command[:, 0].copy(),
            "height": self._height(moment),
        }

    def lean(self, qpos: Array, slope: Array) -> None:
        """Let the foot alone lean with the ground, so that the hopper stands over it."""
        qpos[-1] = np.clip(qpos[-1] - np.arctan(slope[0]), *RANGES[-1])

    def _height(self, moment: Moment) -> Array:
        """Height of the hip over the ground [m], (n,)."""
        height: Array = moment.qpos[:, 1] - self.ground_below(moment)
        return height

    def open_loops(self) -> dict[str, Drive]:
        """Strokes at constant rates: the leg's length follows a sine, and the hip swings with it or ahead."""
        return {
            f"{hertz:g} Hz, stroke {stroke:g}, swing {swing:g}, ahead {ahead:g} of a turn": _strokes(
                2.0 * np.pi * hertz, stroke, swing, 2.0 * np.pi * ahead
            )
            for hertz in (1.5, 2.0, 2.5, 3.0)
            for stroke in (0.2, 0.4, 0.7)
            for swing in (0.1, 0.3)
            for ahead in (0.0, 0.25, 0.5, 0.75)
        }


def _strokes(rate: float, stroke: float, swing: float, ahead: float) -> Drive:
    """A drive that folds and stretches the leg, hip and ankle half as much as the knee, and swings it."""

    def drive(time: float) -> Array:
        fold, swung = stroke * np.sin(rate * time), swing * np.sin(rate * time + ahead)
        target = np.array([-0.5 * fold + swung, fold, -0.5 * fold - swung]) * REACH[1] / REACH
        action: Array = np.clip(target, -1.0, 1.0)
        return action

    return drive


def _lean(moment: Moment) -> Array:
    """Components of downward along the torso's x and z, (n, 2); the pitch turns x to -z."""
    sine, cosine = np.sin(moment.qpos[:, 2]), np.cos(moment.qpos[:, 2])
    x, z = moment.gravity[:, 0], moment.gravity[:, 2]
    return np.column_stack([x * cosine - z * sine, x * sine + z * cosine])


def hopping(speed: Array, power: Array, change: Array, energy: float, smooth: float) -> dict[str, Array]:
    """Terms for hopping at a speed, (n,) each.

    Args:
        speed: Speed over the commanded one [-], (n,).
        power: Power over the weight [m/s], (n,).
        change: Change of the action, (n, naction).
        energy: Weight of the power.
        smooth: Weight of the squared change.
    """
    return {
        "tracking": np.maximum(1.0 - np.abs(speed - 1.0), -1.0),
        "upright": np.full(len(speed), 0.2),
        "power": -energy * power,
        "jerk": -smooth * (change**2).sum(axis=1),
    }
