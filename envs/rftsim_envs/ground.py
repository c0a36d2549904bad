"""The ground under a robot: sand, whose strength, friction and slope may differ in each episode, or a rigid floor."""

import math
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.law import layout
from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.model.readout import instances
from rftsim_envs.physics import Physics
from rftsim_envs.relief import LEVEL, Relief
from rftsim_envs.task import Config, Task

FRICTION: Final = 0.8
"""Friction coefficient of the rigid floor [-]."""
FLOOR: Final = "floor"
"""Name of the rigid floor's geom, texture and material."""
NUMBERS: Final = 4
"""Number of numbers that tell of a ground."""


class Draw(NamedTuple):
    """The ground of one episode, as factors of the configured one."""

    strength: float
    """Factor of the sand's strength, xi_n and zeta."""
    friction: float
    """Factor of the friction, mu_surf or the floor's."""
    downhill: tuple[float, float]
    """Sines of the slope along x and y."""


def lay(task: Task) -> mujoco.MjModel:
    """The model of a task's robot on the task's ground."""
    config, spec = task.config, task.build()
    spec.option.timestep = config.timestep
    if config.ground == "sand":
        options = {"bodies": task.felt, "max_edge": task.edge, **WHOLE, "ruts": config.ruts, **task.options()}
        if task.dunes is not None:
            options["terrain"] = task.dunes
        solution = {"tolerance": config.tolerance, "iterations": config.iterations}
        add_sand(spec, config.sand, config.law, **{**solution, **options})
    else:
        _add_floor(spec)
    return spec.compile()


def _add_floor(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name=FLOOR,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        width=256,
        height=256,
        rgb1=[0.45, 0.48, 0.52],
        rgb2=[0.52, 0.55, 0.60],
    )
    bits = np.array([(geom.contype, geom.conaffinity) for geom in spec.geoms])
    contype, conaffinity = np.bitwise_or.reduce(bits, axis=0).tolist()
    material = spec.add_material(name=FLOOR, texrepeat=[4, 4], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR
    spec.worldbody.add_geom(
        name=FLOOR,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        contype=conaffinity,  # whatever of the robot collides at all, collides with the floor
        conaffinity=contype,
        friction=[FRICTION, 0.005, 0.0001],
        priority=1,  # the floor's friction counts, whatever the robot's
        material=FLOOR,
    )


def draw(config: Config, planar: bool, rng: np.random.Generator) -> Draw:
    """Draw a ground for one episode; its slope is along x if the task is planar."""
    strength, friction = (math.exp(rng.uniform(*np.log(pair))) for pair in (config.strength, config.friction))
    slope, way = math.radians(rng.uniform(0.0, config.slope_deg)), rng.uniform(0.0, 2.0 * math.pi)
    if planar:
        return Draw(strength, friction, (math.sin(slope) * (1.0 if way < math.pi else -1.0), 0.0))
    return Draw(strength, friction, (math.sin(slope) * math.cos(way), math.sin(slope) * math.sin(way)))


class Ground:
    """The grounds of several simulations, which may differ.

    Attributes:
        draws: Numbers that tell of each ground, (n, NUMBERS): log of strength and friction, sines of the slope along x
            and y.
        gravity: Unit vectors downward, (n, 3).
        relief: Heights of the ground.
    """

    def __init__(self, physics: Physics, config: Config) -> None:
        model, self._rigid = physics.model, config.ground == "rigid"
        self._pull = float(np.linalg.norm(model.opt.gravity))
        self._gravity = physics.setting("opt.gravity")
        self.gravity = np.tile([0.0, 0.0, -1.0], (physics.n, 1))
        self.draws, self.relief = np.zeros((physics.n, NUMBERS)), LEVEL
        if self._rigid:
            self._sliding = physics.setting("geom_friction")[:, model.geom(FLOOR).id]
            self._before = self._sliding[0].copy()
        else:
            bed, numbers = instances(model)[0], physics.setting("numeric_data")
            self._beds = bed.beds_in(numbers)
            self._before = self._beds[0].copy()
            if bed.relief is not None:
                start = (bed.relief.ctypes.data - model.numeric_data.ctypes.data) // bed.relief.itemsize
                heads = numbers[:, start : start + layout.TERRAIN_NUMBERS].view(layout.TERRAIN)[:, 0]
                self.relief = Relief(bed.relief, heads)

    def put(self, i: int, drawn: Draw) -> None:
        """Give simulation i the ground of an episode."""
        if self._rigid:
            self._sliding[i, 0] = drawn.friction * self._before[0]
        else:
            for name in ("xi_n", "zeta"):
                self._beds[name][i] = drawn.strength * self._before[name]
            self._beds["mu_surf"][i] = drawn.friction * self._before["mu_surf"]
        x, y = drawn.downhill
        self.gravity[i] = x, y, -math.sqrt(1.0 - x * x - y * y)
        self._gravity[i] = self._pull * self.gravity[i]
        self.draws[i] = math.log(drawn.strength), math.log(drawn.friction), x, y
