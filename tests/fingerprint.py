"""Hashes of what every shipped scene, law and force, the environments and a batch compute: equal bits, equal hashes.

python tests/fingerprint.py > before.json        # then, after a change
python tests/fingerprint.py --against before.json
"""

import argparse
import hashlib
import itertools
import json
import sys
import warnings
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import rftsim_envs

import rftsim
from rftsim.bench.hard_cases import CASES
from rftsim.bench.stability import play
from rftsim.run.scenes import SCENES, stage

DURATION = 0.25
"""Simulated time of a scene [s]."""
ACTIONS = 40
"""Steps of an environment."""


def hashed(*arrays):
    """Twelve digits of the SHA-256 of arrays' bytes."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(a, dtype=float).tobytes() for a in arrays)).hexdigest()[:12]


def scenes():
    """Every shipped scene under every law that it can have, and force: positions, velocities, sensors, tractions."""
    for name, law, force in itertools.product(SCENES, rftsim.LAWS, ("implicit", "explicit")):
        if name == "intruder" and rftsim.LAWS[law].planar:
            continue  # it is free to leave the plane
        staged = stage(name, law=law, force=force, timestep=2e-3)
        model = staged.model
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        seen = []
        while data.time < DURATION:
            mujoco.mj_step(model, data)
            seen.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
        body = next(iter(staged.bed.surfaces))
        stress = rftsim.tractions(model, data, body).stress
        yield f"{name}, {law}, {force}", hashed(*seen, stress)


def environments():
    """Every environment, alone and four at once: observations, rewards and ends of random actions."""
    for name in rftsim_envs.IDS:
        for kind in ("one", "batch"):
            yield f"{name}, {kind}", _played(name, kind)


def _played(name, kind):
    env = (
        gymnasium.make(name)
        if kind == "one"
        else gymnasium.make_vec(name, num_envs=4, vectorization_mode="vector_entry_point")
    )
    seen = [env.reset(seed=3)[0]]
    env.action_space.seed(5)
    for _ in range(ACTIONS):
        seen.extend(env.step(env.action_space.sample())[:3])
    env.close()
    return hashed(*seen)


def solids():
    """A disc in random motions under every law: force, moment, stresses and depths."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 2 * np.pi, 9)[:-1]
    ring = np.column_stack([0.05 * np.cos(t), 0.05 * np.sin(t), np.zeros(8)])
    half = np.array([0.0, 0.0, 0.02])
    top, bottom = ring + half, ring - half
    points = np.vstack([top, bottom, [half, -half]])
    faces = []
    for k in range(8):
        n = (k + 1) % 8
        faces += [[k, 8 + k, 8 + n], [k, 8 + n, n], [16, k, n], [17, 8 + n, 8 + k]]
    surface = rftsim.make_surface(points, faces).refined(0.01)
    for law in rftsim.LAWS:
        seen = []
        for _ in range(20):
            q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            q *= np.sign(np.linalg.det(q))
            found = rftsim.surface_force(
                surface,
                rftsim.PRESETS["poppy-seeds"],
                law,
                position=(0, 0, -0.03),
                rotation=q,
                velocity=rng.normal(size=3),
                angular_velocity=rng.normal(size=3),
            )
            seen += [found.force, found.moment, found.stress, found.depth]
        yield f"solid, {law}", hashed(*seen)


def hard_cases():
    """The cases of `rftsim bench stability` at 5 ms, short ones: constraints, contacts, cones, servos, impacts."""
    for name in CASES:
        for force in ("implicit", "explicit"):
            played = play(name, 5e-3, force, resting=0.5)
            yield f"{name}, {force}", hashed(list(played.measured.values()), [played.evaluations])


def main():
    """Print the hashes, or compare them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    found = {}
    for name, digest in itertools.chain(solids(), scenes(), environments(), hard_cases()):
        found[name] = digest
        print(f"{digest}  {name}", file=sys.stderr)
    if asked.against is None:
        print(json.dumps(found, indent=1))
        return
    before = json.loads(asked.against.read_text())
    differ = [name for name in before if found.get(name) != before[name]]
    print(f"{len(before) - len(differ)} of {len(before)} equal")
    for name in differ:
        print(f"differs: {name}")
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
