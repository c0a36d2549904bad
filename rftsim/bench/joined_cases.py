"""Hard cases of bodies that constraints join: a weld, a joint's limit, and contacts with friction."""

from collections.abc import Callable
from typing import Final

import mujoco

from rftsim.bench.trials import REST, Force, HardCase, Judged, Quantities, Trial, leave_alone, make_spec


def _build_weld(h: float, force: Force) -> Trial:
    foot = '<body name="foot" pos="0 0 .03"><freejoint/><geom type="box" size=".03 .03 .01" mass=".01"/></body>'
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia=".001 .001 .001"/>'
    load = f'<body name="load" pos="0 0 .1"><freejoint/>{inertia}</body>'
    weld = '<equality><weld body1="foot" body2="load" solref=".02 1"/></equality>'
    return Trial(make_spec(foot + load, weld), h, force)


def _play_weld(trial: Trial) -> Quantities:
    trial.run(0.5)
    return {"depth": 1e3 * (0.01 - trial.data.qpos[2]), "gap": 1e3 * (trial.data.qpos[9] - trial.data.qpos[2])}


def _build_limit(h: float, force: Force) -> Trial:
    foot = (
        '<body><joint axis="0 1 0" range="-10 10" limited="true" damping=".002"/>'
        '<inertial pos="0 0 -.05" mass=".05" diaginertia="1e-4 1e-4 1e-5"/>'
        '<geom type="box" size=".015 .015 .01" pos=".02 0 -.1"/></body>'
    )
    slide = '<joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia=".001 .001 .001"/>'
    return Trial(make_spec(f'<body pos="0 0 .12">{slide}{foot}</body>'), h, force)


def _play_limit(trial: Trial) -> Quantities:
    trial.run(0.6)
    before = trial.data.qpos.copy()
    trial.run(trial.resting)
    return {
        "height": -1e3 * before[0],
        "angle": -1e3 * before[1],
        "drift": 1e3 * abs(trial.data.qpos[0] - before[0]),
    }


def _build_contact(cone: str) -> Callable[[float, Force], Trial]:
    """Make what builds a raft and a box thrown on it, with MuJoCo's friction cone of a name."""

    def build(h: float, force: Force) -> Trial:
        raft = '<body name="raft"><freejoint/><geom type="box" size=".1 .1 .01" mass="1" friction=".5"/></body>'
        box = '<geom type="box" size=".03 .03 .03" mass=".5" friction=".5"/>'
        load = f'<body name="load" pos=".02 0 .08"><freejoint/>{box}</body>'
        spec = make_spec(raft + load)
        spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
        trial = Trial(spec, h, force)
        trial.data.qvel[6] = 0.3
        return trial

    return build


def _play_contact(trial: Trial) -> Quantities:
    """Let the box slide to rest on the raft."""
    trial.run(0.6)
    raft, load = trial.data.qpos[:3], trial.data.qpos[7:10]
    return {"depth": -1e3 * raft[2] + 10.0, "slid": 1e3 * (load[0] - raft[0])} | leave_alone(trial)


JOINED: Final = {
    "weld": HardCase(
        "a 10 g foot welded to 1 kg, dropped", _build_weld, _play_weld, {"depth": Judged("mm"), "gap": Judged("mm")}
    ),
    "joint limit": HardCase(
        "a foot that the sand turns to its joint's limit",
        _build_limit,
        _play_limit,
        {"height": Judged("mm"), "angle": Judged("mrad"), "drift": Judged("mm", limit=0.05)},
    ),
    "contact": HardCase(
        "a box thrown on a raft, on which it slides",
        _build_contact("pyramidal"),
        _play_contact,
        {"depth": Judged("mm"), "slid": Judged("mm")} | REST,
    ),
    "contact, elliptic cone": HardCase(
        "the same", _build_contact("elliptic"), _play_contact, {"depth": Judged("mm"), "slid": Judged("mm")} | REST
    ),
}
"""Bodies that are welded, limited and stacked."""
