"""The shipped quadruped as a subject: how it is put on sand, and how it trots."""

import functools
import math
from typing import Any, Final

import mujoco
from rftsim_models import parts
from rftsim_models.quadruped import DIAGONALS, FEET, JOINTS, LEGS, build_quadruped

from rftsim.bench.subjects import SETTLING, H, Subject, put, settle
from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.run.scenes import POPPY, Measured, Staged
from rftsim.surface.triangles import Array

STRIDE: Final = 0.5
"""Duration of two steps of the trot [s]."""
RENEWED: Final = 0.02
"""Time after which the targets are new [s]."""


def trot(model: mujoco.MjModel, time: float) -> Array:
    """Make the targets of the trot at a time: diagonal legs lift their feet and swing ahead together."""
    ctrl: Array = model.key_ctrl[0].copy()
    for pair, legs in enumerate(DIAGONALS):
        phase = 2.0 * math.pi * time / STRIDE + math.pi * pair
        lift, swing = max(math.sin(phase), 0.0), math.cos(phase)
        for leg in legs:
            ctrl[JOINTS.index(f"hip_{LEGS[leg]}")] += 0.15 * swing + 0.3 * lift
            ctrl[JOINTS.index(f"knee_{LEGS[leg]}")] -= 0.6 * lift
    return ctrl


@functools.cache
def trotting() -> mujoco.MjData:
    """Make data of the quadruped on sand that settled and then trotted whole strides, for SETTLING each."""
    data = settle(_stage("rft3d").model)
    for _ in range(round(SETTLING / RENEWED)):
        data.ctrl[:] = trot(data.model, data.time)
        mujoco.mj_step(data.model, data, nstep=round(RENEWED / H))
    return data


def _targets(model: mujoco.MjModel, time: float) -> Array:
    """Targets of the trot that are held at a time since its start, which is at the beginning of a stride."""
    return trot(model, RENEWED * math.floor(time / RENEWED + 1e-6))


def _bare() -> mujoco.MjSpec:
    spec = build_quadruped()
    spec.option.timestep = H
    return spec


def _stage(law: str, **options: Any) -> Staged:
    spec = _bare()
    options = {**WHOLE, "max_edge": math.inf, "bodies": (parts.TORSO, *FEET), **options}
    bed = add_sand(spec, POPPY, law, draw=False, **options)
    return Staged(spec.compile(), bed, Measured(parts.TORSO, None), SETTLING)


QUADRUPED: Final = Subject(
    "a quadruped that trots, of position servos",
    ("rft3d",),
    _stage,
    _bare,
    lambda model, data: put(data, trotting()),
    0.02,
    0.3,
    _targets,
)
"""The quadruped in its trot."""
