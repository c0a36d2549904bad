"""Tasks: a robot, what it is told and asked, and what that is worth, for n simulations side by side."""

import abc
import dataclasses
import math
from typing import Any, ClassVar, Final, Literal, NamedTuple

import mujoco
import numpy as np

from rftsim.errors import RftsimError
from rftsim.law import layout
from rftsim.model.solution import check_solution
from rftsim.sand.presets import make_sand
from rftsim.sand.terrain import Terrain
from rftsim_envs.physics import Array, Flags
from rftsim_envs.recipe import Drive, Training
from rftsim_envs.relief import LEVEL, Relief, make_dunes
from rftsim_envs.settings import check_positive, convert_fields

MOST_SUBSTEPS, MOST_STEPS = 1e6, 1e9
"""Most time steps of a control step, and most control steps of an episode."""
MOST_HISTORY: Final = 100
"""Most control steps whose observations make up one."""
MOST_PLACES: Final = 1000
"""Most places along the heading at which the ground is scanned."""


class ConfigError(RftsimError, ValueError):
    """A setting of an environment that cannot be."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Settings that all environments share; each environment adds its own and changes defaults.

    Attributes:
        ground: `sand`, or `rigid`: a floor with friction in its place.
        sand: The medium: a preset, key=value,... or a TOML file.
        law: The force law.
        tolerance: Error of a body's velocity, relative, to which the sand's implicit force is solved for, 1e-6 to 0.1.
        iterations: Most iterations of one such solution, 1 to 60.
        strength: Range of the factor of the sand's strength (xi_n and zeta), drawn for each episode, log-uniform.
        friction: Range of the factor of the friction: mu_surf of the sand, or that of the rigid floor.
        slope_deg: Largest slope of the ground [deg], drawn uniformly for each episode, in any direction that the robot
            can move in. The ground stays as it is and gravity leans: all of the ground at once, for ever, which costs
            nothing, leaves level ground level, where the laws are calibrated, and has a steady state. Slopes that the
            robot climbs and leaves are those of dunes, and are true ones; both can be had together.
        terrain: `level`, or `dunes`: a field of them, of which each episode draws the place where it starts. Those of a
            planar robot vary along x alone. Heights are then those above the ground below.
        amplitude: Root mean square of the dunes' heights [m]; of 0 the ground is level.
        wavelength: Dominant wavelength of the dunes [m].
        ruts: Sand that remembers where the robot has passed, until the episode ends, see `rftsim.add_sand`.
        scan: Number of places along the heading at which the observation tells the ground's height, zero or at least 2:
            from half a robot's length behind its root to a length and a half ahead; of a robot that can turn along
            three lines, half a length to the left, amid and to the right, one after the other. The heights are those of
            the ground without ruts over the root, in lengths of the robot: `length` of the task.
        observe_ground: Let the observation end with the ground's draw: log of both factors, and the sines of the slope
            along x and y. Otherwise it is hidden.
        history: Number of control steps, the present one and those before it, whose observations make up one, the
            latest at its end: from what was done and what came of it, a policy can tell which sand it is on.
        timestep: Time step of the physics [s].
        period: Duration of a control step [s]; a multiple of the timestep.
        duration: Duration of an episode, after which it is truncated [s].
    """

    ground: Literal["sand", "rigid"] = "sand"
    sand: str = "poppy-seeds"
    law: str = "rft3d"
    tolerance: float = 0.03
    iterations: int = layout.ITERATIONS
    strength: tuple[float, float] = (1.0, 1.0)
    friction: tuple[float, float] = (1.0, 1.0)
    slope_deg: float = 0.0
    terrain: Literal["level", "dunes"] = "level"
    amplitude: float = 0.015
    wavelength: float = 1.0
    ruts: bool = False
    scan: int = 0
    observe_ground: bool = False
    history: int = 1
    timestep: float = 0.005
    period: float = 0.02
    duration: float = 10.0

    def __post_init__(self) -> None:
        convert_fields(self, ConfigError)
        for name in ("strength", "friction"):
            low, high = getattr(self, name)
            if not 0.0 < low <= high:
                raise ConfigError(f"{name} must be a range of positive factors, low to high, not {(low, high)}")
        check_positive(self, ("timestep", "period", "duration"), ConfigError)
        if self.period > MOST_SUBSTEPS * self.timestep or self.duration > MOST_STEPS * self.period:
            raise ConfigError(
                f"a period has at most {MOST_SUBSTEPS:g} timesteps, and a duration {MOST_STEPS:g} periods, not "
                f"{self.timestep:g}, {self.period:g} and {self.duration:g} s"
            )
        if not 0.0 <= self.slope_deg < 45.0:
            raise ConfigError(f"slope_deg must be at least 0 and below 45, not {self.slope_deg:g}")
        if not math.isclose(self.substeps * self.timestep, self.period, rel_tol=1e-9) or self.substeps < 1:
            raise ConfigError(f"period = {self.period:g} s must be a multiple of timestep = {self.timestep:g} s")
        if not 1 <= self.history <= MOST_HISTORY:
            raise ConfigError(f"history must be from 1 to {MOST_HISTORY} control steps, not {self.history}")
        check_solution(self.tolerance, self.iterations, ConfigError)
        make_sand(self.sand)
        self._check_terrain()

    def _check_terrain(self) -> None:
        """Refuse lengths and numbers of places that cannot be, and marks in a ground that keeps none."""
        if not self.amplitude >= 0.0:
            raise ConfigError(f"amplitude must be at least 0 m, not {self.amplitude:g}")
        check_positive(self, ("wavelength",), ConfigError)
        if self.scan != 0 and not 2 <= self.scan <= MOST_PLACES:
            raise ConfigError(f"scan must be 0 or from 2 to {MOST_PLACES} places, not {self.scan}")
        if self.ground == "rigid" and (self.ruts or self.has_dunes):
            raise ConfigError("a rigid ground is level and keeps no ruts: take ground='sand'")

    @property
    def has_dunes(self) -> bool:
        """Whether the ground has the relief of dunes."""
        return self.terrain == "dunes" and self.amplitude > 0.0

    @property
    def substeps(self) -> int:
        """Number of time steps in a control step."""
        return round(self.period / self.timestep)

    @property
    def steps(self) -> int:
        """Number of control steps in an episode, at least 1."""
        return max(round(self.duration / self.period), 1)


class Moment(NamedTuple):
    """The end of a control step, of n simulations."""

    before: Array
    """Positions at the step's start, and at an episode's start those of now, (n, nq)."""
    qpos: Array
    """Positions, (n, nq)."""
    qvel: Array
    """Velocities, (n, nv)."""
    sensors: Array
    """Values of the sensors at the start of the last time step, (n, nsensordata)."""
    gravity: Array
    """Unit vector downward, (n, 3)."""
    command: Array
    """Numbers that tell what is asked in this episode, (n, ncommand)."""
    action: Array
    """Action that was taken, within -1 and 1, and zero at an episode's start, (n, naction)."""
    last: Array
    """Action of the control step before, (n, naction)."""
    power: Array
    """Mean positive power of the actuators over the step [W], (n,)."""
    period: float
    """Duration of the control step [s]."""
    relief: Relief = LEVEL
    """Heights of the ground under each simulation."""


class Task(abc.ABC):
    """A robot on a ground, and what is asked of it.

    A task holds no state of an episode: its methods take a `Moment` of n simulations and return arrays (n, ...).

    One of one's own inherits this class, states `length` and `naction`, and has the methods below that are abstract.
    Where it has settings of its own, `Settings` is a frozen dataclass that inherits `Config`, with keywords alone. It
    serves wherever a task's name does, as the class or as FILE.py:CLASS.

    Attributes:
        Settings: Class of its configuration.
        felt: Bodies that feel the sand; None for all that can.
        planar: Whether the robot moves in the x-z plane, on joints that slide along x and z; else its joint is free.
        length: Length of the robot along its heading [m].
        edge: Longest edge of a felt triangle [m]; None for the one that `add_sand` chooses.
        ncommand: Number of numbers in a command.
        config: Its configuration.
        dunes: The field of dunes that it runs on; None on level ground.
        weight: Weight of the robot, once the task is prepared [N].
        training: Settings by which a policy is trained.
    """

    Settings: ClassVar[type[Config]] = Config
    felt: tuple[str, ...] | None = None
    planar: ClassVar[bool] = False
    length: float
    edge: ClassVar[float | None] = None
    ncommand: ClassVar[int] = 0
    training: ClassVar[Training] = Training()

    def __init__(self, config: Config) -> None:
        self.config = config
        self.dunes = _dunes(config, self.planar) if config.has_dunes else None

    def options(self) -> dict[str, Any]:
        """Options of `add_sand` beyond those that the configuration and this class state."""
        return {}

    @abc.abstractmethod
    def build(self) -> mujoco.MjSpec:
        """The robot without ground; its first keyframe is where an episode starts."""

    def prepare(self, model: mujoco.MjModel) -> None:
        """Look up in the compiled model what the methods below need."""
        self.weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
        data = mujoco.MjData(model)
        data.qpos[:] = 0.0
        mujoco.mj_kinematics(model, data)
        self._raised = float(data.xpos[model.jnt_bodyid[1], 2]) if self.planar else 0.0

    @property
    @abc.abstractmethod
    def naction(self) -> int:
        """Number of numbers in an action of one simulation."""

    @abc.abstractmethod
    def start(self, rng: np.random.Generator, qpos: Array, qvel: Array) -> Array:
        """Vary the start of one episode, (nq,) and (nv,), in place, and return its command, (ncommand,)."""

    @abc.abstractmethod
    def controls(self, action: Array, moment: Moment) -> Array:
        """The actuators' controls for an action within -1 and 1, (n, nu)."""

    @abc.abstractmethod
    def observe(self, moment: Moment) -> Array:
        """Observation that a policy gets, without the ground's draw, (n, nobservation)."""

    @abc.abstractmethod
    def rewards(self, moment: Moment) -> dict[str, Array]:
        """Terms of the reward by name, (n,) each; their sum is the reward per second."""

    def failed(self, moment: Moment) -> Flags:
        """Whether the episode ends early in failure, (n,); never unless a task says so."""
        return np.zeros(len(moment.qpos), dtype=bool)

    def reached(self, moment: Moment) -> Flags:
        """Whether the episode ends early in success, (n,); never unless a task says so."""
        return np.zeros(len(moment.qpos), dtype=bool)

    @abc.abstractmethod
    def measures(self, moment: Moment) -> dict[str, Array]:
        """Physical quantities for `info`, (n,) each, with units in the docstring of the task; `speed` [m/s] is one."""

    def speed(self, moment: Moment) -> Array:
        """Mean speed along x over the step [m/s], (n,)."""
        return (moment.qpos[:, 0] - moment.before[:, 0]) / moment.period

    def root(self, qpos: Array) -> Array:
        """Place of the robot's root [m], (n, 3), at positions (n, nq)."""
        if not self.planar:
            return qpos[:, :3]
        return np.column_stack([qpos[:, 0], np.zeros(len(qpos)), qpos[:, 1] + self._raised])

    def heading(self, qpos: Array) -> Array:
        """Angle of the robot's heading from x towards y [rad], (n,), at positions (n, nq)."""
        return np.zeros(len(qpos)) if self.planar else yaw_of(qpos[:, 3:7])

    def ground_below(self, moment: Moment) -> Array:
        """Height of the ground below the root [m], (n,)."""
        return moment.relief.height(*self.root(moment.qpos)[:, :2].T)

    def lean(self, qpos: Array, slope: Array) -> None:
        """Lean the start of an episode, (nq,), in place with a ground that rises by slope along x and y [-], (2,).

        A robot that is free leans as the ground does; one that is planar keeps its pose.
        """
        if not self.planar:
            up = np.array([-slope[0], -slope[1], 1.0]) / math.sqrt(1.0 + float(slope @ slope))
            turn = np.array([1.0 + up[2], -up[1], up[0], 0.0])
            mujoco.mju_mulQuat(qpos[3:7], turn / np.linalg.norm(turn), qpos[3:7].copy())

    def open_loops(self) -> dict[str, Drive]:
        """Controllers that see nothing, by name: the best of them is what a policy has to beat."""
        return {}


def make_config(task: type[Task], settings: dict[str, Any]) -> Config:
    """The configuration of a task, with these settings in place of its own.

    Raises:
        ConfigError: There is no such setting, or its value cannot be.
    """
    known = [field.name for field in dataclasses.fields(task.Settings)]
    for name in settings:
        if name not in known:
            raise ConfigError(f"{task.__name__} has no setting {name!r}; it has {', '.join(known)}")
    return task.Settings(**settings)


def _dunes(config: Config, planar: bool) -> Terrain:
    """The field of dunes of a configuration.

    Raises:
        ConfigError: It is steeper than its sand can lie.
    """
    try:
        made = make_dunes(config.amplitude, config.wavelength, planar)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    most, steepest = make_sand(config.sand).repose - math.radians(config.slope_deg), made.steepest
    if steepest > most:
        more = f", and slope_deg leans them by {config.slope_deg:g} more" if config.slope_deg else ""
        limit = config.amplitude * math.tan(max(most, 0.0)) / math.tan(steepest)
        raise ConfigError(
            f"dunes of amplitude {config.amplitude:g} m and wavelength {config.wavelength:g} m are as steep as "
            f"{math.degrees(steepest):.3g} degrees{more}, beyond the sand's angle of repose of "
            f"{math.degrees(make_sand(config.sand).repose):.3g}: take an amplitude of {limit:.3g} m at most, or longer "
            "waves"
        )
    return made


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
