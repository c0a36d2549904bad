"""`rftsim/GrouserWheel-v0`: a grousered wheel follows a commanded speed, with little slip and energy."""

import dataclasses
from typing import Any, Final, Literal

import mujoco
import numpy as np
from rftsim_models.wheels import GROUSER_WHEEL, WHEEL, build_wheel

from rftsim.surface.triangles import Wheel
from rftsim_envs.physics import Array
from rftsim_envs.recipe import Training
from rftsim_envs.settings import check_positive
from rftsim_envs.task import Config, ConfigError, Moment, Task

TORQUE: Final = 5.0
"""Largest torque of the drive [N m]; three quarters of the weight times the outer radius."""
UNIT: Final = 0.5
"""Speed that observation and reward count in [m/s]."""
RADIUS: Final = GROUSER_WHEEL.outer_radius
"""Outer radius of the wheel [m]."""
WEIGHT: Final = GROUSER_WHEEL.vertical_mass * GROUSER_WHEEL.gravity
"""Weight of the wheel [N]; that of the carriage is borne by its guide."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class WheelConfig(Config):
    """Settings of the wheel, beside those of all environments.

    Attributes:
        speed: Range of the commanded speed, drawn for each episode [m/s].
        drawbar: Range of the load that pulls the carriage back, drawn for each episode [N].
        observe_drawbar: Let the observation tell of the load. Otherwise it is hidden.
        spread: Error of the speed at which its reward has fallen to 1/e [m/s].
        slip: Weight of the squared slip speed in the reward.
        energy: Weight of the power in the reward.
    """

    law: Literal["rft2d", "drft2d", "rft3d", "drft3d"] = "drft2d"
    timestep: float = 0.004
    duration: float = 6.0
    speed: tuple[float, float] = (0.1, 0.5)
    drawbar: tuple[float, float] = (0.0, 0.0)
    observe_drawbar: bool = False
    spread: float = 0.15
    slip: float = 0.5
    energy: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("speed", "drawbar"):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high:
                raise ConfigError(f"{name} must be a range from 0 up, low to high, not {(low, high)}")
        check_positive(self, ("spread",), ConfigError)


class GrouserWheel(Task):
    """The wheel of [Agarwal] Table 4.1 (6.3 kg, 20 grousers) on its carriage in the x-z plane, its torque commanded.

    The carriage's weight is compensated, and 4 N push it forward, less the drawbar load. On poppy seeds it takes a
    steady 1.5 N m to roll at 0.3 m/s, but from rest anything up to 3.5 N m only digs until the wheel stands.
    Action, 1 number: torque of the axle, -1 to 1 for -5 to 5 N m.

    | observation | size | unit |
    |---|---|---|
    | commanded speed | 1 | 0.5 m/s |
    | commanded speed less speed along x | 1 | 0.5 m/s |
    | velocity along x and z | 2 | 0.5 m/s |
    | rate times outer radius | 1 | 0.5 m/s |
    | slip speed | 1 | 0.5 m/s |
    | sinkage | 1 | outer radius, 0.106 m |
    | last action | 1 | - |
    | drawbar load, if observe_drawbar | 1 | weight of the wheel, 61.7 N |

    Reward per second: exp(-|v - commanded| / spread) - slip (s / 0.5 m/s)^2 - energy P / (m g 0.5 m/s), v the speed
    along x and P the positive power of drive and push, both means over the control step, s = R rate - v the slip speed
    and m the wheel's mass.
    The episode ends after its duration only.

    `info`: `speed`, `command` [m/s], `drawbar` [N], `rate` [rad/s], `slip` (R rate - v) / max(|R rate|, |v|), positive
    where driven, `sinkage`, outer radius less height of the axle [m], and what all tasks tell.
    """

    Settings = WheelConfig
    felt = (WHEEL,)
    planar = True
    length = 2.0 * RADIUS
    edge = 2 * GROUSER_WHEEL.width
    ncommand = 2
    naction = 1
    training = Training(
        steps=150_000, n_envs=32, n_steps=64, batch_size=1024, n_epochs=10, gamma=0.98, learning_rate=1e-3
    )
    config: WheelConfig

    def options(self) -> dict[str, Any]:
        """The wheel as one behind which the free surface drops."""
        return {"wheels": {WHEEL: Wheel((0, 1, 0), (0, 0, 0), RADIUS)}}

    def build(self) -> mujoco.MjSpec:
        """The wheel on its carriage, its torque commanded."""
        return build_wheel(GROUSER_WHEEL, 0.0, drive="torque", torque_limit=TORQUE)

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Put the wheel at rest on the ground, at any angle; command a speed [m/s] and a drawbar load [N]."""
        qpos[2] = rng.uniform(0.0, 2.0 * np.pi)
        return np.array([rng.uniform(*self.config.speed), rng.uniform(*self.config.drawbar)])

    def controls(self, action: Array, moment: Moment) -> Array:
        """Torque of the drive [N m] and push less the drawbar load [N], (n, 2)."""
        return np.column_stack([TORQUE * action, GROUSER_WHEEL.forward_force - moment.command[:, 1]])

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 8) or, with the drawbar load, (n, 9)."""
        (vx, vz, rate), (command, drawbar) = moment.qvel.T, moment.command.T
        speeds = np.column_stack([command, command - vx, vx, vz, RADIUS * rate, RADIUS * rate - vx]) / UNIT
        seen = [speeds, self._sinkage(moment)[:, None] / RADIUS, moment.action]
        return np.column_stack([*seen, drawbar / WEIGHT] if self.config.observe_drawbar else seen)

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for tracking, for slip and for the power of drive and push, (n,) each."""
        speed, c = self.speed(moment), self.config
        return {
            "tracking": tracking(speed, moment.command[:, 0], c.spread),
            "slip": -c.slip * ((RADIUS * moment.qvel[:, 2] - speed) / UNIT) ** 2,
            "power": -c.energy * moment.power / (WEIGHT * UNIT),
        }

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Speed, command [m/s], drawbar [N], rate [rad/s], slip [-] and sinkage [m], (n,) each."""
        speed, rate = self.speed(moment), moment.qvel[:, 2].copy()
        return {
            "speed": speed,
            "command": moment.command[:, 0].copy(),
            "drawbar": moment.command[:, 1].copy(),
            "rate": rate,
            "slip": slip(RADIUS * rate, speed),
            "sinkage": self._sinkage(moment),
        }

    def _sinkage(self, moment: Moment) -> Array:
        """Outer radius less the height of the axle above the ground [m], (n,)."""
        sinkage: Array = self.ground_below(moment) - moment.qpos[:, 1]
        return sinkage


def tracking(speed: Array, command: Array, spread: float) -> Array:
    """Reward that is 1 at the commanded speed and 1/e where it is missed by the spread, (n,)."""
    value: Array = np.exp(-np.abs(speed - command) / spread)
    return value


def slip(rim: Array, speed: Array) -> Array:
    """Speed of the rim less that of the hub, over the faster: within -1 and 1 where they go the same way, 0 at rest."""
    return (rim - speed) / np.maximum(np.maximum(np.abs(rim), np.abs(speed)), 1e-3)
