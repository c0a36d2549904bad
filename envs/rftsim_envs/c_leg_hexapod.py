"""`rftsim/CLegHexapod-v0`: six C-shaped legs, each turned by its own motor, run straight and fast."""

import dataclasses
from typing import Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.hexapod import HEXAPOD, LEGS, TRIPODS, build_hexapod

from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Drive, Training, constant
from rftsim_envs.task import Config, Moment, Task, to_body, yaw_of

WALK: Final = 10.0
"""Rate of the legs for an action of zero [rad/s]."""
SWAY: Final = 12.0
"""Change of that rate for an action of one [rad/s]."""
UNIT: Final = float(np.sqrt(9.81 * HEXAPOD.hip_height))
"""Speed that observation and reward count in: sqrt(g h), h the height of the hips [m/s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class HexapodConfig(Config):
    """Settings of the hexapod, beside those of all environments.

    Attributes:
        straight: Weight of the sideways speed and of the turning in the reward.
        energy: Weight of the squared power in the reward. A supply's losses grow with the square of its current.
    """

    sand: str = "close-poppy-seeds"
    duration: float = 5.0
    straight: float = 0.5
    energy: float = 0.1


class CLegHexapod(Task):
    """A hexapod of the RHex family, of SandBot's size (2.3 kg, 0.3 m), from rest on one of its two tripods.

    Action, 6 numbers: rates of the legs, -1 to 1 for -2 to 22 rad/s (0 is a walk at 10 rad/s), in the order of
    `rftsim_models.hexapod.LEGS`: left front, middle and rear, right front, middle and rear.

    | observation | size | unit |
    |---|---|---|
    | sines of the legs' angles | 6 | - |
    | cosines of the legs' angles | 6 | - |
    | rates of the legs | 6 | 30 rad/s |
    | downward, in the torso's axes | 3 | - |
    | velocity of the torso, in its axes | 3 | sqrt(g h) = 0.83 m/s |
    | angular velocity of the torso, in its axes | 3 | 5 rad/s |
    | sine and cosine of the heading | 2 | - |
    | last action | 6 | - |

    Reward per second, with u = sqrt(g h): v_x / u - straight (|v_y| / u + |heading| / rad)
    - energy (P / (m g u))^2, P the motors' positive power. The episode ends early where the robot lies on its back or
    side.

    `info`: `speed` along x and `drift` along y [m/s], `heading` [rad], and what all tasks tell.
    """

    Settings = HexapodConfig
    length = HEXAPOD.length
    edge = parts.AS_MESHED
    naction = len(LEGS)
    training = Training(
        steps=400_000,
        n_steps=64,
        batch_size=1024,
        n_epochs=10,
        learning_rate=1e-3,
        layers=(128, 128),
        log_std_init=-2.3,
    )
    config: HexapodConfig

    def build(self) -> mujoco.MjSpec:
        """The hexapod, whose first keyframe stands on six legs."""
        return build_hexapod()

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Put the robot at rest on one tripod, the other's legs pointing up; nothing is commanded."""
        raised = TRIPODS[rng.integers(2)]
        qpos[7:] = rng.uniform(-0.2, 0.2, size=len(LEGS))
        qpos[7 + np.array(raised)] += np.pi
        return np.empty(0)

    def controls(self, action: Array, moment: Moment) -> Array:
        """Rates of the legs [rad/s], (n, 6): a walk, faster or slower as the action says."""
        return WALK + SWAY * action

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 35)."""
        quaternion, legs, twist = moment.qpos[:, 3:7], moment.qpos[:, 7:], moment.qvel
        heading = yaw_of(quaternion)
        return np.hstack(
            [
                np.sin(legs),
                np.cos(legs),
                twist[:, 6:] / HEXAPOD.rate,
                to_body(quaternion, moment.gravity),
                to_body(quaternion, twist[:, :3]) / UNIT,
                twist[:, 3:6] / 5.0,
                np.sin(heading)[:, None],
                np.cos(heading)[:, None],
                moment.action,
            ]
        )

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for speed, for what goes `aside`, and for the motors' power, (n,) each."""
        told = self.measures(moment)
        return running_straight(
            told["speed"] / UNIT,
            told["drift"] / UNIT,
            told["heading"],
            moment.power / (self.weight * UNIT),
            self.config.straight,
            self.config.energy,
        )

    def failed(self, moment: Moment) -> Flags:
        """Whether the robot lies on its back or on its side, (n,)."""
        return np.asarray(to_body(moment.qpos[:, 3:7], moment.gravity)[:, 2] > -0.3)

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Speed along x, drift along y [m/s] and heading [rad], (n,) each."""
        drift = (moment.qpos[:, 1] - moment.before[:, 1]) / moment.period
        return {"speed": self.speed(moment), "drift": drift, "heading": yaw_of(moment.qpos[:, 3:7])}

    def open_loops(self) -> dict[str, Drive]:
        """The alternating tripod gait at constant rates."""
        return {f"{rate} rad/s": constant(*[(rate - WALK) / SWAY] * len(LEGS)) for rate in range(1, 23)}


def running_straight(
    speed: Array, drift: Array, heading: Array, power: Array, straight: float, energy: float
) -> dict[str, Array]:
    """Terms for running fast along x, not aside, facing ahead, at a steady draw; all without dimensions."""
    aside = np.abs(drift) + np.minimum(np.abs(heading), 1.0)
    return {"speed": speed, "aside": -straight * aside, "power": -energy * power**2}
