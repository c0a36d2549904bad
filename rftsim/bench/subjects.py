"""Subjects that the studies of cost step: the shipped wheel, runner and sphere, and a hexapod, on loose poppy seeds."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import mujoco
import numpy as np
from rftsim_models import parts
from rftsim_models.hexapod import LEGS, TRIPODS, build_hexapod

from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.run.scenes import POPPY, SCENES, Measured, Staged, stage
from rftsim.surface.triangles import Array

H: Final = 5e-3
"""Time step of what is not shipped with one [s]."""
GAIT: Final = 10.0
"""Rate of the hexapod's legs [rad/s]."""
SETTLING: Final = 1.0
"""Time after which a subject moves as it goes on to [s]."""


@dataclasses.dataclass(frozen=True)
class Subject:
    """A robot or a body on sand, or without it, whose steps are timed and whose path is compared.

    Attributes:
        says: A line that says what it is.
        laws: The laws that apply to it; the first is its own.
        stage: Makes it with sand, from a law and the options of `rftsim.run.scenes.stage`.
        bare: Makes it without sand.
        begin: Sets its data to its start.
        fine: Longest edge of its finest mesh [m].
        duration: Time that its path is compared for [s].
        move: Makes its controls from the time since its start [s]; None where they stay as they are at its start.
    """

    says: str
    laws: tuple[str, ...]
    stage: Callable[..., Staged]
    bare: Callable[[], mujoco.MjSpec]
    begin: Callable[[mujoco.MjModel, mujoco.MjData], None]
    fine: float
    duration: float
    move: Callable[[mujoco.MjModel, float], Array] | None = None

    def start(self, model: mujoco.MjModel) -> mujoco.MjData:
        """Make data of a model of this subject, at its start."""
        data = mujoco.MjData(model)
        self.begin(model, data)
        mujoco.mj_forward(model, data)
        return data


def _shipped(name: str, laws: tuple[str, ...], fine: float, duration: float, **settings: str) -> Subject:
    scene = SCENES[name]

    def make(law: str, **options: Any) -> Staged:
        return stage(name, law=law, settings=settings, draw=False, **options)

    return Subject(
        scene.says, laws, make, lambda: scene.build({**scene.settings, **settings}), _from_key, fine, duration
    )


def _from_key(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)


def _hexapod_without_sand() -> mujoco.MjSpec:
    spec = build_hexapod()
    spec.option.timestep = H
    return spec


def _hexapod(law: str, *, timestep: float | None = None, **options: Any) -> Staged:
    spec = _hexapod_without_sand()
    spec.option.timestep = timestep or spec.option.timestep
    options.setdefault("max_edge", math.inf)
    bed = add_sand(spec, POPPY, law, bodies=(parts.TORSO, *LEGS), draw=False, **{**WHOLE, **options})
    return Staged(spec.compile(), bed, Measured(parts.TORSO, None), SETTLING)


def _on_a_tripod(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    _from_key(model, data)
    data.qpos[7 + np.array(TRIPODS[0])] = np.pi
    data.ctrl[:] = GAIT


_EVERY: Final = ("drft2d", "rft2d", "drft3d", "rft3d")
"""Every law, of which the first is the own one of a wheel."""
SUBJECTS: Final[Mapping[str, Subject]] = {
    "wheel": _shipped("grouser-wheel", _EVERY, 0.06, 1.0),
    "runner": _shipped("four-flap-runner", ("drft2d", "drft3d"), 0.25, 0.5),
    "sphere": _shipped("intruder", ("rft3d", "drft3d"), 0.006, 0.3, height="0.06"),
    "hexapod": Subject(
        "[RHex] a hexapod of 2.3 kg on six C-legs, at 10 rad/s",
        ("rft3d",),
        _hexapod,
        _hexapod_without_sand,
        _on_a_tripod,
        0.02,
        0.3,
    ),
}
"""Every subject by name."""


@functools.cache
def in_motion(name: str, law: str) -> mujoco.MjData:
    """Make data of a subject under a law after SETTLING, with the implicit force."""
    subject = SUBJECTS[name]
    model = subject.stage(law).model
    data = subject.start(model)
    mujoco.mj_step(model, data, nstep=round(SETTLING / model.opt.timestep))
    return data


def put(data: mujoco.MjData, moving: mujoco.MjData) -> None:
    """Set the motion of one data into another, of the same model with other sand or none, and forget all else."""
    mujoco.mj_resetData(data.model, data)
    for name in ("qpos", "qvel", "ctrl", "act", "qacc_warmstart"):
        getattr(data, name)[:] = getattr(moving, name)


def settle(model: mujoco.MjModel, duration: float = SETTLING) -> mujoco.MjData:
    """Make data of a model that was left alone for a duration [s], from its keyframe where it has one."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=round(duration / model.opt.timestep))
    return data
