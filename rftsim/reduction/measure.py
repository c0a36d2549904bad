"""How far the wrench of a reduced surface is from that of all triangles, over samples.

The error at a pose and motion is

    max(|dF|, |dM| / (L/2)) / max(|F|, |M| / (L/2)),

M about the centre of the body's box, L the body's size, and the denominator the largest over all samples of that depth;
for depths under a tenth of L, of a tenth: a body that just touches is not asked for a share of nothing.
"""

from typing import Final

import numpy as np

from rftsim.law import evaluate, layout
from rftsim.reduction.samples import Numbers, Samples, chosen, middle
from rftsim.surface.triangles import Array, Surface

SHALLOW: Final = 0.1
"""Depth, over the body's size, that lends its scale to lesser ones."""
FIRST: Final = 64
"""Samples, the worst of the last comparison, that are looked at before the others."""


def scaled_wrenches(surface: Surface, bed: Array, samples: Samples) -> Array:
    """Force, and moment about the body's centre over half its size, at each sample [N], shape (n, 6)."""
    body = layout.pack_surface(surface)
    found = evaluate.body_wrenches(bed, body, *samples[1:])
    arm = samples.rotation @ middle(surface)
    moment = found[:, 3:] - np.cross(arm, found[:, :3])
    return np.hstack([found[:, :3], moment / (surface.size / 2)])


def errors(whole: Array, reduced: Array, depth: Array) -> Array:
    """Error of the reduced surface's wrench at each sample [-], shape (n,); see the head of this module."""
    return larger(whole - reduced) / scales(whole, depth)


def larger(wrench: Array) -> Array:
    """The larger of a scaled wrench's force and moment [N], shape (n,)."""
    sides: Array = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).max(axis=1)
    return sides


def scales(whole: Array, depth: Array) -> Array:
    """The wrench that the error at each sample is a share of [N], shape (n,)."""
    length, found = larger(whole), np.empty(len(depth))
    for d in np.unique(depth):
        found[depth == d] = length[depth == max(d, SHALLOW)].max(initial=1e-300)
    return found


class Compared:
    """Samples at which facets are compared with the whole surface of a body, in an order that finds the worst early.

    Args:
        surface: The whole surface.
        bed: Packed sand.
        samples: Poses and motions.
    """

    def __init__(self, surface: Surface, bed: Array, samples: Samples) -> None:
        self.bed, self.samples = bed, samples
        self.whole = scaled_wrenches(surface, bed, samples)
        self.scale = scales(self.whole, samples.depth)
        self.order = np.arange(len(samples.depth))

    def worst(self, facets: Surface, bound: float) -> float:
        """The largest error of facets, or an error above the bound where there is one [-]."""
        found = self._errors(facets, self.order[:FIRST])
        if found.max(initial=0.0) <= bound:
            found = np.append(found, self._errors(facets, self.order[FIRST:]))
        self.order[: len(found)] = self.order[np.argsort(-found, kind="stable")]
        return float(found.max(initial=0.0))

    def _errors(self, facets: Surface, some: Numbers) -> Array:
        found = scaled_wrenches(facets, self.bed, chosen(self.samples, some))
        return larger(self.whole[some] - found) / self.scale[some]
