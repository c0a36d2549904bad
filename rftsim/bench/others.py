"""Further cases of the study of the environment: free spheres, and robots of others, where these are installed."""

import functools
import importlib.util
import math
import os
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np

from rftsim.bench.cases import FORCES, GROUNDS, WINDOW, Case, Ground, Prepared, draw_controls, hold
from rftsim.bench.quiet import quiet
from rftsim.bench.subjects import H, settle
from rftsim.bench.trials import is_lost
from rftsim.model.add_sand import Force, add_sand, read_spec

STEPS: Final = (H, 2e-3, 1e-3)
"""Time steps of a robot of others [s]; the first at which it is stable without sand is taken."""
MOVING: Final = 1.0
"""Time that a robot of others is moved for in each repetition [s]."""
SPHERES: Final = (1, 10, 100, 400)
"""Numbers of free spheres."""
APART: Final = 0.15
"""Distance between the centres of spheres of radius 50 mm [m]."""
ROBOTS: Final = "../shared/robots"
"""Folder of the robots of others, from the project's root, unless MENAGERIE_ROOT names another."""


class Robot(NamedTuple):
    """A robot of others, and the place of its file."""

    name: str
    """Its name."""
    package: str | None
    """The package that it comes with; None for the folder of robots."""
    file: str
    """Its file in there."""

    @property
    def path(self) -> Path | None:
        """Its file, if it is there."""
        if self.package is None:
            root = Path(os.environ.get("MENAGERIE_ROOT", Path(__file__).parents[2] / ROBOTS))
        else:
            spec = importlib.util.find_spec(self.package)
            root = Path(spec.submodule_search_locations[0]) if spec and spec.submodule_search_locations else Path()
        return root / self.file if (root / self.file).is_file() else None


KNOWN: Final = (
    Robot("go1", None, "unitree_go1/scene.xml"),
    Robot("cassie", None, "agility_cassie/scene.xml"),
    Robot("talos", None, "pal_talos/scene_position.xml"),
    Robot("ant", "gymnasium", "envs/mujoco/assets/ant.xml"),
    Robot("dog", "dm_control", "suite/dog.xml"),
)
"""The robots that are looked for."""


def spheres() -> list[Case]:
    """Cases of free spheres that lie in the sand, apart from one another; without sand they fall."""
    return [
        Case(
            f"spheres-{count}",
            "rft3d",
            functools.partial(_prepare_spheres, count),
            hold,
            window=WINDOW if count <= 10 else WINDOW / 4,
            batched=False,
            quick=count <= 10,
        )
        for count in SPHERES
    ]


def robots() -> tuple[list[Case], list[str]]:
    """Cases of the robots that are there, and the names and places of those that are not."""
    found = [
        Case(
            robot.name,
            "rft3d",
            functools.partial(_prepare_robot, path),
            draw_controls,
            window=MOVING,
            batched=False,
            quick=False,
        )
        for robot in KNOWN
        if (path := robot.path)
    ]
    missing = [f"{robot.name} ({robot.package or robot.file})" for robot in KNOWN if robot.path is None]
    return found, missing


def _build_spheres(count: int) -> mujoco.MjSpec:
    spec, side = mujoco.MjSpec(), math.ceil(math.sqrt(count))
    spec.option.timestep = H
    for k in range(count):
        body = spec.worldbody.add_body(name=f"sphere-{k}", pos=[APART * (k % side), APART * (k // side), 0.05])
        body.add_freejoint()
        body.add_geom(size=[0.05, 0.0, 0.0], mass=0.5)
    return spec


def _sandy_spheres(count: int, force: Force) -> mujoco.MjModel:
    spec = _build_spheres(count)
    with quiet():
        add_sand(spec, terrain=0.0, force=force)
    return spec.compile()


def _prepare_spheres(count: int) -> Prepared:
    """Spheres at the depth at which one came to rest, as it takes long to let many settle."""
    one = settle(_sandy_spheres(1, "implicit"))
    models: dict[Ground, mujoco.MjModel] = {"none": _build_spheres(count).compile()}
    models |= {force: _sandy_spheres(count, force) for force in FORCES}
    data = mujoco.MjData(models["implicit"])
    data.qpos.reshape(count, 7)[:, 2:] = one.qpos[2:]
    data.qvel[:] = np.tile(one.qvel, count)
    return Prepared(models, dict.fromkeys(GROUNDS, data))


def _prepare_robot(path: Path) -> Prepared:
    """A robot as anyone loads it; without sand it stands on its own floor, with the integrator that it has on sand."""
    models: dict[Ground, mujoco.MjModel] = {}
    for force in FORCES:
        spec = read_spec(path)
        with quiet():
            add_sand(spec, force=force)
        models[force] = spec.compile()
    models["none"] = read_spec(path).compile()
    for model in models.values():
        model.opt.integrator = models["implicit"].opt.integrator
    h = next((h for h in STEPS if _is_stable(models["none"], h)), STEPS[-1])
    for model in models.values():
        model.opt.timestep = h
    models = {ground: models[ground] for ground in GROUNDS}
    return Prepared(models, {ground: settle(model) for ground, model in models.items()})


def _is_stable(model: mujoco.MjModel, h: float) -> bool:
    """Whether a model settles and moves at a time step [s] without being lost."""
    model.opt.timestep = h
    data = settle(model)
    for span in draw_controls(data, round(MOVING / h)):
        data.ctrl[:] = span.ctrl
        mujoco.mj_step(model, data, nstep=span.steps)
    return not is_lost(data)
