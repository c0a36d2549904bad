"""Control steps a second of a task in worlds of mujoco_warp, beside MuJoCo's batch on this machine's processors.

    python tests/peers/task_on_gpu.py Quadruped 1024 4096

Actions are random. `device` is the share of the time that the simulations take, with what is sent and fetched; the rest
are observations, rewards and new episodes, on one processor.
"""

import argparse
import time

import numpy as np
from rftsim_envs import SandVectorEnv

STEPS = 50
"""Control steps that are timed."""


def measure(task: str, physics: str, n: int) -> tuple[float, float]:
    """Control steps a second of n simulations, and the share of the time that the simulations take."""
    envs = SandVectorEnv(task, n, physics=physics, strength=(0.5, 2.0))
    random, simulations = np.random.default_rng(0), envs.episodes.physics
    envs.reset(seed=0)
    envs.step(random.uniform(-0.5, 0.5, (n, envs.task.naction)))  # kernels and graphs are made
    took, step = 0.0, simulations.step

    def timed(nstep: int) -> np.ndarray:
        nonlocal took
        began = time.perf_counter()
        power = step(nstep)
        took += time.perf_counter() - began
        return power

    simulations.step = timed
    began = time.perf_counter()
    for _ in range(STEPS):
        envs.step(random.uniform(-0.5, 0.5, (n, envs.task.naction)))
    whole = time.perf_counter() - began
    return n * STEPS / whole, took / whole


def main() -> None:
    """Measure the batch, and Warp with each number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task")
    parser.add_argument("worlds", nargs="+", type=int)
    asked = parser.parse_args()
    for physics, n in [("batch", 256), *(("warp", n) for n in asked.worlds)]:
        rate, share = measure(asked.task, physics, n)
        print(f"{asked.task}, {physics}, {n} simulations: {rate:.3g} control steps/s, {share:.0%} on the device")


if __name__ == "__main__":
    main()
