"""Cases that are hard to step: light bodies, rest, stiff servos, constraints, edges, impacts.

All stand in the same sand, xi_n 0.92e6 Pa/m and mu_surf 0.4, under 3D-RFT unless said. A case plays its script on a
`Trial` and returns what it measured. The legs, which also start at random, are here; all other cases have modules of
their own.
"""

from collections.abc import Callable, Mapping
from typing import Final

import mujoco
import numpy as np

from rftsim.bench.buried_cases import BURIED
from rftsim.bench.free_cases import DROPPED, SLOPE, THROWN
from rftsim.bench.joined_cases import JOINED
from rftsim.bench.trials import REST, Force, HardCase, Judged, Quantities, Trial, leave_alone, make_spec
from rftsim.bench.wheel_cases import WHEELS

CAPACITY: Final = 10.84
"""Sideways force [N] at which the standing legs break away, the median of what `capacity_of_legs` finds."""


def legs(h: float, force: Force) -> Trial:
    """Make the trial of a body of 2 kg on four legs of two links, 10 g each."""
    legs, servos = "", ""
    for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        link = '<inertial pos="0 0 -.05" mass=".01" diaginertia="1e-5 1e-5 2e-6"/>'
        knee = "1 0 0" if i % 2 == 0 else "0 1 0"
        shank = (
            '<geom type="box" size=".01 .01 .01" pos="0 0 -.1"/><geom type="box" size=".006 .006 .04" pos="0 0 -.05"/>'
        )
        legs += (
            f'<body pos="{0.12 * x} {0.08 * y} 0"><joint name="hip{i}" axis="0 1 0" damping=".001"/>{link}'
            f'<body name="shank{i}" pos="0 0 -.1"><joint name="knee{i}" axis="{knee}" damping=".001"/>{link}{shank}'
            "</body></body>"
        )
        for joint in (f"hip{i}", f"knee{i}"):
            servos += f'<position joint="{joint}" kp="20" kv=".5"/>'
    inertia = '<inertial pos="0 0 0" mass="2" diaginertia=".01 .02 .02"/>'
    body = f'<body name="body" pos="0 0 .2"><freejoint/>{inertia}{legs}</body>'
    return Trial(make_spec(body, f"<actuator>{servos}</actuator>", "implicitfast"), h, force)


def capacity_of_legs(h: float = 1e-3) -> float:
    """Sideways force [N] at which the standing legs break away: a force that grows by 2 N/s, at 0.05 m/s."""
    trial = legs(h, "implicit")
    trial.run(1.0)
    while abs(trial.data.qvel[0]) < 0.05:
        trial.data.xfrc_applied[1, 0] += 2.0 * h
        trial.run(h)
    return float(trial.data.xfrc_applied[1, 0])


def _play_held(trial: Trial) -> Quantities:
    trial.run(1.0)
    height = 1e3 * trial.data.qpos[2]
    trial.data.xfrc_applied[1, 0] = 0.5 * CAPACITY
    trial.run(1.0)
    return {"height": height} | leave_alone(trial)


def _play_broken_away(trial: Trial) -> Quantities:
    trial.run(1.0)
    start = trial.data.qpos[0]
    trial.data.xfrc_applied[1, 0] = 2.0 * CAPACITY
    trial.run(0.15)
    return {"travel": 1e3 * (trial.data.qpos[0] - start)}


def start_at_random(trial: Trial, seed: int) -> Callable[[mujoco.MjData], None]:
    """Throw the legs of a trial into the sand, pose, velocity and gait drawn at random.

    Returns:
        A function that moves the legs: to be called with the data ahead of each step.
    """
    random = np.random.default_rng(seed)
    data = trial.data
    attitude = random.normal(size=4)
    data.qpos[:3] = 0.0, 0.0, random.uniform(0.05, 0.4)
    data.qpos[3:7] = attitude / np.linalg.norm(attitude)
    data.qpos[7:] = random.uniform(-1.0, 1.0, size=8)
    data.qvel[:3] = random.normal(size=3)
    data.qvel[3:] = 5.0 * random.normal(size=11)
    rate, phase = 2 * np.pi * random.uniform(1.0, 5.0, size=8), random.uniform(0.0, 2 * np.pi, size=8)

    def move(data: mujoco.MjData) -> None:
        data.ctrl[:] = 0.8 * np.sin(rate * data.time + phase)

    return move


LEGS: Final = {
    "legs, held": HardCase(
        "2 kg on legs of 10 g links, pushed at half of what the sand holds",
        legs,
        _play_held,
        {"height": Judged("mm")} | REST,
    ),
    "legs, broken away": HardCase(
        "the same, pushed at twice what the sand holds", legs, _play_broken_away, {"travel": Judged("mm")}
    ),
}
"""The legs that hold, and the legs that are broken away."""

CASES: Final[Mapping[str, HardCase]] = {**DROPPED, **WHEELS, **LEGS, **BURIED, **THROWN, **SLOPE, **JOINED}
"""Every hard case by name."""
