"""Cases that are hard to step: light bodies, rest, stiff servos, constraints, edges, impacts.

All stand in the same sand, xi_n 0.92e6 Pa/m and mu_surf 0.4, under 3D-RFT unless said. A case plays its script on a
`Trial` and returns what it measured.
"""

import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, Literal, NamedTuple

import mujoco
import numpy as np
from rftsim_models.wheels import WheelParameters, build_wheel

from rftsim.model.add_sand import add_sand
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand

SAND: Final = Sand(rho_c=3000.0, mu_int=0.4, mu_surf=0.4, xi_n=0.92e6)
RESTING: Final = 10.0

Force = Literal["explicit", "implicit"]
Measured = Mapping[str, float]


class Judged(NamedTuple):
    """A measured quantity and what it is judged by."""

    unit: str
    limit: float | None = None
    """Largest value, where the exact one is zero; None where the value is compared with the exact or converged one."""
    exact: float | None = None
    """The exact value, where there is one; None for the converged one."""


class Trial:
    """One case at one time step under one force: the simulation, and the time that its steps took.

    Args:
        spec: The model without sand.
        h: Time step [s].
        force: The sand's force.
        **options: Those of `add_sand`.
    """

    resting = RESTING
    """How long bodies are left alone where rest is judged [s]."""

    def __init__(self, spec: mujoco.MjSpec, h: float, force: Force, **options: Any) -> None:
        spec.option.timestep = h
        sand = options.pop("sand", SAND)
        add_sand(spec, sand, options.pop("law", "rft3d"), force=force, draw=False, **options)
        self.h = h
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.seconds = 0.0
        self.steps = 0

    def run(self, duration: float, before: "Callable[[mujoco.MjData], Any] | None" = None) -> None:
        """Advance; `before` is called ahead of each step."""
        total = max(round(duration / self.h), 1)
        if before is None:
            started = time.perf_counter()
            mujoco.mj_step(self.model, self.data, nstep=total)
            self.seconds += time.perf_counter() - started
        else:
            for _ in range(total):
                before(self.data)
                started = time.perf_counter()
                mujoco.mj_step(self.model, self.data)
                self.seconds += time.perf_counter() - started
        self.steps += total

    @property
    def failed(self) -> bool:
        """Whether MuJoCo reset the simulation, or would have."""
        kinds = mujoco.mjtWarning
        bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        return any(self.data.warning[kind].number for kind in bad)


@dataclasses.dataclass(frozen=True)
class HardCase:
    """A hard case.

    Attributes:
        says: What happens.
        build: Makes a trial from a time step and a force.
        play: Runs it, and measures.
        judged: What is measured, by name.
    """

    says: str
    build: Callable[[float, Force], Trial]
    play: Callable[[Trial], Measured]
    judged: Mapping[str, Judged]


REST: Final = {
    "drift": Judged("mm", limit=0.05),
    "speed": Judged("m/s", limit=1e-4),
    "spin": Judged("rad/s", limit=1e-3),
}


def _spec(world: str, rest: str = "", integrator: str = "Euler") -> mujoco.MjSpec:
    return mujoco.MjSpec.from_string(
        f'<mujoco><option integrator="{integrator}"/><worldbody>{world}</worldbody>{rest}</mujoco>'
    )


def _free(geom: str, pos: str) -> str:
    return f'<body name="body" pos="{pos}"><freejoint/>{geom}</body>'


def _plate(mass: float) -> str:
    return f'<geom type="box" size=".05 .05 .005" mass="{mass}"/>'


def _sphere(mass: float) -> str:
    return f'<geom size=".05" mass="{mass}"/>'


def _left_alone(trial: Trial) -> dict[str, float]:
    """Drift, speed and spin of a free body after ten seconds."""
    before = trial.data.qpos[:3].copy()
    trial.run(trial.resting)
    velocity = trial.data.qvel
    return {
        "drift": 1e3 * float(np.linalg.norm(trial.data.qpos[:3] - before)),
        "speed": float(np.linalg.norm(velocity[:3])),
        "spin": float(np.linalg.norm(velocity[3:6])),
    }


def _drop(says: str, geom: str, below: float, exact: float | None = None) -> HardCase:
    def build(h: float, force: Force) -> Trial:
        return Trial(_spec(_free(geom, "0 0 .05")), h, force)

    def play(trial: Trial) -> Measured:
        trial.run(0.4)
        depth = 1e3 * (below - trial.data.qpos[2])
        return {"depth": depth} | _left_alone(trial)

    return HardCase(says, build, play, {"depth": Judged("mm", exact=exact)} | REST)


def plate_depth(mass: float, area: float, fall: float) -> float:
    """Depth [m] at which a flat plate that falls comes to rest: m g (H + z) = xi_n alpha_z A z^2 / 2."""
    weight, stiffness = mass * 9.81, float(SAND.zeta or 0.0) * area
    return float((weight + np.sqrt(weight**2 + 2 * stiffness * weight * fall)) / stiffness)


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


def _wheel(torque: float | None) -> Callable[[float, Force], Trial]:
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


def _stuck(trial: Trial) -> Measured:
    trial.run(1.0)
    trial.data.ctrl[0] = 3.0
    trial.run(0.5)
    before = trial.data.qpos.copy()
    trial.run(trial.resting)
    moved = np.abs(trial.data.qpos - before) * [1.0, 1.0, WHEEL.outer_radius]
    return {"sinkage": -1e3 * before[1], "moved": 1e3 * float(moved.max())}


def _roll(trial: Trial) -> Measured:
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


def legs(h: float, force: Force) -> Trial:
    """A body of 2 kg on four legs of two links, 10 g each."""
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
    return Trial(_spec(body, f"<actuator>{servos}</actuator>", "implicitfast"), h, force)


def capacity_of_legs(h: float = 1e-3) -> float:
    """Sideways force [N] at which the standing legs break away: a force that grows by 2 N/s, at 0.05 m/s."""
    trial = legs(h, "implicit")
    trial.run(1.0)
    while abs(trial.data.qvel[0]) < 0.05:
        trial.data.xfrc_applied[1, 0] += 2.0 * h
        trial.run(h)
    return float(trial.data.xfrc_applied[1, 0])


CAPACITY: Final = 10.95
"""What `capacity_of_legs` finds [N]."""


def _held(trial: Trial) -> Measured:
    trial.run(1.0)
    height = 1e3 * trial.data.qpos[2]
    trial.data.xfrc_applied[1, 0] = 0.5 * CAPACITY
    trial.run(1.0)
    return {"height": height} | _left_alone(trial)


def _broken(trial: Trial) -> Measured:
    trial.run(1.0)
    start = trial.data.qpos[0]
    trial.data.xfrc_applied[1, 0] = 2.0 * CAPACITY
    trial.run(0.15)
    return {"travel": 1e3 * (trial.data.qpos[0] - start)}


def _pulled(h: float, force: Force) -> Trial:
    world = '<body name="hand" mocap="true" pos="0 0 -.1"><site name="hand"/></body>' + _free(
        _sphere(0.5) + '<site name="hook"/>', "0 0 -.1"
    )
    spring = (
        '<tendon><spatial stiffness="500" springlength="0"><site site="hand"/><site site="hook"/></spatial></tendon>'
    )
    return Trial(_spec(world, spring), h, force, bodies="body")


def _pull(trial: Trial) -> Measured:
    """The hand rises by 0.05 m/s: first by what the sand holds, then until the body is out."""
    trial.run(0.5)
    height = trial.data.qpos[2]

    def lift(data: mujoco.MjData) -> None:
        data.mocap_pos[0, 2] += 0.05 * trial.h

    trial.run(0.5, lift)
    held = 1e3 * abs(trial.data.qpos[2] - height)
    force = []

    def pull(data: mujoco.MjData) -> None:
        lift(data)
        force.append(data.mocap_pos[0, 2] - data.qpos[2])

    trial.run(3.5, pull)
    return {"held": held, "pull": 500.0 * max(force)}


def _edge(h: float, force: Force) -> Trial:
    trial = Trial(_spec(_free(_plate(0.2), "0 0 -.03")), h, force)
    trial.data.qvel[0] = 1.0
    return trial


def _slid(trial: Trial) -> Measured:
    trial.run(1.0)
    return {"travel": 1e3 * trial.data.qpos[0], "rise": 1e3 * abs(trial.data.qpos[2] + 0.03)}


def _dragged(gain: float) -> Callable[[float, Force], Trial]:
    def build(h: float, force: Force) -> Trial:
        slides = '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
        body = f'<body pos="0 0 -.03">{slides}<joint axis="0 1 0"/>{_plate(0.2)}</body>'
        servo = f'<actuator><velocity joint="x" kv="{gain}"/></actuator>'
        trial = Trial(_spec(body, servo, "implicitfast"), h, force)
        trial.data.ctrl[0] = 0.1
        return trial

    return build


def _drag(trial: Trial) -> Measured:
    trial.run(0.5)
    x, z, pitch = trial.data.qpos
    return {"travel": 1e3 * x, "rise": 1e3 * abs(z), "pitch": 1e3 * abs(pitch)}


def _drill(h: float, force: Force) -> Trial:
    joints = '<joint type="slide" axis="0 0 1"/><joint name="r" axis="0 0 1"/>'
    body = f'<body pos="0 0 .05">{joints}<geom type="cylinder" size=".02 .05" mass="2"/></body>'
    return Trial(_spec(body, '<actuator><velocity joint="r" kv=".5"/></actuator>', "implicitfast"), h, force)


def _drilled(trial: Trial) -> Measured:
    trial.run(0.5)
    before = trial.data.qpos[0]
    trial.data.ctrl[0] = 5.0
    trial.run(1.0)
    return {"depth": -1e3 * before, "drilled": 1e3 * (before - trial.data.qpos[0])}


def _leaving(law: str) -> Callable[[float, Force], Trial]:
    def build(h: float, force: Force) -> Trial:
        trial = Trial(_spec(_free(_sphere(0.5), "0 0 0")), h, force, law=law, sand=SAND.replace(lambda_=1.4))
        trial.data.qvel[:3] = 0.5, 0.0, 3.0
        return trial

    return build


def _entered(trial: Trial) -> Measured:
    trial.run(1.5)
    return {"depth": 1e3 * (0.05 - trial.data.qpos[2]), "travel": 1e3 * trial.data.qpos[0]}


def _tilted(h: float, force: Force) -> Trial:
    slope = np.array([-0.3, 0.0, 1.0])
    surface = FreeSurface(normal=tuple(slope / np.linalg.norm(slope)))
    return Trial(_spec(_free(_plate(0.3), "0 0 .03")), h, force, surface=surface)


def _slope(trial: Trial) -> Measured:
    trial.run(1.0)
    x, z = 1e3 * trial.data.qpos[0], 1e3 * trial.data.qpos[2]
    return {"slip": x, "height": z} | _left_alone(trial)


def _welded(h: float, force: Force) -> Trial:
    foot = '<body name="foot" pos="0 0 .03"><freejoint/><geom type="box" size=".03 .03 .01" mass=".01"/></body>'
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia=".001 .001 .001"/>'
    load = f'<body name="load" pos="0 0 .1"><freejoint/>{inertia}</body>'
    weld = '<equality><weld body1="foot" body2="load" solref=".02 1"/></equality>'
    return Trial(_spec(foot + load, weld), h, force)


def _weld(trial: Trial) -> Measured:
    trial.run(0.5)
    return {"depth": 1e3 * (0.01 - trial.data.qpos[2]), "gap": 1e3 * (trial.data.qpos[9] - trial.data.qpos[2])}


def _limited(h: float, force: Force) -> Trial:
    foot = (
        '<body><joint axis="0 1 0" range="-10 10" limited="true" damping=".002"/>'
        '<inertial pos="0 0 -.05" mass=".05" diaginertia="1e-4 1e-4 1e-5"/>'
        '<geom type="box" size=".015 .015 .01" pos=".02 0 -.1"/></body>'
    )
    slide = '<joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia=".001 .001 .001"/>'
    return Trial(_spec(f'<body pos="0 0 .12">{slide}{foot}</body>'), h, force)


def _limit(trial: Trial) -> Measured:
    trial.run(0.6)
    before = trial.data.qpos.copy()
    trial.run(trial.resting)
    return {
        "height": -1e3 * before[0],
        "angle": -1e3 * before[1],
        "drift": 1e3 * abs(trial.data.qpos[0] - before[0]),
    }


def _stacked(cone: str) -> Callable[[float, Force], Trial]:
    def build(h: float, force: Force) -> Trial:
        raft = '<body name="raft"><freejoint/><geom type="box" size=".1 .1 .01" mass="1" friction=".5"/></body>'
        box = '<geom type="box" size=".03 .03 .03" mass=".5" friction=".5"/>'
        load = f'<body name="load" pos=".02 0 .08"><freejoint/>{box}</body>'
        spec = _spec(raft + load)
        spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
        trial = Trial(spec, h, force)
        trial.data.qvel[6] = 0.3
        return trial

    return build


def _stack(trial: Trial) -> Measured:
    """A box thrown on a raft, on which it slides to rest."""
    trial.run(0.6)
    raft, load = trial.data.qpos[:3], trial.data.qpos[7:10]
    return {"depth": -1e3 * raft[2] + 10.0, "slid": 1e3 * (load[0] - raft[0])} | _left_alone(trial)


CASES: Final[Mapping[str, HardCase]] = {
    "plate": _drop(
        "a flat 20 g plate dropped by 45 mm: crosses its depth in 3 ms",
        _plate(0.02),
        0.005,
        exact=1e3 * plate_depth(0.02, 0.01, 0.045),
    ),
    "heavy sphere": _drop("1.5 kg, dropped from the surface", _sphere(1.5), 0.05),
    "light sphere": _drop("20 g, dropped from the surface", _sphere(0.02), 0.05),
    "stuck wheel": HardCase(
        "a grousered wheel whose motor is too weak to turn it",
        _wheel(0.6),
        _stuck,
        {"sinkage": Judged("mm"), "moved": Judged("mm", limit=0.2)},
    ),
    "rolling wheel": HardCase(
        "the same, at 3 rad/s", _wheel(None), _roll, {"speed": Judged("m/s"), "sinkage": Judged("mm")}
    ),
    "legs, held": HardCase(
        "2 kg on legs of 10 g links, pushed at half of what the sand holds",
        legs,
        _held,
        {"height": Judged("mm")} | REST,
    ),
    "legs, broken away": HardCase(
        "the same, pushed at twice what the sand holds", legs, _broken, {"travel": Judged("mm")}
    ),
    "pull": HardCase(
        "a buried sphere pulled out by a slow spring",
        _pulled,
        _pull,
        {"held": Judged("mm", limit=0.05), "pull": Judged("N")},
    ),
    "edge-on plate": HardCase(
        "a buried plate thrown edge-on at 1 m/s",
        _edge,
        _slid,
        {"travel": Judged("mm"), "rise": Judged("mm", limit=0.1)},
    ),
    "edge-on drag": HardCase(
        "a buried plate dragged edge-on at 0.1 m/s, free to pitch",
        _dragged(2000.0),
        _drag,
        {"travel": Judged("mm"), "rise": Judged("mm"), "pitch": Judged("mrad")},
    ),
    "edge-on, stuck": HardCase(
        "the same with a servo too weak to move it",
        _dragged(200.0),
        _drag,
        {"travel": Judged("mm", limit=0.2), "rise": Judged("mm", limit=0.1), "pitch": Judged("mrad", limit=1.0)},
    ),
    "drill": HardCase(
        "a vertical cylinder dropped, then turned", _drill, _drilled, {"depth": Judged("mm"), "drilled": Judged("mm")}
    ),
    "re-entry": HardCase(
        "a sphere leaves the sand at 3 m/s and comes back",
        _leaving("rft3d"),
        _entered,
        {"depth": Judged("mm"), "travel": Judged("mm")},
    ),
    "re-entry, dynamic law": HardCase(
        "the same under drft3d, lambda 1.4",
        _leaving("drft3d"),
        _entered,
        {"depth": Judged("mm"), "travel": Judged("mm")},
    ),
    "slope": HardCase(
        "a plate dropped on a slope of 17 degrees",
        _tilted,
        _slope,
        {"slip": Judged("mm"), "height": Judged("mm")} | REST,
    ),
    "weld": HardCase(
        "a 10 g foot welded to 1 kg, dropped", _welded, _weld, {"depth": Judged("mm"), "gap": Judged("mm")}
    ),
    "joint limit": HardCase(
        "a foot that the sand turns to its joint's limit",
        _limited,
        _limit,
        {"height": Judged("mm"), "angle": Judged("mrad"), "drift": Judged("mm", limit=0.05)},
    ),
    "contact": HardCase(
        "a box thrown on a raft, on which it slides",
        _stacked("pyramidal"),
        _stack,
        {"depth": Judged("mm"), "slid": Judged("mm")} | REST,
    ),
    "contact, elliptic cone": HardCase(
        "the same", _stacked("elliptic"), _stack, {"depth": Judged("mm"), "slid": Judged("mm")} | REST
    ),
}
"""Every hard case by name."""


def start_at_random(trial: Trial, seed: int) -> Callable[[mujoco.MjData], None]:
    """Throw the legs of a trial into the sand, pose, velocity and gait drawn at random.

    Returns:
        What moves the legs: to be called ahead of each step.
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
