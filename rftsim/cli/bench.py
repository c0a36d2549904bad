"""`rftsim bench`: what rftsim costs, and what that buys."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import tyro

from rftsim.cli.costs import compare_speeds, time_environment, time_kernel
from rftsim.cli.solver import weigh_solver
from rftsim.cli.stability import play_hard_cases
from rftsim.cli.terrain import time_terrain


@dataclasses.dataclass(frozen=True)
class Bench:
    """Measure rftsim itself: its stability, its cost, and the accuracy that speed costs.

    stability: the hard cases (rest, light legs, stiff servos, impacts, edges, constraints) at time steps from 0.1 to
    10 ms with the implicit and the explicit force, against the exact or converged answer.

    environment: the time that sand adds to MuJoCo's step, in one simulation and in 256 side by side: shipped robots,
    free spheres, and robots of others where they are installed (gymnasium, dm_control, MENAGERIE_ROOT).

    pareto: laws, triangles and time steps, and the tolerance of the implicit force: what each costs, and how far it is
    from the finest.

    kernel: the time of a buried triangle by the size of the body, over that of the tests' NumPy, and the share of what
    the processor's arithmetic allows.

    solver: the evaluations that the implicit force takes, step by step, and the work that its sand does, in the hard
    cases, the environments and articulated scenes drawn at random, at time steps from 1 to 10 ms.

    terrain: the time that terrain and ruts take over a plane: of the force, of a step, and of 64 simulations at once.

    Example: rftsim bench stability --plot out
    """

    study: tyro.conf.Positional[Literal["stability", "kernel", "environment", "pareto", "solver", "terrain"]]
    """The study to run: what is measured, see above."""
    cases: tuple[str, ...] = ()
    """Names of the hard cases that stability and solver play, of the cases that environment times (wheel, go1), or of
    the parts of pareto (laws, tolerance); by default all."""
    starts: int = 1000
    """Random starts of a free body on legs, of stability."""
    scenes: int = 300
    """Articulated scenes of solver, drawn from the seeds 0, 1, ..."""
    quick: bool = False
    """Fewer time steps, cases, tolerances, random starts and scenes; bodies of up to 20,480 triangles; fewer
    repetitions; one law each."""
    oracle: Path = Path("tests/oracle.py")
    """The tests' laws in NumPy, that kernel compares with where they are there."""
    plot: Path | None = None
    """Folder for the study's picture, NAME.png, and tolerance.png of pareto's second part; solver has none."""
    memory: Path = Path("out/bench")
    """Folder for what stability, pareto and solver measured: stopped, they go on from there."""
    json: bool = False
    """Print JSON instead of the tables."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Measure what was asked for, print it and draw it."""
        if self.study == "kernel":
            time_kernel(self.quick, self.oracle, self.plot, self.json)
        elif self.study == "environment":
            time_environment(self.cases, self.quick, self.plot, self.json)
        elif self.study == "pareto":
            compare_speeds(self.cases, self.quick, self.memory, self.plot, self.json)
        elif self.study == "terrain":
            time_terrain(self.quick, self.json)
        elif self.study == "solver":
            weigh_solver(self.cases, self.scenes, self.quick, self.memory, self.json)
        else:
            play_hard_cases(self.cases, self.starts, self.quick, self.memory, self.plot, self.json)
