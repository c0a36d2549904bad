"""`rftsim/FourFlapRunner-v0`: a wheel of four flaps runs fast, and cheaply."""

import dataclasses
from typing import Final, Literal

import mujoco
import numpy as np
from rftsim_models.wheels import FOUR_FLAP_RUNNER, WHEEL, build_wheel

from rftsim_envs.physics import Array
from rftsim_envs.recipe import Drive, Training, constant
from rftsim_envs.task import Config, Moment, Task

RUNNER: Final = dataclasses.replace(FOUR_FLAP_RUNNER, arc=3, flank=6, top=1)
"""The runner in a third of its triangles; steady speeds differ by under 1 %."""
ROLL: Final = 7.0
"""Rate of the drive for an action of zero [rad/s]."""
SWAY: Final = 8.0
"""Change of that rate for an action of one [rad/s]."""
TORQUE: Final = 20.0
"""Largest torque of the drive [N m]; twice the weight times the outer radius."""
GAIN: Final = 20.0
"""Gain of the rate servo [N m s]."""
UNIT: Final = float(np.sqrt(RUNNER.gravity * 2 * RUNNER.outer_radius))
"""Speed that observation and reward count in: sqrt(g l), l the outer diameter [m/s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunnerConfig(Config):
    """Settings of the runner, beside those of all environments.

    Attributes:
        energy: Weight of the squared power in the reward. A supply's losses grow with the square of its current, so
            bursts cost more than a steady draw.
    """

    sand: str = "preset=poppy-seeds,lambda_=4"
    law: Literal["rft2d", "drft2d", "rft3d", "drft3d"] = "drft2d"
    duration: float = 5.0
    energy: float = 1.0


class FourFlapRunner(Task):
    """The runner of [Agarwal] Table 4.3 (10.5 kg, four flaps of 70 mm) in the x-z plane, its rate commanded.

    Action, 1 number: rate of the drive, -1 to 1 for -1 to 15 rad/s (0 rolls at 7 rad/s); the drive gives up to 20 N m.

    | observation | size | unit |
    |---|---|---|
    | sine and cosine of four times the angle | 2 | - |
    | rate | 1 | 15 rad/s |
    | velocity along x and z | 2 | sqrt(g l) = 1.36 m/s |
    | height of the axle, less outer radius | 1 | 0.1 m |
    | last action | 1 | - |

    Reward per second: v / sqrt(g l) - energy (P / (m g sqrt(g l)))^2, v the speed along x and P the drive's positive
    power, both means over the control step.
    The episode ends after its duration only.

    `info`: `speed` [m/s], `rate` [rad/s], `slip` 1 - v / (R rate), and what all tasks tell.
    """

    Settings = RunnerConfig
    felt = (WHEEL,)
    planar = True
    length = 2.0 * RUNNER.outer_radius
    edge = 2 * RUNNER.width
    naction = 1
    training = Training(steps=300_000, n_steps=64, batch_size=1024, n_epochs=10, learning_rate=1e-3, log_std_init=-2.0)
    config: RunnerConfig

    def build(self) -> mujoco.MjSpec:
        """The runner on its carriage, its rate commanded."""
        return build_wheel(RUNNER, 0.0, gain=GAIN, torque_limit=TORQUE)

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Put the wheel at rest on the sand, at any angle; nothing is commanded."""
        qpos[2] = rng.uniform(0.0, 2.0 * np.pi)
        return np.empty(0)

    def controls(self, action: Array, moment: Moment) -> Array:
        """Rate of the drive [rad/s] and no push [N], (n, 2)."""
        return np.hstack([ROLL + SWAY * action, np.zeros_like(action)])

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 7)."""
        angle, (vx, vz, rate) = 4.0 * moment.qpos[:, 2], moment.qvel.T
        height = moment.qpos[:, 1] - self.ground_below(moment)
        columns = np.sin(angle), np.cos(angle), rate / 15.0, vx / UNIT, vz / UNIT, 10.0 * height
        return np.column_stack([*columns, moment.action])

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for speed and for the drive's power, (n,) each."""
        return running(self.speed(moment), moment.power, UNIT, self.weight, self.config.energy)

    def open_loops(self) -> dict[str, Drive]:
        """Constant rates of the drive, from 1 to 15 rad/s."""
        return {f"{rate:g} rad/s": constant((rate - ROLL) / SWAY) for rate in range(1, 16)}

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Speed along x [m/s], rate [rad/s] and slip [-], (n,) each."""
        speed, rate = self.speed(moment), moment.qvel[:, 2]
        slip = 1.0 - speed / np.maximum(RUNNER.outer_radius * rate, 1e-3)
        return {"speed": speed, "rate": rate, "slip": slip}


def running(speed: Array, power: Array, unit: float, weight: float, energy: float) -> dict[str, Array]:
    """Terms for running fast at a steady draw, both without dimensions, (n,) each."""
    return {"speed": speed / unit, "power": -energy * (power / (weight * unit)) ** 2}
