"""The fewest facets whose wrench is that of all triangles within a tolerance, over sampled poses and motions.

The error at a pose and motion is

    max(|dF|, |dM| / (L/2)) / max(|F|, |M| / (L/2)),

M about the centre of the body's box, L the body's size, and the denominator the largest over all samples of that depth;
for depths under a tenth of L, of a tenth: a body that just touches is not asked for a share of nothing. What passes is
held against other poses, depths and motions, too, where twice the tolerance is let pass.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rftsim import native, packed
from rftsim.facets import Labels, bisections, clusters, features, merged
from rftsim.packed import BLOCK
from rftsim.surface import Array, Surface

DEPTHS: Final = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
"""Depths of the lowest corner that are sampled, over the body's size."""
HELD_BACK: Final = (0.03, 0.07, 0.1, 0.15, 0.35, 0.7, 1.5)
"""Those at which what passed is checked, with other poses and motions."""
SHALLOW: Final = 0.1
"""Depth, over the body's size, that lends its scale to lesser ones."""
POSES: Final = 16
"""Orientations of a body."""
MOTIONS: Final = 18
"""Motions at each orientation and depth."""


class Reach(NamedTuple):
    """Orientations that a body can take, and how it can move there."""

    rotations: Array
    """To the world frame, (n, 3, 3)."""
    motions: Array
    """Projections of a motion onto those that the joints allow, (n, 6, 6): velocity of the body's centre, then angular
    velocity times half the body's size; world frame."""


class Samples(NamedTuple):
    """Poses and motions."""

    depth: Array
    """Of the lowest corner, over the body's size, (n,)."""
    position: Array
    """Of the body's origin [m], (n, 3)."""
    rotation: Array
    """To the world frame, (n, 3, 3)."""
    velocity: Array
    """Of the body's origin [m/s], (n, 3)."""
    omega: Array
    """[rad/s], (n, 3)."""


class Economy(NamedTuple):
    """What a body's surface was reduced to."""

    triangles: int
    """Of the whole surface."""
    elements: int
    """That the sand feels."""
    error: float
    """Largest over the samples."""
    held_back: float
    """Largest over the poses, depths and motions that it is checked at."""


def free_reach(count: int, seed: int) -> Reach:
    """Any orientation and any motion."""
    rotations = Rotation.random(count, random_state=np.random.default_rng(seed)).as_matrix()
    return Reach(rotations, np.broadcast_to(np.eye(6), (count, 6, 6)))


def middle(surface: Surface) -> Array:
    """Centre of a surface's box [m], (3,)."""
    low, high = surface.corners.min(axis=0), surface.corners.max(axis=0)
    return 0.5 * (low + high)  # type: ignore[no-any-return]


def draw(surface: Surface, sand: Array, reach: Reach, depths: tuple[float, ...], seed: int) -> Samples:
    """Each orientation at each depth with MOTIONS motions.

    Translations and rotations about the body's centre along the three axes, both ways, as far as the joints allow, and
    as many drawn at random; at speeds of 0.1 to 1 sqrt(g L), which only the dynamic laws notice.

    Args:
        surface: The body's.
        sand: Packed.
        reach: Its orientations and motions.
        depths: Of the lowest corner, over the body's size.
        seed: Of what is drawn.
    """
    rng = np.random.default_rng(seed)
    size, centre, up, g = surface.size, middle(surface), sand[3:6], sand[15]
    rows: list[tuple[float, Array, Array, Array, Array]] = []
    for rotation, allowed in zip(reach.rotations, reach.motions, strict=True):
        lowest = float((surface.corners @ rotation.T @ up).min())
        for depth in depths:
            position = (sand[6] - lowest - depth * size) * up
            wanted = np.vstack([np.eye(6), -np.eye(6), rng.normal(size=(MOTIONS - 12, 6))])
            for motion in wanted / np.linalg.norm(wanted, axis=1, keepdims=True) @ allowed.T:
                length = np.linalg.norm(motion)
                if length < 0.1:  # what is left of a motion that the joints forbid
                    continue
                motion = motion / length * math.sqrt(g * size) * rng.uniform(0.1, 1.0)
                omega = motion[3:] / (size / 2)
                rows.append((depth, position, rotation, motion[:3] - np.cross(omega, rotation @ centre), omega))
    return Samples(*(np.array(column) for column in zip(*rows, strict=True)))


def wrenches(surface: Surface, sand: Array, samples: Samples) -> Array:
    """Force, and moment about the body's centre over half its size, (n, 6) [N]."""
    body = packed.pack_surface(surface)
    found = native.wrenches(sand, body, *samples[1:])
    arm = samples.rotation @ middle(surface)
    moment = found[:, 3:] - np.cross(arm, found[:, :3])
    return np.hstack([found[:, :3], moment / (surface.size / 2)])


def errors(whole: Array, reduced: Array, depth: Array) -> Array:
    """Error at each sample, (n,); see above."""

    def larger(wrench: Array) -> Array:
        sides: Array = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).max(axis=1)
        return sides

    scale = {d: larger(whole[depth == max(d, SHALLOW)]).max() for d in np.unique(depth)}
    return larger(whole - reduced) / np.maximum([scale[d] for d in depth], 1e-300)


def reduced(surface: Surface, sand: Array, tolerance: float, reach: Reach, other: Reach) -> tuple[Surface, Economy]:
    """The surface in the fewest blocks of facets that keep the error under a tolerance; itself where none do.

    Args:
        surface: A body's.
        sand: Packed; its law is the one that is kept.
        tolerance: Largest error.
        reach: Orientations and motions that are sampled.
        other: Those that what passed is checked at.
    """
    surface = surface.clustered(BLOCK)
    samples, checks = draw(surface, sand, reach, DEPTHS, 0), draw(surface, sand, other, HELD_BACK, 1)
    whole, checked = wrenches(surface, sand, samples), wrenches(surface, sand, checks)
    points, cuts = features(surface, _nearness(samples, sand[3:6])), list[Labels]()

    def attempt(blocks: int) -> tuple[Surface, float, float]:
        nonlocal cuts
        if len(cuts) < blocks * BLOCK:
            cuts = bisections(points, surface.areas, 2 * blocks * BLOCK)
        facets = merged(surface, clusters(points, surface.areas, cuts, blocks * BLOCK)).clustered(BLOCK)
        error = errors(whole, wrenches(facets, sand, samples), samples.depth).max()
        held_back = errors(checked, wrenches(facets, sand, checks), checks.depth).max()
        return facets, float(error), float(held_back)

    failed, passed, best = 0, -(-surface.ntri // BLOCK), (surface, 0.0, 0.0)
    while passed - failed > 1:
        blocks = min(max(2 * failed, 1), (failed + passed) // 2)
        found = attempt(blocks)
        if found[1] <= tolerance and found[2] <= 2 * tolerance:
            passed, best = blocks, found
        else:
            failed = blocks
    return best[0], Economy(surface.ntri, best[0].ntri, *best[1:])


def _nearness(samples: Samples, up: Array) -> Array:
    """How far apart two centroids are to the sand, see `features`: the identity where a body turns any way.

    Depth differs with their distance along the vertical, velocity with that across the axis of rotation; the mean of
    both over the samples.
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
