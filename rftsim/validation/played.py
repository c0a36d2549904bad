"""The continuum's studies of prints, heaps and ruts, played in MuJoCo on sand that forgets and that remembers."""

import dataclasses
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from rftsim_models.studio import new_scene
from rftsim_models.wheels import GROUSER_WHEEL, WHEEL, build_wheel
from rftsim_mpm.blade import Blade
from rftsim_mpm.footprint import Footprint
from rftsim_mpm.rut import ENTRY, Rut

from rftsim.model.add_sand import add_sand
from rftsim.model.ground import ground
from rftsim.model.readout import wrenches
from rftsim.run.scenes import POPPY
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array

LAW: Final = "rft2d"
"""The law that is played: of plane strain, and without the drop of the surface that ruts would count twice."""
VARIANTS: Final[dict[str, dict[str, Any]]] = {"no ruts": {}, "ruts": {"ruts": True}}
"""Options of `add_sand` by what the sand remembers."""
PLACES: Final = np.linspace(-0.6, 0.6, 1201)
"""Places along x at which the surface is read, in the bodies' middle plane [m]."""
ZETA: Final = 1e6
"""Strength of the sand of foot and blade [N/m^3]: forces are proportional to it, and compared as ratios."""
WIDTH: Final = 1.0
"""Width of the bodies [m]."""
MASS: Final = 1e9
"""Mass of foot and blade, which the sand's force cannot slow down [kg]."""
TIMESTEP: Final = 1e-3
"""Time step of foot and blade [s]."""


class Played(NamedTuple):
    """A stage of a motion: where the body was, and what the sand did to it."""

    travel: Array
    """Displacement along x and z from where the model places the body, (n, 2) [m]."""
    force: Array
    """Force of the sand along x and z, (n, 2) [N/m]."""
    surface: Array
    """Height of the surface over PLACES at its end [m]."""


def _box(size: tuple[float, float], place: tuple[float, float], sand: Sand, variant: str) -> mujoco.MjModel:
    """A box of a size along x and z [m], its middle at a place, on two slides over level sand."""
    spec = new_scene("box", gravity=9.81, timestep=TIMESTEP)
    body = spec.worldbody.add_body(name="box", pos=[place[0], 0.0, place[1]], gravcomp=1.0)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5 * size[0], 0.5 * WIDTH, 0.5 * size[1]], mass=MASS)
    for axis in ([1, 0, 0], [0, 0, 1]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    add_sand(spec, sand, LAW, terrain=0.0, draw=False, **VARIANTS[variant])
    return spec.compile()


def _play(model: mujoco.MjModel, stages: Iterable[tuple[float, float, float]]) -> list[Played]:
    """Move a body on two slides at velocities along x and z [m/s], each for a duration [s]."""
    data = mujoco.MjData(model)
    index = model.body("box").id
    played = []
    for vx, vz, duration in stages:
        rows = []
        for _ in range(round(duration / model.opt.timestep)):
            data.qvel[:] = vx, vz
            mujoco.mj_step(model, data)
            rows.append([*data.qpos, *wrenches(model, data).force[index, [0, 2]] / WIDTH])
        table = np.array(rows)
        played.append(Played(table[:, :2], table[:, 2:], ground(model, data).height_at(PLACES, 0.0)))
    return played


def foot(variant: str) -> dict[str, Any]:
    """Press the foot of the continuum's study twice: its print, and depth [m] and force over ZETA of both pushes."""
    study = Footprint()
    sand = Sand(rho_c=study.rho, mu_int=study.mu_int, mu_surf=study.mu_surf, zeta=ZETA)
    model = _box((study.length, study.height), (0.0, 0.5 * study.height), sand, variant)
    speed, away = study.speed, study.depth + study.clear
    stages = [
        (0.0, -speed, study.depth / speed),
        (0.0, speed, away / speed),
        (0.0, 0.0, study.rest),
        (0.0, -speed, (study.clear + study.again) / speed),
    ]
    first, _, left, second = _play(model, stages)
    middle = np.abs(PLACES) <= 0.25 * study.length
    surface = {"print_m": -float(left.surface[middle].mean()), "rim_m": float(left.surface.max())}
    return surface | {
        name: {"depth_m": (-push.travel[:, 1]).tolist(), "force": (push.force[:, 1] / ZETA).tolist()}
        for name, push in (("first", first), ("second", second))
    }


def blade(variant: str) -> dict[str, Any]:
    """Drag the blade of the continuum's study: travel [m], drag per width and ZETA, and its heap at the end [m]."""
    study = Blade()
    sand = Sand(rho_c=study.rho, mu_int=study.mu_int, mu_surf=study.mu_surf, zeta=ZETA)
    height = study.depth + 1.5 * study.heap
    model = _box((study.thickness, height), (0.0, 0.5 * height - study.depth), sand, variant)
    (dragged,) = _play(model, [(study.speed, 0.0, study.travel / study.speed)])
    drag = (-dragged.force[:, 0] / ZETA).tolist()
    return {"travel_m": dragged.travel[:, 0].tolist(), "drag": drag, "heap_m": float(dragged.surface.max())}


def wheel(variant: str, width: float = WIDTH) -> dict[str, Any]:
    """Drive the wheel of the continuum's study twice: slip and sinkage of both passes, and the rut of the first."""
    study = Rut()
    share = width / study.breadth
    parameters = dataclasses.replace(
        GROUSER_WHEEL,
        width=width,
        vertical_mass=share * study.mass_z,
        horizontal_mass=share * study.mass_x,
        forward_force=share * study.push,
        gravity=study.gravity,
    )
    spec = build_wheel(parameters, study.rpm)
    options = {"meshes": "exact", "max_edge": 2 * width, "draw": False, **VARIANTS[variant]}
    add_sand(spec, POPPY, LAW, bodies=[WHEEL], terrain=0.0, **options)
    model = spec.compile()
    data = mujoco.MjData(model)
    passes, surfaces = [], []
    for _ in range(2):
        _put_back(model, data, study.rest)
        surfaces.append(ground(model, data).height_at(PLACES, 0.0))
        passes.append(_drive(model, data, study.time))
    first, second = (float(x[-1]) for x, _, _ in passes)
    low, high = ENTRY * first, min(first - study.outer, second)
    rim = 2.0 * np.pi * study.rpm / 60.0 * study.outer
    slip, sunk = [], []
    for x, v, z in passes:
        own = (x >= low) & (x <= high)
        slip.append(1.0 - 1.0 / float(np.mean(1.0 / v[own])) / rim)
        sunk.append(float(z[own].mean()))
    rut = -float(surfaces[1][(low <= PLACES) & (high >= PLACES)].mean())
    return {"slip": slip, "sinkage_m": sunk, "rut_m": rut}


def _put_back(model: mujoco.MjModel, data: mujoco.MjData, rest: float) -> None:
    """Hold the wheel above the sand for a while [s], and put it where the keyframe has it, sand as it is."""
    for _ in range(round(rest / model.opt.timestep)):
        data.qpos[:], data.qvel[:], data.ctrl[:] = (0.0, 1.0, 0.0), 0.0, 0.0
        mujoco.mj_step(model, data)
    key = model.key("start")
    data.qpos[:], data.qvel[:], data.ctrl[:] = key.qpos, key.qvel, key.ctrl


def _drive(model: mujoco.MjModel, data: mujoco.MjData, duration: float) -> tuple[Array, Array, Array]:
    """Distance [m], speed [m/s] and sinkage of the outer circle below level ground [m] over a duration [s]."""
    rows = []
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
        rows.append((data.qpos[0], data.qvel[0], -data.qpos[1]))
    x, v, z = np.array(rows).T
    return x, v, z
