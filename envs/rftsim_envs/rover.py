"""`rftsim/Rover-v0`: a six-wheeled rover drives to a goal over level and tilted sand and dunes, without digging in."""

import dataclasses
from typing import Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.rover import ROVER, WHEELS, build_rover

from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Training
from rftsim_envs.task import Config, ConfigError, Moment, Task, to_body, yaw_of

RADIUS: Final = ROVER.wheel.outer_radius
"""Outer radius of the wheels [m]."""
TOP_SPEED: Final = ROVER.rate * RADIUS
"""Largest speed of the rims [m/s], in which observation and reward count speeds."""
DOWN: Final = np.array([0.0, 0.0, -1.0])
"""Direction into the ground, whatever its slope, (3,)."""
SIDES: Final = np.array([1 if "left" in wheel else -1 for wheel in WHEELS])
"""Side of each wheel, 1 on the left and -1 on the right, (6,)."""
CREEP: Final = 0.05
"""Speed at which slip counts as digging by half [m/s]."""
ARRIVED: Final = 0.2
"""Distance to the goal within which it is reached [m]."""
TIPPED: Final = 0.5
"""Cosine of the torso's lean from the ground's normal below which it has tipped over."""
BURIED: Final = 0.2
"""Height of a hub above the ground, over its wheel's outer radius, below which the wheel is dug in."""
LET_GO: Final = 0.25
"""The same, at which the drives have let go of the wheels where they are guarded."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RoverConfig(Config):
    """Settings of the rover, beside those of all environments.

    Attributes:
        distance: Range of the goal's distance, drawn for each episode [m].
        sector_deg: Largest angle between the goal and straight ahead at the start [deg].
        arrival: Reward for reaching the goal.
        failure: Price of digging in or tipping over: a rover that is lost is worth less than one that waits.
        guard: Height of the deepest hub above the ground, over its wheel's outer radius, from which the drives slow
            down in proportion, until they stand still at LET_GO: a rover whose wheels have sunk waits to be told
            another way, and does not bury itself. At LET_GO or less there is no guard.
        digging: Weight of the digging in the reward.
        energy: Weight of the power in the reward.
    """

    sand: str = "medium-sand"
    slope_deg: float = 10.0
    amplitude: float = 0.035
    wavelength: float = 2.0
    period: float = 0.05
    duration: float = 20.0
    distance: tuple[float, float] = (1.0, 3.0)
    sector_deg: float = 60.0
    arrival: float = 5.0
    failure: float = 5.0
    guard: float = 0.4
    digging: float = 0.5
    energy: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not ARRIVED < self.distance[0] <= self.distance[1]:
            raise ConfigError(f"distance must be a range above {ARRIVED} m, low to high, not {self.distance}")
        if not 0.0 <= self.sector_deg <= 180.0:
            raise ConfigError(f"sector_deg must be between 0 and 180, not {self.sector_deg:g}")


class Rover(Task):
    """A rover of Sojourner's size (11.2 kg, six grousered wheels on rockers and bogies), steered by skidding.

    Action, 2 numbers: rates of the left and of the right wheels, -1 to 1 for -6 to 6 rad/s. The wheels of a side share
    one, as in all skid steering: what they could do against each other would only dig. All slow down where one has sunk
    (`guard`).

    | observation | size | unit |
    |---|---|---|
    | distance to the goal | 1 | m |
    | sine and cosine of the goal's bearing | 2 | - |
    | gravity, in the torso's axes | 3 | g |
    | linear velocity, in the torso's axes | 3 | top speed of the rims, 0.408 m/s |
    | angular velocity, in the torso's axes | 3 | rad/s |
    | rates of the wheels | 6 | 6 rad/s |
    | slip speeds of the wheels | 6 | 0.408 m/s |
    | sinkages of the wheels | 6 | outer radius |
    | last action | 2 | - |

    Wheels are in the order of `rftsim_models.rover.WHEELS`. The slip speed of one is that of its rim less that of its
    side of the torso, and its sinkage its outer radius less the height of its hub above the ground: how far a wheel
    sinks at rest tells whether the sand carries it, before it turns.
    Reward: arrival or - failure, once; and per second: progress to the goal / 0.408 m/s - energy P / (m g 0.408 m/s)
    - digging d, P the drives' positive power, a mean over the control step, and d the wheels' mean slip speed over
    0.408 m/s, times 1 / (1 + (v / 0.05 m/s)^2) for the torso's speed v.
    The episode ends in success 0.2 m from the goal, and in failure where the torso leans 60 deg from the ground's
    normal, or a hub is less than a fifth of its wheel's radius above the ground.

    `info`: `speed`, over the ground [m/s], `distance` to the goal [m], `slip`, mean over the wheels of what rim and
    torso differ in, over the faster, `sinkage` of the deepest wheel [m], and what
    all tasks tell.
    """

    Settings = RoverConfig
    felt = (parts.TORSO, *WHEELS)
    length = 2.0 * (ROVER.spacing + RADIUS)
    edge = parts.AS_MESHED
    ncommand = 2
    naction = 2
    training = Training(
        steps=300_000, n_envs=32, n_steps=64, batch_size=256, n_epochs=10, learning_rate=5e-4, log_std_init=-0.7
    )
    config: RoverConfig

    def build(self) -> mujoco.MjSpec:
        """The rover, with sensors of where its hubs are."""
        spec = build_rover()
        for wheel in WHEELS:
            place, body = mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_XBODY
            spec.add_sensor(name=f"{wheel}_hub", type=place, objtype=body, objname=wheel)
        return spec

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up the robot's weight, its wheels' rates and its hubs' places in the compiled model."""
        super().prepare(model)
        self._rates = [model.joint(wheel).dofadr[0] for wheel in WHEELS]
        self._hubs = [model.sensor(f"{wheel}_hub").adr[0] + np.arange(3) for wheel in WHEELS]

    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Leave the rover at rest on the ground; the command is the goal's place along x and y [m]."""
        sector = np.deg2rad(self.config.sector_deg)
        distance, bearing = rng.uniform(*self.config.distance), rng.uniform(-sector, sector)
        return np.array([distance * np.cos(bearing), distance * np.sin(bearing)])

    def controls(self, action: Array, moment: Moment) -> Array:
        """Rates of the wheels [rad/s], (n, 6): those of a side share one, and all slow down where one has sunk."""
        asked: Array = ROVER.rate * np.where(SIDES > 0, action[:, :1], action[:, 1:])
        room = self.config.guard - LET_GO
        if room <= 0.0:
            return asked
        height = self._hub_heights(moment).min(axis=1) / RADIUS
        asked *= np.clip((height - LET_GO) / room, 0.0, 1.0)[:, None]
        return asked

    def observe(self, moment: Moment) -> Array:
        """The observation of the class's table, (n, 32)."""
        turn, away = moment.qpos[:, 3:7], moment.command - moment.qpos[:, :2]
        bearing = np.arctan2(away[:, 1], away[:, 0]) - yaw_of(turn)
        velocity, rates = to_body(turn, moment.qvel[:, :3]), moment.qvel[:, self._rates]
        return np.column_stack(
            [
                length(away),
                np.sin(bearing),
                np.cos(bearing),
                to_body(turn, moment.gravity),
                velocity / TOP_SPEED,
                moment.qvel[:, 3:6],
                rates / ROVER.rate,
                (RADIUS * rates - self._passing(moment)) / TOP_SPEED,
                1.0 - self._hub_heights(moment) / RADIUS,
                moment.action,
            ]
        )

    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms for progress, arrival, power and digging, (n,) each."""
        c, speed = self.config, self.speed(moment)
        slip_speed = RADIUS * moment.qvel[:, self._rates] - self._passing(moment)
        return {
            "progress": progress(moment.before[:, :2], moment.qpos[:, :2], moment.command) / moment.period / TOP_SPEED,
            "arrival": np.where(self.reached(moment), c.arrival / moment.period, 0.0),
            "failure": np.where(self.failed(moment), -c.failure / moment.period, 0.0),
            "power": -c.energy * moment.power / (self.weight * TOP_SPEED),
            "digging": -c.digging * digging(slip_speed, speed) / TOP_SPEED,
        }

    def failed(self, moment: Moment) -> Flags:
        """Whether the torso has tipped over or a wheel is dug in, (n,)."""
        upright = -to_body(moment.qpos[:, 3:7], np.broadcast_to(DOWN, (len(moment.qpos), 3)))[:, 2]
        buried: Flags = self._hub_heights(moment).min(axis=1) < BURIED * RADIUS
        return (upright < TIPPED) | buried

    def reached(self, moment: Moment) -> Flags:
        """Whether the torso is within ARRIVED of the goal, (n,)."""
        arrived: Flags = self._distance(moment) < ARRIVED
        return arrived

    def measures(self, moment: Moment) -> dict[str, Array]:
        """Speed [m/s], distance to the goal [m], slip [-] and sinkage [m], (n,) each."""
        rim, passing = RADIUS * moment.qvel[:, self._rates], self._passing(moment)
        faster = np.maximum(np.maximum(np.abs(rim), np.abs(passing)), 1e-3)
        slip: Array = ((rim - passing) / faster).mean(axis=1)
        return {
            "speed": self.speed(moment),
            "distance": self._distance(moment),
            "slip": slip,
            "sinkage": RADIUS - self._hub_heights(moment).min(axis=1),
        }

    def speed(self, moment: Moment) -> Array:
        """Mean speed over the ground [m/s], (n,)."""
        return length(moment.qpos[:, :2] - moment.before[:, :2]) / moment.period

    def _distance(self, moment: Moment) -> Array:
        return length(moment.command - moment.qpos[:, :2])

    def _hub_heights(self, moment: Moment) -> Array:
        """Heights of the hubs above the ground [m], (n, 6)."""
        x, y, z = np.moveaxis(moment.sensors[:, self._hubs], 2, 0)
        height: Array = z - moment.relief.height(x, y)
        return height

    def _passing(self, moment: Moment) -> Array:
        """Forward speed of the torso beside each wheel [m/s], (n, 6)."""
        forward = to_body(moment.qpos[:, 3:7], moment.qvel[:, :3])[:, :1]
        return forward - 0.5 * ROVER.track * SIDES * moment.qvel[:, 5:6]


def progress(before: Array, after: Array, goal: Array) -> Array:
    """How much nearer to the goal a step has led [m], (n,), from places (n, 2)."""
    return length(goal - before) - length(goal - after)


def length(vector: Array) -> Array:
    """Lengths of vectors (n, 2) in the plane, (n,)."""
    value: Array = np.hypot(vector[:, 0], vector[:, 1])
    return value


def digging(slip_speed: Array, speed: Array) -> Array:
    """Mean slip speed of the wheels [m/s], (n,), which counts the less the faster the rover moves."""
    mean: Array = np.abs(slip_speed).mean(axis=1)
    return mean / (1.0 + (speed / CREEP) ** 2)
