"""The fewest facets whose wrench is that of all triangles within a tolerance, over sampled poses and motions.

The error at a pose and motion is

    max(|dF|, |dM| / (L/2)) / max(|F|, |M| / (L/2)),

M about the centre of the body's box, L the body's size, and the denominator the largest over all samples of that depth;
for depths under a tenth of L, of a tenth: a body that just touches is not asked for a share of nothing. What passes is
held against other poses, depths and motions, too, where twice the tolerance is let pass.
"""

import math
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np

from rftsim.law import evaluate, layout
from rftsim.law.layout import BLOCK
from rftsim.reduction.facets import Labels, features, merged, settled, split
from rftsim.surface.triangles import Array, Surface

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

GROWTH: Final = 1.2
"""Facets of the next attempt over those of the last."""
STEERING: Final = 400
"""Samples that are drawn anew for each attempt, to see where facets err."""
WORST: Final = 64
"""Those of them, the worst, that decide which facets are split."""
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


class Economy(NamedTuple):
    """The numbers of a body's surface before and after it was reduced, and its errors."""

    triangles: int
    """Number of triangles of the whole surface."""
    elements: int
    """Number of elements that stand for them."""
    error: float
    """Largest error over the samples [-]."""
    held_back: float
    """Largest error over the poses, depths and motions that it is checked at [-]."""


def free_reach(seed: int) -> Reach:
    """The reach of a body that is free: any orientation, drawn by a seed, and any motion."""
    from scipy.spatial.transform import Rotation  # not at start-up, see `facets`

    rotations = Rotation.random(POSES, random_state=np.random.default_rng(seed)).as_matrix()
    return Reach(rotations, np.broadcast_to(np.eye(6), (POSES, 6, 6)))


def middle(surface: Surface) -> Array:
    """Centre of the box around a surface, body frame [m], shape (3,)."""
    low, high = surface.corners.min(axis=0), surface.corners.max(axis=0)
    return 0.5 * (low + high)  # type: ignore[no-any-return]


def draw(surface: Surface, bed: Array, reach: Reach, depths: tuple[float, ...], seed: int) -> Samples:
    """Samples of each orientation of a body at each depth, with MOTIONS motions each.

    Near the translations along the three axes and the rotations about them, both ways, and others drawn at random, as
    far as the joints allow; at speeds of 0.1 to 1 sqrt(g L), which only the dynamic laws notice.

    Args:
        surface: The body's surface.
        bed: Packed sand.
        reach: Orientations and motions of the body.
        depths: Depths of the lowest corner, over the body's size [-].
        seed: Seed of the motions.
    """
    rng = np.random.default_rng(seed)
    sand = layout.record(bed, layout.BED)
    size, centre, up, g = surface.size, middle(surface), sand.up, sand.g
    rows: list[tuple[float, Array, Array, Array, Array]] = []
    for rotation, allowed in zip(reach.rotations, reach.motions, strict=True):
        lowest = float((surface.corners @ rotation.T @ up).min())
        for depth in depths:
            position = (sand.offset - lowest - depth * size) * up
            for motion in _motions(allowed, math.sqrt(g * size), rng):
                omega = motion[3:] / (size / 2)
                rows.append((depth, position, rotation, motion[:3] - np.cross(omega, rotation @ centre), omega))
    return Samples(*(np.array(column) for column in zip(*rows, strict=True)))


def _motions(allowed: Array, fastest: float, rng: np.random.Generator) -> Iterator[Array]:
    """Allowed motions of a tenth of the fastest speed to all of it, (6,) each, those near the axes first."""
    axes = np.vstack([np.eye(6), -np.eye(6)]) + rng.normal(scale=ASIDE, size=(12, 6))
    wanted = np.vstack([axes, rng.normal(size=(MOTIONS - 12, 6))])
    for motion in wanted / np.linalg.norm(wanted, axis=1, keepdims=True) @ allowed.T:
        length = np.linalg.norm(motion)
        if length >= 0.1:  # less is what is left of a motion that the joints forbid
            yield motion / length * fastest * rng.uniform(0.1, 1.0)


def scaled_wrenches(surface: Surface, bed: Array, samples: Samples) -> Array:
    """Force, and moment about the body's centre over half its size, at each sample [N], shape (n, 6)."""
    body = layout.pack_surface(surface)
    found = evaluate.body_wrenches(bed, body, *samples[1:])
    arm = samples.rotation @ middle(surface)
    moment = found[:, 3:] - np.cross(arm, found[:, :3])
    return np.hstack([found[:, :3], moment / (surface.size / 2)])


def errors(whole: Array, reduced: Array, depth: Array) -> Array:
    """Error of the reduced surface's wrench at each sample [-], shape (n,); see the head of this module."""
    return _larger(whole - reduced) / _scales(whole, depth)


def _larger(wrench: Array) -> Array:
    sides: Array = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).max(axis=1)
    return sides


def _scales(whole: Array, depth: Array) -> Array:
    """The wrench that the error at each sample is a share of [N], (n,)."""
    scale = {d: _larger(whole[depth == max(d, SHALLOW)]).max() for d in np.unique(depth)}
    found: Array = np.maximum([scale[d] for d in depth], 1e-300)
    return found


def reduced(
    surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach] = free_reach
) -> tuple[Surface, Economy]:
    """The surface in the fewest facets found that keep the error under a tolerance, itself where none do.

    From a few facets on, those are split whose own force errs most in poses and motions that are drawn anew for each
    attempt. So neither those that decide nor those held back have been seen.

    Args:
        surface: The body's surface.
        bed: Packed sand; its law is the one that is kept.
        tolerance: Largest error [-].
        reach: Gives orientations and motions of the body, by a seed.
    """
    surface = surface.clustered(BLOCK)
    areas = surface.areas
    samples, checks = draw(surface, bed, reach(0), DEPTHS, 0), draw(surface, bed, reach(1), HELD_BACK, 1)
    whole, checked = scaled_wrenches(surface, bed, samples), scaled_wrenches(surface, bed, checks)
    points = features(surface, _nearness(samples, layout.record(bed, layout.BED).up))
    labels: Labels = np.zeros(surface.ntri, dtype=np.intp)
    full = -(-surface.ntri // BLOCK)
    blocks, attempt = 0.5 if full > 1 else full, 2
    while blocks < full:
        while (lacking := int(blocks * BLOCK) - (int(labels.max()) + 1)) > 0:
            facets = merged(surface, labels)
            drawn = draw(surface, bed, reach(attempt), DEPTHS, attempt)
            some = np.random.default_rng(attempt).permutation(len(drawn.depth))[:STEERING]
            share = _shares(surface, facets, labels, bed, Samples(*(x[some] for x in drawn)))
            grown = split(labels, np.argsort(-share)[:lacking], points, areas)
            attempt += 1
            if grown.max() == labels.max():
                return surface, Economy(surface.ntri, surface.ntri, 0.0, 0.0)
            labels = grown
        labels = settled(labels, points, areas)
        facets = merged(surface, labels)
        error = errors(whole, scaled_wrenches(facets, bed, samples), samples.depth).max()
        if error <= tolerance:
            held_back = errors(checked, scaled_wrenches(facets, bed, checks), checks.depth).max()
            if held_back <= 2 * tolerance:
                return facets.clustered(BLOCK), Economy(surface.ntri, facets.ntri, float(error), float(held_back))
        blocks = max(2 * blocks, 1) if blocks < 2 else int(GROWTH * blocks) + 1
    return surface, Economy(surface.ntri, surface.ntri, 0.0, 0.0)


def _shares(surface: Surface, facets: Surface, labels: Labels, bed: Array, samples: Samples) -> Array:
    """Each facet's part in the error of the wrench, (nfacet,): squares of the errors of its own force, summed."""
    bodies = layout.pack_surface(surface), layout.pack_surface(facets)
    whole, reduced = (scaled_wrenches(body, bed, samples) for body in (surface, facets))
    scale = _scales(whole, samples.depth)
    share = np.zeros(facets.ntri)
    for sample in np.argsort(-_larger(whole - reduced) / scale)[:WORST]:
        fine, coarse = (evaluate.triangle_stresses(bed, body, *(x[sample] for x in samples[1:]))[0] for body in bodies)
        force = [np.bincount(labels, column) for column in (fine * surface.areas[:, None]).T]
        share += ((force - (coarse * facets.areas[:, None]).T) ** 2).sum(axis=0) / scale[sample] ** 2
    return share


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
