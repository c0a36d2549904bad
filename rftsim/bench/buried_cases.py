"""Hard cases of buried bodies: pulled out, thrown and dragged edge-on, and turned as a drill."""

from collections.abc import Callable
from typing import Final

import mujoco

from rftsim.bench.trials import Force, HardCase, Judged, Quantities, Trial, free_body, make_spec, plate, sphere


def _build_pull(h: float, force: Force) -> Trial:
    world = '<body name="hand" mocap="true" pos="0 0 -.1"><site name="hand"/></body>' + free_body(
        sphere(0.5) + '<site name="hook"/>', "0 0 -.1"
    )
    spring = (
        '<tendon><spatial stiffness="500" springlength="0"><site site="hand"/><site site="hook"/></spatial></tendon>'
    )
    return Trial(make_spec(world, spring), h, force, bodies="body")


def _play_pull(trial: Trial) -> Quantities:
    """Raise the hand by 0.05 m/s: first by what the sand holds, then until the body is out."""
    trial.run(0.5)
    height = trial.data.qpos[2]

    def lift(data: mujoco.MjData) -> None:
        data.mocap_pos[0, 2] += 0.05 * trial.h

    trial.run(0.5, lift)
    held = 1e3 * abs(trial.data.qpos[2] - height)
    stretched = []

    def pull(data: mujoco.MjData) -> None:
        lift(data)
        stretched.append(data.mocap_pos[0, 2] - data.qpos[2])

    trial.run(3.5, pull)
    return {"held": held, "pull": 500.0 * max(stretched)}


def _build_thrown(h: float, force: Force) -> Trial:
    trial = Trial(make_spec(free_body(plate(0.2), "0 0 -.03")), h, force)
    trial.data.qvel[0] = 1.0
    return trial


def _play_thrown(trial: Trial) -> Quantities:
    trial.run(1.0)
    return {"travel": 1e3 * trial.data.qpos[0], "rise": 1e3 * abs(trial.data.qpos[2] + 0.03)}


def _build_drag(gain: float) -> Callable[[float, Force], Trial]:
    """Make what builds a plate on a velocity servo of a gain [N s/m]."""

    def build(h: float, force: Force) -> Trial:
        slides = '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
        body = f'<body pos="0 0 -.03">{slides}<joint axis="0 1 0"/>{plate(0.2)}</body>'
        servo = f'<actuator><velocity joint="x" kv="{gain}"/></actuator>'
        trial = Trial(make_spec(body, servo, "implicitfast"), h, force)
        trial.data.ctrl[0] = 0.1
        return trial

    return build


def _play_drag(trial: Trial) -> Quantities:
    trial.run(0.5)
    x, z, pitch = trial.data.qpos
    return {"travel": 1e3 * x, "rise": 1e3 * abs(z), "pitch": 1e3 * abs(pitch)}


def _build_drill(h: float, force: Force) -> Trial:
    joints = '<joint type="slide" axis="0 0 1"/><joint name="r" axis="0 0 1"/>'
    body = f'<body pos="0 0 .05">{joints}<geom type="cylinder" size=".02 .05" mass="2"/></body>'
    return Trial(make_spec(body, '<actuator><velocity joint="r" kv=".5"/></actuator>', "implicitfast"), h, force)


def _play_drill(trial: Trial) -> Quantities:
    trial.run(0.5)
    before = trial.data.qpos[0]
    trial.data.ctrl[0] = 5.0
    trial.run(1.0)
    return {"depth": -1e3 * before, "drilled": 1e3 * (before - trial.data.qpos[0])}


BURIED: Final = {
    "pull": HardCase(
        "a buried sphere pulled out by a slow spring",
        _build_pull,
        _play_pull,
        {"held": Judged("mm", limit=0.05), "pull": Judged("N")},
    ),
    "edge-on plate": HardCase(
        "a buried plate thrown edge-on at 1 m/s",
        _build_thrown,
        _play_thrown,
        {"travel": Judged("mm"), "rise": Judged("mm", limit=0.1)},
    ),
    "edge-on drag": HardCase(
        "a buried plate dragged edge-on at 0.1 m/s, free to pitch",
        _build_drag(2000.0),
        _play_drag,
        {"travel": Judged("mm"), "rise": Judged("mm"), "pitch": Judged("mrad")},
    ),
    "edge-on, stuck": HardCase(
        "the same with a servo too weak to move it",
        _build_drag(200.0),
        _play_drag,
        {"travel": Judged("mm", limit=0.2), "rise": Judged("mm", limit=0.1), "pitch": Judged("mrad", limit=1.0)},
    ),
    "drill": HardCase(
        "a vertical cylinder dropped, then turned",
        _build_drill,
        _play_drill,
        {"depth": Judged("mm"), "drilled": Judged("mm")},
    ),
}
"""Bodies that are pulled, thrown, dragged and turned in the sand."""
