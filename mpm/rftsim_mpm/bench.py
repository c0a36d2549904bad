"""How fast: particle-updates per second of full steps, of one process and of several side by side."""

import multiprocessing
import time
from typing import Any, NamedTuple

import numpy as np

from rftsim_mpm.bed import level_bed
from rftsim_mpm.body import Body
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.shapes import box
from rftsim_mpm.simulation import SORT_EVERY, Simulation


class Throughput(NamedTuple):
    """How fast one process updates particles, and of how many."""

    particles: int
    """How many particles the process updated in each step."""
    updates_per_s: float
    """Particle-updates per second, of the fastest repetition [1/s]."""


def problem(dim: int, *, small: bool = False) -> Simulation:
    """Return a plate 10 mm deep in a bed and moving down: 98,000 particles in the plane, 108,000 in space."""
    material = Material.of_density(0.4, 1512.0, 1e6)
    size: tuple[float, ...] = (0.3, 0.1) if small else (0.6, 0.25)
    dx = 2.5e-3
    if dim == 3:
        size, dx = (0.1, 0.1, 0.075) if small else (0.15, 0.15, 0.075), 5e-3
    shape = box(*([0.05] * (dim - 1)), 0.015)
    place = np.array([0.5 * s for s in size[:-1]] + [size[-1] - 0.01 + 0.0075])
    body = Body(shape, place, np.array([0.0] * (dim - 1) + [-0.1]), 0.35)
    sim = Simulation(material, level_bed(material, size, dx), dx, (*size[:-1], size[-1] + 0.05), bodies=[body])
    sim.clear_bodies()
    return sim


def throughput(dim: int, *, repetitions: int = 3, small: bool = False) -> Throughput:
    """Time full steps, contact and sorting included, after the sand has begun to yield."""
    if repetitions < 1:
        raise MpmError(f"repetitions must be at least 1, not {repetitions}")
    sim = problem(dim, small=small)
    for _ in range(SORT_EVERY):
        sim.step()
    best = 0.0
    for _ in range(repetitions):
        began = time.perf_counter()
        for _ in range(SORT_EVERY):
            sim.step()
        best = max(best, SORT_EVERY * len(sim.particles) / (time.perf_counter() - began))
    return Throughput(len(sim.particles), best)


def _timed(job: tuple[int, float, Any]) -> float:
    dim, seconds, barrier = job
    sim = problem(dim)
    for _ in range(10):
        sim.step()
    barrier.wait()
    began, steps = time.perf_counter(), 0
    while time.perf_counter() - began < seconds:
        sim.step()
        steps += 1
    return steps * len(sim.particles) / (time.perf_counter() - began)


def together(dim: int, processes: int, seconds: float = 5.0) -> float:
    """Return the particle-updates per second of several processes that run at the same time, summed [1/s]."""
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, context.Pool(processes) as pool:
        barrier = manager.Barrier(processes)
        return float(sum(pool.map(_timed, [(dim, seconds, barrier)] * processes, chunksize=1)))
