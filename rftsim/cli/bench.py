"""`rftsim bench`: what rftsim costs, and what that buys."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import tyro

from rftsim.cli.costs import compare_speeds, time_environment, time_kernel
from rftsim.cli.options import Count, Flag, Folder, Kept
from rftsim.cli.solver import weigh_solver
from rftsim.cli.stability import play_hard_cases
from rftsim.cli.terrain import time_terrain
from rftsim.cli.worlds import weigh_warp


@dataclasses.dataclass(frozen=True)
class Bench:
    """Measure rftsim itself: its stability, its cost, and the accuracy that speed costs.

    stability: hard cases at time steps from 0.1 to 10 ms, with both forces, against the exact answer.

    environment: the time that sand adds to MuJoCo's step, of shipped robots and of others' (MENAGERIE_ROOT).

    pareto: what laws, triangles, time steps and tolerances cost, and how far they are from the finest.

    kernel: the time of a buried triangle, over NumPy's, and over what the processor allows.

    solver: evaluations that the implicit force takes, and the work that its sand does, step by step.

    terrain: the time that terrain and ruts take over a plane.

    warp: the time of many worlds in mujoco_warp, on a GPU where there is one; with cases, hard cases there.

    Example: rftsim bench stability --plot out
    """

    study: tyro.conf.Positional[Literal["stability", "kernel", "environment", "pareto", "solver", "terrain", "warp"]]
    """What is measured, see above."""
    cases: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ..", help_behavior_hint="")] = ()
    """Hard cases (of warp: or all), cases of environment (wheel, go1), or parts of pareto (laws, tolerance)."""
    starts: Count = 1000
    """Random starts, of stability."""
    scenes: Count = 300
    """Articulated scenes, of solver."""
    quick: Flag = False
    """Fewer of everything: a look, not a measurement."""
    oracle: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("tests/oracle.py")
    """Laws in NumPy, for kernel."""
    plot: Folder = None
    """Folder for the study's picture; solver has none."""
    memory: Kept = Path("out/bench")
    """What was measured: stopped, it goes on from there."""
    json: Flag = False
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
        elif self.study == "warp":
            weigh_warp(self.cases, self.quick, self.json)
        elif self.study == "solver":
            weigh_solver(self.cases, self.scenes, self.quick, self.memory, self.json)
        else:
            play_hard_cases(self.cases, self.starts, self.quick, self.memory, self.plot, self.json)
