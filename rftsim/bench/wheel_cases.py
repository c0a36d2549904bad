"""Hard cases of a driven wheel: one whose motor is too weak to turn it, and one that rolls."""

from collections.abc import Callable
from typing import Final

import numpy as np
from rftsim_models.wheels import WheelParameters, build_wheel

from rftsim.bench.trials import Force, HardCase, Judged, Quantities, Trial

WHEEL: Final = WheelParameters(
    radius=0.1,
    width=0.1,
    lugs=12,
    lug_height=0.015,
    lug_width=0.003,
    felt_height=1.0,
    vertical_mass=4.0,
    horizontal_mass=4.0,
    gravity=9.81,
    flank=3,
)
"""A grousered wheel of 200 mm."""


def _build_wheel(torque: float | None) -> Callable[[float, Force], Trial]:
    """Make what builds the wheel with a motor of a largest torque [N m], or of any torque."""

    def build(h: float, force: Force) -> Trial:
        spec = build_wheel(WHEEL, 0.0)
        servo = spec.actuator("rate")
        servo.set_to_velocity(kv=2.0)
        if torque is not None:
            servo.forcerange = [-torque, torque]
        spec.delete(spec.actuator("push"))
        spec.delete(spec.key("start"))
        return Trial(spec, h, force, max_edge=0.03)

    return build


def _play_stuck(trial: Trial) -> Quantities:
    trial.run(1.0)
    trial.data.ctrl[0] = 3.0
    trial.run(0.5)
    before = trial.data.qpos.copy()
    trial.run(trial.resting)
    moved = np.abs(trial.data.qpos - before) * [1.0, 1.0, WHEEL.outer_radius]
    return {"sinkage": -1e3 * before[1], "moved": 1e3 * float(moved.max())}


def _play_rolling(trial: Trial) -> Quantities:
    trial.run(0.5)
    trial.data.ctrl[0] = 3.0
    trial.run(1.0)
    start, heights = trial.data.qpos[0], []
    turn = 2 * np.pi / 3.0
    trial.run(turn, lambda data: heights.append(data.qpos[1]))
    return {
        "speed": (trial.data.qpos[0] - start) / (len(heights) * trial.h),
        "sinkage": -1e3 * float(np.mean(heights)),
    }


WHEELS: Final = {
    "stuck wheel": HardCase(
        "a grousered wheel whose motor is too weak to turn it",
        _build_wheel(0.6),
        _play_stuck,
        {"sinkage": Judged("mm"), "moved": Judged("mm", limit=0.2)},
    ),
    "rolling wheel": HardCase(
        "the same, at 3 rad/s", _build_wheel(None), _play_rolling, {"speed": Judged("m/s"), "sinkage": Judged("mm")}
    ),
}
"""The wheel that is stuck, and the one that rolls."""
