"""What a task is: a robot, what it is told and asked, and what that is worth; for n simulations side by side."""

import abc
import dataclasses
import math
from typing import Any, ClassVar, Literal, NamedTuple, get_args, get_origin, get_type_hints

import mujoco
import numpy as np

from rftsim.errors import RftsimError
from rftsim.sand.presets import make_sand
from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Drive, Training


class ConfigError(RftsimError, ValueError):
    """A setting of an environment that cannot be."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Settings that all environments share; each environment adds its own and changes defaults.

    Attributes:
        ground: `sand`, or `rigid`: a floor with friction in its place.
        sand: The medium: a preset, key=value,... or a TOML file.
        law: The force law.
        strength: Range of the factor of the sand's strength (xi_n and zeta), drawn for each episode, log-uniform.
        friction: Range of the factor of the friction: mu_surf of the sand, or that of the rigid floor.
        slope_deg: Largest slope of the ground [deg], drawn uniformly for each episode, in any direction that the robot
            can move in. The ground stays z = 0 and gravity leans.
        observe_ground: Let the observation end with the ground's draw: log of both factors, and the sines of the slope
            along x and y. Otherwise it is hidden.
        timestep: Of the physics [s].
        period: Of control [s]; a multiple of the timestep.
        duration: Of an episode, after which it is truncated [s].
    """

    ground: Literal["sand", "rigid"] = "sand"
    sand: str = "poppy-seeds"
    law: str = "rft3d"
    strength: tuple[float, float] = (1.0, 1.0)
    friction: tuple[float, float] = (1.0, 1.0)
    slope_deg: float = 0.0
    observe_ground: bool = False
    timestep: float = 0.005
    period: float = 0.02
    duration: float = 10.0

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(type(self)).items():
            object.__setattr__(self, name, _checked(name, kind, getattr(self, name)))
        for name in ("strength", "friction"):
            low, high = getattr(self, name)
            if not 0.0 < low <= high:
                raise ConfigError(f"{name} must be a range of positive factors, low to high, not {(low, high)}")
        for name in ("timestep", "period", "duration"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, not {getattr(self, name):g}")
        if not 0.0 <= self.slope_deg < 45.0:
            raise ConfigError(f"slope_deg must be at least 0 and below 45, not {self.slope_deg:g}")
        if not math.isclose(self.substeps * self.timestep, self.period, rel_tol=1e-9) or self.substeps < 1:
            raise ConfigError(f"period = {self.period:g} s must be a multiple of timestep = {self.timestep:g} s")
        make_sand(self.sand)

    @property
    def substeps(self) -> int:
        """Time steps in a control step."""
        return round(self.period / self.timestep)

    @property
    def steps(self) -> int:
        """Control steps in an episode."""
        return max(round(self.duration / self.period), 1)


def _checked(name: str, kind: Any, value: Any) -> Any:
    """A setting as the type it must have; numbers may come as text, as from a command line."""
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            raise ConfigError(f"{name} must be {' or '.join(map(repr, get_args(kind)))}, not {value!r}")
        return value
    try:
        if get_origin(kind) is tuple:
            parts = value.split(",") if isinstance(value, str) else list(value)
            if len(parts) != len(get_args(kind)):
                raise ValueError
            return tuple(_number(part) for part in parts)
        if kind is float:
            return _number(value)
        if kind is bool and str(value).lower() in ("true", "false"):
            return str(value).lower() == "true"
        if kind is str and isinstance(value, str):
            return value
    except (TypeError, ValueError):
        pass  # said below
    wanted = {float: "a finite number", bool: "true or false", str: "text"}.get(kind, "numbers: low,high")
    raise ConfigError(f"{name} must be {wanted}, not {value!r}")


def _number(value: Any) -> float:
    number = float(value)
    if isinstance(value, bool) or not math.isfinite(number):
        raise ValueError
    return number


class Moment(NamedTuple):
    """The end of a control step, of n simulations."""

    before: Array
    """qpos at the step's start; at an episode's start, qpos. (n, nq)."""
    qpos: Array
    """(n, nq)."""
    qvel: Array
    """(n, nv)."""
    sensors: Array
    """Sensor values at the start of the last time step, (n, nsensordata)."""
    gravity: Array
    """Unit vector downward, (n, 3)."""
    command: Array
    """(n, ncommand)."""
    action: Array
    """The action taken, within -1 and 1; zero at an episode's start. (n, naction)."""
    last: Array
    """The one before."""
    power: Array
    """Positive power of the actuators, mean over the step [W], (n,)."""
    period: float
    """Of control [s]."""


class Task(abc.ABC):
    """A robot on a ground, and what is asked of it.

    A task holds no state of an episode: its methods take `Moment`s of n simulations and return arrays (n, ...).

    Attributes:
        Settings: Its Config.
        felt: Bodies that feel the sand; None for all that can.
        planar: Whether the robot moves in the x-z plane.
        edge: Longest edge of a felt triangle [m]; None for `add_sand`'s.
        ncommand: Numbers in a command.
        weight: Of the robot, once it is prepared [N].
        training: How a policy is trained.
    """

    Settings: ClassVar[type[Config]] = Config
    felt: ClassVar[tuple[str, ...] | None] = None
    planar: ClassVar[bool] = False
    edge: ClassVar[float | None] = None
    ncommand: ClassVar[int] = 0
    training: ClassVar[Training] = Training()

    def __init__(self, config: Config) -> None:
        self.config = config

    def options(self) -> dict[str, Any]:
        """More options of `add_sand`."""
        return {}

    @abc.abstractmethod
    def build(self) -> mujoco.MjSpec:
        """The robot without ground, whose first keyframe is where an episode starts."""

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up in the compiled model what the methods below need."""
        self.weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))

    @property
    @abc.abstractmethod
    def naction(self) -> int:
        """Numbers in an action."""

    @abc.abstractmethod
    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Vary the start of one episode, in place: (nq,), (nv,). Returns its command, (ncommand,)."""

    @abc.abstractmethod
    def controls(self, action: Array, moment: Moment) -> Array:
        """The actuators' controls for an action within -1 and 1, (n, nu)."""

    @abc.abstractmethod
    def observe(self, moment: Moment) -> Array:
        """What a policy sees, (n, nobservation)."""

    @abc.abstractmethod
    def rewards(self, moment: Moment) -> dict[str, Array]:
        """The reward's terms, (n,) each, per second."""

    def failed(self, moment: Moment) -> Flags:
        """Where the episode ends early, (n,)."""
        return np.zeros(len(moment.qpos), dtype=bool)

    def reached(self, moment: Moment) -> Flags:
        """Where it ends early in success, (n,)."""
        return np.zeros(len(moment.qpos), dtype=bool)

    @abc.abstractmethod
    def measures(self, moment: Moment) -> dict[str, Array]:
        """Physical quantities for `info`, (n,) each, with units in the docstring of the task; `speed` [m/s] is one."""

    def speed(self, moment: Moment) -> Array:
        """Mean speed along x over the step [m/s], (n,)."""
        return (moment.qpos[:, 0] - moment.before[:, 0]) / moment.period

    def open_loops(self) -> dict[str, Drive]:
        """Controllers that see nothing, by name: the best of them is what a policy has to beat."""
        return {}


def make_config(task: type[Task], settings: dict[str, Any]) -> Config:
    """A task's configuration.

    Raises:
        ConfigError: There is no such setting, or its value cannot be.
    """
    known = [field.name for field in dataclasses.fields(task.Settings)]
    for name in settings:
        if name not in known:
            raise ConfigError(f"{task.__name__} has no setting {name!r}; it has {', '.join(known)}")
    return task.Settings(**settings)


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors along the last axis; NumPy's takes five times as long on few."""
    ax, ay, az, bx, by, bz = *(a[..., k] for k in range(3)), *(b[..., k] for k in range(3))
    x = ay * bz - az * by
    result: Array = np.empty((*x.shape, 3))
    result[..., 0], result[..., 1], result[..., 2] = x, az * bx - ax * bz, ax * by - ay * bx
    return result


def to_body(quaternion: Array, vector: Array) -> Array:
    """A world vector in the axes of a body with orientation wxyz: (n, 4), (n, 3) to (n, 3)."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]
    turned = 2.0 * cross(axis, vector)
    result: Array = vector + w * turned + cross(axis, turned)
    return result


def yaw_of(quaternion: Array) -> Array:
    """Heading of a body with orientation wxyz: angle of its x axis about z [rad], (n,)."""
    w, x, y, z = quaternion.T
    angle: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return angle
