"""Poses and motions at which a body's wrench is compared, as far as it can take and make them."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim.law import layout
from rftsim.surface.triangles import Array, Surface

Numbers = NDArray[np.intp]
"""Which of the samples or poses, shape (n,)."""

DEPTHS: Final = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
"""Depths of the lowest corner that are sampled, over the body's size."""
HELD_BACK: Final = (0.03, 0.07, 0.1, 0.15, 0.35, 0.7, 1.5)
"""Those at which what passed is checked, with other poses and motions."""
POSES: Final = 40
"""Orientations of a body."""
MOTIONS: Final = 4
"""Motions at each orientation and depth."""
ASIDE: Final = 0.05
"""How far motions lie from the axes: exactly along them the law of a body with symmetries may jump."""


class Reach(NamedTuple):
    """The orientations that a body can take, and the motions that it can make there."""

    rotations: Array
    """Rotations from the body to the world frame, shape (n, 3, 3)."""
    motions: Array
    """Projections of a motion onto those that the joints allow, shape (n, 6, 6): velocity of the body's centre, then
    angular velocity times half the body's size; world frame."""


class Samples(NamedTuple):
    """The poses and motions at which a body's wrench is compared, n of them."""

    depth: Array
    """Depth of the lowest corner over the body's size [-], shape (n,)."""
    position: Array
    """Position of the body's origin [m], shape (n, 3)."""
    rotation: Array
    """Rotation from the body to the world frame, shape (n, 3, 3)."""
    velocity: Array
    """Velocity of the body's origin [m/s], shape (n, 3)."""
    omega: Array
    """Angular velocity, world frame [rad/s], shape (n, 3)."""


def free_reach(seed: int) -> Reach:
    """The reach of a body that is free: any orientation, drawn by a seed, and any motion."""
    return Reach(turned_any_way(POSES, np.random.default_rng(seed)), np.broadcast_to(np.eye(6), (POSES, 6, 6)))


def turned_any_way(count: int, rng: np.random.Generator) -> Array:
    """Rotations drawn evenly among all, shape (count, 3, 3)."""
    quaternions = rng.normal(size=(count, 4))
    return turned_by(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def turned_by(quaternions: Array) -> Array:
    """The rotations of unit quaternions, shape (n, 4), as matrices, (n, 3, 3)."""
    w, vector = quaternions[:, 0, None, None], quaternions[:, 1:]
    cross = np.cross(vector[:, None], np.eye(3)[None]).transpose(0, 2, 1)  # cross @ a = vector x a
    turned: Array = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return turned


def middle(surface: Surface) -> Array:
    """Centre of the box around a surface, body frame [m], shape (3,)."""
    low, high = surface.corners.min(axis=0), surface.corners.max(axis=0)
    return 0.5 * (low + high)  # type: ignore[no-any-return]


def draw(surface: Surface, bed: Array, reach: Reach, depths: tuple[float, ...], seed: int) -> Samples:
    """Samples of each orientation of a body at each depth, with MOTIONS motions each, as far as the joints allow.

    Half of the motions lie near the translations along the three axes and the rotations about them, both ways in turn;
    the others are drawn at random. Speeds are 0.1 to 1 sqrt(g L), which only the dynamic laws notice.

    Args:
        surface: The body's surface.
        bed: Packed sand.
        reach: Orientations and motions of the body.
        depths: Depths of the lowest corner, over the body's size [-].
        seed: Seed of the motions.
    """
    rng = np.random.default_rng(seed)
    sand = layout.record(bed, layout.BED)
    size, up = surface.size, sand.up
    pose, layer = np.divmod(np.repeat(np.arange(len(reach.rotations) * len(depths)), MOTIONS), len(depths))
    motion, kept = _motions(reach.motions, pose, rng)
    pose, depth = pose[kept], np.array(depths)[layer[kept]]
    motion *= math.sqrt(sand.g * size) * rng.uniform(0.1, 1.0, size=(len(motion), 1))
    lowest = ((up @ reach.rotations) @ surface.corners.T).min(axis=1)
    position = (sand.offset - lowest[pose] - depth * size)[:, None] * up
    omega, arm = motion[:, 3:] / (size / 2), reach.rotations @ middle(surface)
    return Samples(depth, position, reach.rotations[pose], motion[:, :3] - np.cross(omega, arm[pose]), omega)


def _motions(allowed: Array, pose: Numbers, rng: np.random.Generator) -> tuple[Array, Numbers]:
    """Motions of length one that are allowed at some poses, (n, 6), and at which of these there is one.

    What is left of a motion that the joints forbid, less than a tenth, is none.
    """
    count = len(pose)
    axes = np.vstack([np.eye(6), -np.eye(6)])
    wanted = rng.normal(size=(count, 6))
    near = np.arange(count) % 2 == 0
    wanted[near] = axes[np.arange(near.sum()) % len(axes)] + ASIDE * wanted[near]
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    motion = np.einsum("nij,nj->ni", allowed[pose], wanted)
    length = np.linalg.norm(motion, axis=1)
    kept = np.flatnonzero(length >= 0.1)
    return motion[kept] / length[kept, None], kept


def chosen(samples: Samples, which: Numbers) -> Samples:
    """Some of the samples, by their numbers."""
    return Samples(*(column[which] for column in samples))


def some_of(samples: Samples, count: int) -> Samples:
    """So many of the samples, or all where they are fewer, spread evenly among them."""
    total = len(samples.depth)
    return chosen(samples, np.unique(np.linspace(0, total - 1, min(count, total)).astype(np.intp)))


def nearness(samples: Samples, up: Array) -> Array:
    """How far apart two centroids are to the sand, see `features`: the identity where a body turns any way.

    Depth differs with their distance along the vertical, velocity with that across the axis of rotation; the mean of
    both over the samples.

    Args:
        samples: Poses and motions.
        up: Normal of the free surface, shape (3,).
    """
    vertical = np.einsum("nji,j->ni", samples.rotation, up)
    axis = np.einsum("nji,nj->ni", samples.rotation, samples.omega)
    axis = axis[axis.any(axis=1)]
    metric = 1.5 * np.einsum("ni,nj->ij", vertical, vertical) / len(vertical)
    if len(axis):
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        metric += 0.75 * (np.eye(3) - np.einsum("ni,nj->ij", axis, axis) / len(axis))
    value, vector = np.linalg.eigh(metric)
    root: Array = (vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T
    return root
