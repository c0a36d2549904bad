"""Articulated scenes drawn from a seed: trees of bodies of any joint and shape, thrown on sand and moved by servos.

Springs, dampers and servos are drawn by their natural frequency, from the inertia that they move, so that most scenes
can be stepped at 10 ms where there is no sand; `Scene.lost` of the bare model says which cannot.
"""

import dataclasses
import functools
import math
from typing import Final

import mujoco
import numpy as np

from rftsim.bench.effort import kinetic_energy
from rftsim.bench.quiet import quiet
from rftsim.bench.random_trees import Random, add_tree, between, one_of
from rftsim.bench.trials import Force, is_lost
from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array

LAWS: Final = ("rft3d", "drft3d")
"""Laws that the sand of a scene may have."""
FREQUENCIES: Final = (0.5, 15.0)
"""Range of the natural frequency of a spring with the inertia that it moves [Hz]."""
SERVOS: Final = (2.0, 20.0)
"""Range of the same of a servo [Hz]."""
SLOPE: Final = 20.0
"""Largest slope of the free surface [deg]."""

_S = mujoco.mjtState
STATE: Final = int(_S.mjSTATE_TIME | _S.mjSTATE_QPOS | _S.mjSTATE_QVEL | _S.mjSTATE_ACT | _S.mjSTATE_WARMSTART)
"""What of a state a scene has with sand and without."""

_MOVED: Final = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


@dataclasses.dataclass(frozen=True)
class Scene:
    """A drawn scene: bodies without sand, the sand that they move in, and how they start and are moved.

    Attributes:
        seed: The seed that it was drawn from.
        spec: The model without sand.
        sand: The medium.
        law: The law's name.
        terrain: The free surface.
        velocity: Generalised velocity at the start, (nv,).
        amplitude: Amplitudes of the servos' targets, (nu,).
        rate: Angular frequencies of the servos' targets [rad/s], (nu,).
        phase: Phases of the servos' targets at the start [rad], (nu,).
    """

    seed: int
    spec: mujoco.MjSpec
    sand: Sand
    law: str
    terrain: FreeSurface
    velocity: Array
    amplitude: Array
    rate: Array
    phase: Array

    def bare(self, h: float) -> mujoco.MjModel:
        """Compile the scene without sand, at a time step [s]."""
        model = self.spec.copy().compile()
        model.opt.timestep = h
        return model

    def sandy(self, h: float, force: Force = "implicit") -> mujoco.MjModel:
        """Compile the scene on its sand, at a time step [s]; what is doubtful about it is of no interest."""
        spec = self.spec.copy()
        with quiet():
            options = {**WHOLE, "terrain": self.terrain}
            add_sand(spec, self.sand, self.law, force=force, sensors=False, draw=False, geoms="all", **options)
        model = spec.compile()
        model.opt.timestep = h
        return model

    def start(self, model: mujoco.MjModel) -> mujoco.MjData:
        """Make data of a model of this scene, at its start."""
        data = mujoco.MjData(model)
        data.qvel[:] = self.velocity
        return data

    def move(self, data: mujoco.MjData) -> None:
        """Set the servos' targets at the time of the data."""
        data.ctrl[:] = self.amplitude * np.sin(self.rate * data.time + self.phase)

    def lost(self, h: float, duration: float) -> bool:
        """Whether MuJoCo loses the scene without sand, in free fall over a duration [s]."""
        model = self.bare(h)
        return self._falls_apart(model, self.start(model), duration)

    def lost_from(self, h: float, states: list[Array], duration: float) -> tuple[float, float] | None:
        """The first of states, see `state_of`, from which MuJoCo loses the scene without sand within a duration [s].

        Returns:
            Its time [s], and its kinetic energy over that of the first state; None where there is none.
        """
        model = self.bare(h)
        data = mujoco.MjData(model)
        for state in states:
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, state, STATE)
            time = data.time
            if self._falls_apart(model, data, duration):
                return time, _kinetic_energy(model, state) / _kinetic_energy(model, states[0])
        return None

    def _falls_apart(self, model: mujoco.MjModel, data: mujoco.MjData, duration: float) -> bool:
        for _ in range(round(duration / model.opt.timestep)):
            self.move(data)
            mujoco.mj_step(model, data)
            if is_lost(data):
                return True
        return False


def state_of(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The state of a scene's data but what the sand keeps of its own: numbers of STATE."""
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def _kinetic_energy(model: mujoco.MjModel, state: Array) -> float:
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_forward(model, data)
    return kinetic_energy(model, data, data.qvel)


@functools.lru_cache(maxsize=4)
def articulated(seed: int) -> Scene:
    """Draw a scene from a seed: one to three trees of up to eight bodies, their joints, servos and start, and sand."""
    random = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    spec.option.integrator = getattr(
        mujoco.mjtIntegrator, f"mjINT_{one_of(random, 'EULER', 'IMPLICITFAST', 'IMPLICIT')}"
    )
    spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{one_of(random, 'PYRAMIDAL', 'ELLIPTIC')}")
    touching = random.uniform() < 0.5
    for tree in range(int(random.integers(1, 4))):
        add_tree(spec, random, tree, touching)
    draft = spec.copy().compile()
    _add_springs(spec, draft, random)
    amplitude = _add_servos(spec, draft, random)
    if random.uniform() < 0.25:
        _close_loop(spec, draft, random)
    if random.uniform() < 0.2:
        _add_tendon(spec, draft, random)
    terrain = _terrain(random)
    _set_heights(spec, draft, terrain, random)
    count = len(amplitude)
    return Scene(
        seed=seed,
        spec=spec,
        sand=_sand(random),
        law=one_of(random, *LAWS),
        terrain=terrain,
        velocity=_velocity(draft, random),
        amplitude=amplitude,
        rate=2.0 * math.pi * random.uniform(0.3, 4.0, count),
        phase=random.uniform(0.0, 2.0 * math.pi, count),
    )


def _sand(random: Random) -> Sand:
    return Sand(
        rho_c=random.uniform(1200.0, 1800.0),
        mu_surf=random.uniform(0.2, 0.6),
        xi_n=between(random, 1e5, 2e6),
        lambda_=random.uniform(1.0, 1.5),
    )


def _terrain(random: Random) -> FreeSurface:
    """A level surface, or a slope in three of ten scenes."""
    slope, way = math.radians(random.uniform(0.0, SLOPE)), random.uniform(0.0, 2.0 * math.pi)
    if random.uniform() > 0.3:
        return FreeSurface()
    return FreeSurface(normal=(math.sin(slope) * math.cos(way), math.sin(slope) * math.sin(way), math.cos(slope)))


def _add_springs(spec: mujoco.MjSpec, draft: mujoco.MjModel, random: Random) -> None:
    """Give joints springs, dampers, armature and dry friction, each at random."""
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            continue
        inertia, rate = _inertia(draft, joint.name), 2.0 * math.pi * between(random, *FREQUENCIES)
        shares = random.uniform(size=4)
        if shares[0] < 0.6:
            _set(joint, "damping", 2.0 * between(random, 0.01, 1.0) * rate * inertia)
        if shares[1] < 0.3:
            _set(joint, "stiffness", inertia * rate**2)
        if shares[2] < 0.4:
            joint.armature = between(random, 0.01, 1.0) * inertia
        if shares[3] < 0.2:
            joint.frictionloss = inertia * between(random, 1.0, 100.0)


def _add_servos(spec: mujoco.MjSpec, draft: mujoco.MjModel, random: Random) -> Array:
    """Add servos to most hinges and slides, of position or velocity, and return the amplitudes of their targets."""
    amplitudes = []
    for joint in spec.joints:
        if joint.type not in _MOVED or random.uniform() > 0.7:
            continue
        servo = spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        inertia, rate = _inertia(draft, joint.name), 2.0 * math.pi * between(random, *SERVOS)
        amplitude = between(random, 0.2, 1.5) * (0.1 if joint.type == mujoco.mjtJoint.mjJNT_SLIDE else 1.0)
        if random.uniform() < 0.7:
            servo.set_to_position(kp=inertia * rate**2, kv=2.0 * between(random, 0.05, 1.0) * inertia * rate)
        else:
            servo.set_to_velocity(kv=inertia * rate)
            amplitude *= 5.0
        amplitudes.append(amplitude)
    return np.array(amplitudes)


def _close_loop(spec: mujoco.MjSpec, draft: mujoco.MjModel, random: Random) -> None:
    """Connect a point of the last body with a body of its tree that is not its neighbour, if there is one."""
    last = draft.nbody - 1
    tree = [
        b for b in range(1, last) if draft.body_rootid[b] == draft.body_rootid[last] and b != draft.body_parentid[last]
    ]
    if not tree:
        return
    other = int(tree[random.integers(len(tree))])
    kind, objects = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
    names = {"name1": draft.body(last).name, "name2": draft.body(other).name}
    spec.add_equality(type=kind, objtype=objects, **names).data[:3] = random.uniform(-0.03, 0.03, 3)


def _add_tendon(spec: mujoco.MjSpec, draft: mujoco.MjModel, random: Random) -> None:
    """Span a spring with a damper between two bodies."""
    if draft.nbody < 3:
        return
    ends = 1 + random.choice(draft.nbody - 1, 2, replace=False)
    rate, mass = 2.0 * math.pi * between(random, *FREQUENCIES), 1.0 / draft.body_invweight0[ends, 0].clip(1e-6).sum()
    tendon = spec.add_tendon(name="spring", springlength=[random.uniform(0.0, 0.3)] * 2)
    _set(tendon, "stiffness", mass * rate**2)
    _set(tendon, "damping", 2.0 * between(random, 0.05, 1.0) * mass * rate)
    for end in ends.tolist():
        spec.body(draft.body(end).name).add_site(name=f"end-{end}")
        tendon.wrap_site(f"end-{end}")


def _set_heights(spec: mujoco.MjSpec, draft: mujoco.MjModel, terrain: FreeSurface, random: Random) -> None:
    """Place each tree along the vertical: buried, half in the sand, or above it."""
    data = mujoco.MjData(draft)
    mujoco.mj_forward(draft, data)
    roots = draft.body_rootid[draft.geom_bodyid]
    for root in np.unique(roots).tolist():
        depths, size = terrain.depth(data.geom_xpos[roots == root]), draft.geom_rbound[roots == root]
        falls = draft.body_dofnum[root] == 6
        wanted = random.choice(("buried", "amid", "above"), p=(0.2, 0.4, 0.4) if falls else (0.2, 0.8, 0.0))
        if wanted == "buried":
            lift = (depths - size).min() - random.uniform(0.0, 0.1)
        elif wanted == "amid":
            lift = (depths + size).max() - random.uniform(0.0, 1.0) * (np.ptp(depths) + 2.0 * size.min())
        else:
            lift = (depths + size).max() + random.uniform(0.0, 0.3)
        spec.body(draft.body(root).name).pos[2] += lift / terrain.normal[2]


def _velocity(model: mujoco.MjModel, random: Random) -> Array:
    """Velocities of all joints and spins of free bodies at random, none of them in a fifth of all scenes."""
    scale = random.choice((0.0, 0.5, 1.0, 2.0), p=(0.2, 0.3, 0.4, 0.1))
    velocity: Array = np.zeros(model.nv)
    for joint in range(model.njnt):
        start, kind = model.jnt_dofadr[joint], model.jnt_type[joint]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            velocity[start : start + 6] = scale * random.normal(size=6) * [1.0, 1.0, 1.0, 5.0, 5.0, 5.0]
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            velocity[start] = 0.3 * scale * random.normal()
        else:
            width = 3 if kind == mujoco.mjtJoint.mjJNT_BALL else 1
            velocity[start : start + width] = 3.0 * scale * random.normal(size=width)
    return velocity


def _inertia(draft: mujoco.MjModel, joint: str) -> float:
    """Least inertia that a joint moves in the draft's pose, all others being free [kg or kg m^2]."""
    joint_id = draft.joint(joint).id
    return float(1.0 / draft.dof_invweight0[draft.jnt_dofadr[joint_id]])


def _set(part: "mujoco.MjsJoint | mujoco.MjsTendon", name: str, value: float) -> None:
    """Set a stiffness or damping, of which newer versions of MuJoCo have polynomials."""
    setattr(part, name, value if isinstance(getattr(part, name), float) else [value, 0.0, 0.0])
