"""The cost of a triangle: the compiled loop by size, against NumPy, and against the arithmetic of this machine."""

import functools
import importlib.util
import math
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

import numpy as np

from rftsim.law.evaluate import handle
from rftsim.law.laws import get_law
from rftsim.law.layout import BLOCK, COLUMNS, pack_bed, pack_surface
from rftsim.law.leading import leads
from rftsim.reduction.samples import middle
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.surface import solids
from rftsim.surface.triangles import Array, Surface

SIZES: Final = (16, 64, 256, 1024, 4096, 20480, 81920, 327680, 1048576)
"""Triangles of the bodies."""
LINEAR: Final = 1000
"""Sizes from here on count for the exponent."""
SHORTEST: Final = 2e-3
"""Time that one measurement takes at least [s]."""
LITERAL: Final = 100_000
"""Sizes up to here are timed in NumPy, too."""
ROUNDS: Final = 30
"""Repetitions of each measurement, of which the fastest counts."""
SAND: Final = Sand(xi_n=2e5, mu_surf=0.4)
LAW: Final = "rft3d"
_OPERATIONS: Final = 64
"""On each number of the arithmetic loop."""
_ROOTS: Final = 2
"""Square roots of the law for each triangle, from which follows how many the loop takes at a time."""


class Cost(NamedTuple):
    """The cost of a body of one size."""

    triangles: int
    seconds: float
    """An evaluation of force and moment, every triangle buried; the least of ROUNDS, processor time."""
    oracle_seconds: float
    """The same in the tests' NumPy; nan where it was not measured."""
    bytes: int
    """Size of the packed body in memory."""
    leading: float
    """Share of the triangles that lead; the law is evaluated on no others."""

    @property
    def nanoseconds(self) -> float:
        """The time of one triangle [ns], each body's divided by their number."""
        return 1e9 * self.seconds / self.triangles

    @property
    def ratio(self) -> float:
        """NumPy's time over that of the compiled loop."""
        return self.oracle_seconds / self.seconds

    @property
    def memory(self) -> float:
        """Bytes of the packed body over those of centroids, normals and areas."""
        return self.bytes / (8 * COLUMNS * self.triangles)


class Arithmetic(NamedTuple):
    """The least that the law's arithmetic takes of this processor."""

    operations: float
    """Floating-point operations of the compiled loop for each triangle; a fused multiplication and addition is one."""
    nanoseconds: float
    """Time of as many fused multiplications and additions that do not wait for one another."""


def measure(sizes: tuple[int, ...], oracle: ModuleType | None, report: Callable[[str], Any]) -> list[Cost]:
    """Time a buried sphere of each size as it moves and turns.

    All are timed in turn, again and again, so that a busy machine slows all of them; the least time counts.

    Args:
        sizes: Triangles of the spheres.
        oracle: The tests' laws in NumPy, if they are to be timed, too.
        report: Called with what is done, ROUNDS times.
    """
    from rftsim.bench import loops  # which numba compiles

    bed = pack_bed(SAND, get_law(LAW), FreeSurface(), (0.0, 1.0, 0.0))
    sand = handle(bed)
    works: list[Callable[[int], Any]] = []
    bodies = []
    for size in sizes:
        surface = _ball(size)
        body = pack_surface(surface)
        bodies.append((body.nbytes, _leading(surface)))
        works.append(functools.partial(loops.evaluate, sand, body, *_motion(surface), np.empty(6)))
        if oracle is not None and size <= LITERAL:
            works.append(functools.partial(_literal, oracle, surface))
    seconds = iter(_least(works, report))
    costs = []
    for size, told in zip(sizes, bodies, strict=True):
        costs.append(
            Cost(size, next(seconds), next(seconds) if oracle is not None and size <= LITERAL else math.nan, *told)
        )
    return costs


def arithmetic() -> Arithmetic:
    """The law's operations, counted in the machine code of its loop, and the time that they take at least."""
    from rftsim.bench import loops  # which numba compiles

    bed = pack_bed(SAND, get_law(LAW), FreeSurface(), (0.0, 1.0, 0.0))
    sand = handle(bed)
    surface = _ball(BLOCK)
    body = pack_surface(surface)
    loops.law_loop(sand, body, *_motion(surface))
    operations = _count(next(iter(loops.law_loop.inspect_asm().values())))
    numbers = np.linspace(0.0, 0.5, 512)
    (seconds,) = _least([functools.partial(loops.polynomials, numbers, np.empty(numbers.size))], lambda _: None)
    return Arithmetic(operations, 1e9 * operations * seconds / (numbers.size * _OPERATIONS))


def exponent(costs: list[Cost]) -> float:
    """Power of the number of triangles that the time grows with."""
    large = [cost for cost in costs if cost.triangles >= LINEAR]
    if len(large) < 2:
        return math.nan
    size, seconds = np.log([(cost.triangles, cost.seconds) for cost in large]).T
    slope: float = np.polyfit(size, seconds, 1)[0]
    return float(slope)


def load_oracle(path: Path) -> ModuleType | None:
    """The tests' second implementation of the laws, or None where the file is missing."""
    if not path.is_file():
        return None
    specification = importlib.util.spec_from_file_location("oracle", path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.path.insert(0, str(path.parent))  # it reads the tables as printed, which lie beside it
    try:
        specification.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def _ball(size: int) -> Surface:
    """`size` triangles of a sphere of 0.1 m."""
    level = max(math.ceil(math.log(size / 20, 4)), 0)
    return Surface(0.1 * solids.ball(level)[:size]).clustered(BLOCK)


def _motion(surface: Surface) -> tuple[Array, Array, Array, Array]:
    """A pose deep in the sand, velocity and angular velocity."""
    position = np.array([0.0, 0.0, -1.0]) - middle(surface)
    return position, np.eye(3).ravel(), np.array([0.3, 0.2, -1.0]), np.array([1.0, 2.0, 3.0])


def _leading(surface: Surface) -> float:
    _, _, velocity, omega = _motion(surface)
    moving = velocity + np.cross(omega, surface.centres)
    return float(leads(surface.normals, moving).mean())


def _literal(oracle: Any, surface: Surface, count: int) -> None:
    position, _, velocity, omega = _motion(surface)
    body = oracle.Body(surface.centres + position, surface.normals, surface.areas, position, velocity, omega)
    for _ in range(count):
        oracle.rft3d(body, SAND.xi_n, SAND.mu_surf)


def _least(works: list[Callable[[int], Any]], report: Callable[[str], Any]) -> list[float]:
    """Least processor time of each piece of work [s]; a piece is done as often as it is asked to."""

    def elapsed(work: Callable[[int], Any], count: int) -> float:
        started = time.thread_time()
        work(count)
        return (time.thread_time() - started) / count

    counts = []
    for work in works:
        work(1)
        counts.append(max(math.ceil(SHORTEST / elapsed(work, 1)), 1))
    least = [math.inf] * len(works)
    for number in range(ROUNDS):
        for k, (work, count) in enumerate(zip(works, counts, strict=True)):
            least[k] = min(least[k], elapsed(work, count))
        report(f"round {number + 1}")
    return least


def _count(assembly: str) -> float:
    """Floating-point instructions for each triangle, in the loop that has most of them."""
    blocks = re.split(r"^\.?LBB\S*:", assembly, flags=re.MULTILINE)
    pattern = re.compile(
        r"^\s+v(?:f?n?m(?:add|sub)\w*|mul|add|sub|div|sqrt|min|max|rsqrt14|rcp14)p[sd]\b", re.MULTILINE
    )
    hot = max(blocks, key=lambda block: len(pattern.findall(block)))
    roots = len(re.findall(r"^\s+v?sqrt[ps]d\b", hot, re.MULTILINE))
    return len(pattern.findall(hot)) * _ROOTS / max(roots, 1)
