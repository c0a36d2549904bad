"""The fewest facets whose wrench is that of all triangles within a tolerance, over sampled poses and motions.

The error is that of `measure`. What passes is held against other poses, depths and motions, too, where twice the
tolerance is let pass.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from rftsim.law import evaluate, layout
from rftsim.law.layout import BLOCK
from rftsim.reduction.facets import Labels, features, fused, merged, settled, split, spread
from rftsim.reduction.measure import Compared
from rftsim.reduction.samples import DEPTHS, HELD_BACK, Reach, Samples, draw, free_reach, nearness, some_of
from rftsim.surface.triangles import Array, Surface

SEEDS: Final = (0, 1, 2)
DECIDING, CHECKING, STEERING = SEEDS
"""Seeds of the samples that decide, of those held back, and of those that show where facets err."""
STEERED: Final = 896
"""Samples that show where facets err."""
WORST: Final = 24
"""Those of them, the worst, that decide which facets are split."""
FEWEST: Final = 8
"""Facets of the first attempt."""
GROWTH: Final = 1.1, 2.0
"""Facets of the next attempt over those of the last, at least and at most."""
EVEN: Final = 64
"""Facets up to which those are split whose triangles lie farthest apart; it is too early to look at errors."""
FUSED: Final = 0.08, 0.015
"""Share of the facets that pass which are fused with others, at first, and when it is given up."""
CLOSE: Final = 1.3
"""Facets that pass over facets that do not, below which none between are tried."""


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


class Partition(NamedTuple):
    """The triangles of a surface in clusters, and the errors of the facets that these make."""

    labels: Labels
    """Cluster of each triangle of the surface in blocks, see `Surface.clustered`; shape (ntri,)."""
    error: float
    """Largest error over the samples [-]."""
    held_back: float
    """Largest error over the poses, depths and motions that it is checked at [-]."""


def reduced(
    surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach] = free_reach
) -> tuple[Surface, Economy]:
    """The surface in the fewest facets found that keep the error under a tolerance, itself where none do.

    Args:
        surface: The body's surface.
        bed: Packed sand; its law is the one that is kept.
        tolerance: Largest error [-].
        reach: Gives orientations and motions of the body, by a seed.
    """
    return put_together(surface, partition(surface, bed, tolerance, reach))


def partition(surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach]) -> Partition:
    """The fewest clusters found whose facets keep the error under a tolerance; arguments as of `reduced`."""
    surface = surface.clustered(BLOCK)
    found = _Search(surface, bed, tolerance, reach).fewest() if surface.ntri > BLOCK else None
    if found is None:
        return Partition(np.arange(surface.ntri), 0.0, 0.0)
    return Partition(found.labels, found.error, found.held_back)


def put_together(surface: Surface, found: Partition) -> tuple[Surface, Economy]:
    """The surface of a facet for each cluster, in blocks, and its numbers; itself where each is of one triangle."""
    surface = surface.clustered(BLOCK)
    facets = merged(surface, found.labels) if found.labels.max() + 1 < surface.ntri else surface
    return facets.clustered(BLOCK), Economy(surface.ntri, facets.ntri, found.error, found.held_back)


def _drawn(
    surface: Surface, bed: Array, reach: Callable[[int], Reach], seed: int, depths: tuple[float, ...]
) -> Samples:
    return draw(surface, bed, reach(seed), depths, seed)


class _Attempt(NamedTuple):
    """Facets, the clusters that they stand for, and their errors."""

    labels: Labels
    facets: Surface
    error: float
    held_back: float


class _Search:
    """The search for the fewest facets; arguments as of `reduced`.

    Facets are split whose own force errs most in the poses and motions of a third draw. So neither the samples that
    decide nor those held back have been seen.
    """

    def __init__(self, surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach]) -> None:
        self.bed, self.tolerance = bed, tolerance
        self.drawn = functools.partial(_drawn, surface, bed, reach)
        corners = surface.corners
        self.surface = dataclasses.replace(surface, outline=np.array([corners.min(axis=0), corners.max(axis=0)]))
        self.packed = layout.pack_surface(surface)
        self.forces: dict[int, Array] = {}
        self.deciding = Compared(self.surface, bed, self.drawn(DECIDING, DEPTHS))
        self.steering = Compared(self.surface, bed, some_of(self.drawn(STEERING, DEPTHS), STEERED))
        self.points = features(surface, nearness(self.deciding.samples, layout.record(bed, layout.BED).up))

    @functools.cached_property
    def checking(self) -> Compared:
        """The samples held back, not drawn before something passes."""
        return Compared(self.surface, self.bed, self.drawn(CHECKING, HELD_BACK))

    def fewest(self) -> _Attempt | None:
        """The fewest facets found that pass; None where no fewer than the triangles do."""
        found = self._divided()
        return None if found is None else self._thinned(found)

    def _divided(self) -> _Attempt | None:
        """The fewest that pass of ever more facets, then between the last that do not and those; None as above."""
        failed, count = self._attempt(np.zeros(self.surface.ntri, dtype=np.intp)), FEWEST
        passed = None
        while passed is None:
            tried = self._grown(failed, count)
            if tried is None:
                return None
            if self._passes(tried):
                passed = tried
            else:
                failed = tried
                factor = min(max(math.sqrt(tried.error / self.tolerance), GROWTH[0]), GROWTH[1])
                count = max(math.ceil(factor * tried.facets.ntri), count + 1)  # some clusters may be lost in settling
        while passed.facets.ntri > CLOSE * failed.facets.ntri:
            tried = self._grown(failed, int(math.sqrt(passed.facets.ntri * failed.facets.ntri)))
            if tried is None or not failed.facets.ntri < tried.facets.ntri < passed.facets.ntri:
                break
            passed, failed = (tried, failed) if self._passes(tried) else (passed, tried)
        return passed

    def _thinned(self, passed: _Attempt) -> _Attempt:
        """Fewer facets that pass, in the samples that show where facets err too: those that err least are fused."""
        share, given_up = FUSED
        while share > given_up and passed.facets.ntri > 1:
            costs = self._shares(passed.labels, passed.facets)
            places = self.points, self.surface.areas
            tried = self._attempt(fused(passed.labels, math.ceil(share * passed.facets.ntri), costs, *places))
            if self._passes(tried) and self.steering.worst(tried.facets, self.tolerance) <= self.tolerance:
                passed = tried
            else:
                share /= 2
        return passed

    def _passes(self, tried: _Attempt) -> bool:
        return tried.error <= self.tolerance and tried.held_back <= 2 * self.tolerance

    def _attempt(self, labels: Labels) -> _Attempt:
        facets = merged(self.surface, labels)
        error, held_back = self.deciding.worst(facets, self.tolerance), 0.0
        if error <= self.tolerance:
            held_back = self.checking.worst(facets, 2 * self.tolerance)
        return _Attempt(labels, facets, error, held_back)

    def _grown(self, tried: _Attempt, count: int) -> _Attempt | None:
        """An attempt of about so many facets; None where they would not be fewer than the triangles."""
        labels, facets = tried.labels, tried.facets
        while (lacking := count - facets.ntri) > 0:
            if count >= self.surface.ntri:
                return None
            places = self.points, self.surface.areas
            shares = spread(labels, *places) if facets.ntri < EVEN else self._shares(labels, facets)
            labels = split(labels, np.argsort(-shares, kind="stable")[:lacking], *places)
            if labels.max() + 1 == facets.ntri:
                return None
            facets = merged(self.surface, labels)
        return self._attempt(settled(labels, self.points, self.surface.areas))

    def _shares(self, labels: Labels, facets: Surface) -> Array:
        """Each facet's part in the error of the wrench, (nfacet,): squares of the errors of its own force, summed."""
        self.steering.worst(facets, math.inf)
        packed, share = layout.pack_surface(facets), np.zeros(facets.ntri)
        for sample in self.steering.order[:WORST].tolist():
            coarse = self._stresses(packed, sample).T * facets.areas
            for fine, own in zip(self._forces(sample), coarse, strict=True):
                share += ((np.bincount(labels, fine) - own) / self.steering.scale[sample]) ** 2
        return share

    def _forces(self, sample: int) -> Array:
        """Force on each triangle of the whole surface at a steering sample [N], body frame, (3, ntri)."""
        if sample not in self.forces:
            self.forces[sample] = np.ascontiguousarray(self._stresses(self.packed, sample).T * self.surface.areas)
        return self.forces[sample]

    def _stresses(self, packed: Array, sample: int) -> Array:
        return evaluate.triangle_stresses(self.bed, packed, *(x[sample] for x in self.steering.samples[1:]))[0]
