"""Trees of bodies drawn at random: their joints and their geoms."""

import math
from typing import Final

import mujoco
import numpy as np

from rftsim.surface.triangles import Array

Random = np.random.Generator
"""A source of random numbers."""
SIZES: Final = (0.02, 0.15)
"""Smallest and largest edge or diameter of a geom [m]."""
DENSITIES: Final = (300.0, 3000.0)
"""Range of the density of a geom [kg/m^3]."""
MASSES: Final = (0.01, 5.0)
"""Range that the mass of a geom is kept in [kg]."""
APART: Final = 0.3
"""Distance of the trees along x and y [m]."""


_JOINTS: Final = {
    (mujoco.mjtJoint.mjJNT_HINGE,): 0.5,
    (mujoco.mjtJoint.mjJNT_BALL,): 0.2,
    (mujoco.mjtJoint.mjJNT_SLIDE,): 0.15,
    (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_HINGE): 0.1,
    (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE): 0.05,
}
_SHAPES: Final = tuple(
    getattr(mujoco.mjtGeom, f"mjGEOM_{name}") for name in ["BOX", "SPHERE", "CAPSULE", "CYLINDER", "ELLIPSOID"]
)


def add_tree(spec: mujoco.MjSpec, random: Random, tree: int, touching: bool) -> None:
    """Add a tree of up to eight bodies to a model: free, on a slide, or fixed to the world.

    Args:
        spec: The model; changed in place.
        random: The source of all that is drawn.
        tree: The number of the tree, from which its place and its names follow.
        touching: Whether its bodies collide, all but neighbours.
    """
    base = random.choice(("free", "slide", "fixed"), p=(0.8, 0.1, 0.1))
    place = [APART * (tree % 2), APART * (tree // 2), 0.0]
    body = spec.worldbody.add_body(name=f"{tree}-0", pos=place, quat=_attitude(random))
    if base == "free":
        body.add_freejoint(name=f"{tree}-0")
    elif base == "slide":
        body.add_joint(name=f"{tree}-0", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=direction(random))
    bodies, sizes = [body], [_add_geom(body, random, touching)]
    for i in range(1, int(random.integers(2 if base == "fixed" else 1, 9))):
        parent = int(random.integers(max(0, i - 3), i))
        body = bodies[parent].add_body(name=f"{tree}-{i}", quat=_attitude(random))
        size = _add_geom(body, random, touching)
        body.pos = 0.8 * (sizes[parent] + size) * direction(random)
        kinds = list(_JOINTS)
        for k, kind in enumerate(kinds[random.choice(len(kinds), p=list(_JOINTS.values()))]):
            name, hub = f"{tree}-{i}{'ab'[k]}", 0.7 * random.uniform(-size, size, 3)
            _limit(body.add_joint(name=name, type=kind, axis=direction(random), pos=hub), random)
        bodies.append(body)
        sizes.append(size)


def _add_geom(body: mujoco.MjsBody, random: Random, touching: bool) -> float:
    """Add a geom to a body, and return half its length [m]; sometimes a second one beside it."""
    kind, half = _SHAPES[random.integers(len(_SHAPES))], 0.5 * between(random, *SIZES)
    size = np.maximum(half * random.uniform(0.15, 1.0, 3), 0.5 * SIZES[0])
    size[random.integers(3)] = half
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        size[:2] = max(min(size[0], 0.5 * half), 0.5 * SIZES[0]), half
    volume = _volume(kind, size)
    mass = float(np.clip(between(random, *DENSITIES) * volume, *MASSES))
    body.add_geom(type=kind, size=size, mass=mass, contype=touching, conaffinity=touching)
    if random.uniform() < 0.15:
        ball = [max(0.4 * half, 0.5 * SIZES[0]), 0.0, 0.0]
        at = half * direction(random)
        body.add_geom(size=ball, pos=at, mass=MASSES[0], contype=touching, conaffinity=touching)
    return half


def _volume(kind: mujoco.mjtGeom, size: Array) -> float:
    """Volume of a geom [m^3], by MuJoCo's sizes."""
    a, b, c = size.tolist()
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return float(8.0 * a * b * c)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return float(4.0 / 3.0 * math.pi * a**3)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return float(4.0 / 3.0 * math.pi * a * b * c)
    ends = 4.0 / 3.0 * math.pi * a**3 if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
    return float(2.0 * math.pi * a * a * b + ends)


def _limit(joint: mujoco.MjsJoint, random: Random) -> None:
    """Limit the range of a joint in four of ten."""
    if random.uniform() > 0.4:
        return
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    ends = random.uniform(0.2, 1.5, 2)
    if joint.type == mujoco.mjtJoint.mjJNT_BALL:
        joint.range = [0.0, ends[0]]
    else:
        joint.range = (0.05 if joint.type == mujoco.mjtJoint.mjJNT_SLIDE else 1.0) * np.array([-ends[0], ends[1]])


def between(random: Random, low: float, high: float) -> float:
    """A number between two, drawn log-uniformly."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def direction(random: Random) -> Array:
    """A unit vector in any direction, evenly."""
    vector: Array = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def _attitude(random: Random) -> Array:
    quaternion: Array = random.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def one_of(random: Random, *names: str) -> str:
    """One of some names, each as likely."""
    return names[random.integers(len(names))]
