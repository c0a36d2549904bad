"""`rftsim bench`: what rftsim costs, and what that buys."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import tyro

from rftsim.cli import costs
from rftsim.cli.stability import stability


@dataclasses.dataclass(frozen=True)
class Bench:
    """Measure rftsim itself.

    stability: the hard cases (rest, light legs, stiff servos, impacts, edges, constraints) at time steps from 0.1 to
    10 ms with the implicit and the explicit force, against the exact or converged answer.

    environment: what sand adds to MuJoCo's step, in one simulation and in 256 side by side.

    pareto: laws, triangles and time steps: what each costs, and how far it is from the finest.

    kernel: the time of a buried triangle by the size of the body, over that of the tests' NumPy, and the share of what
    the processor's arithmetic allows.

    Example: rftsim bench stability --plot out
    """

    study: tyro.conf.Positional[Literal["stability", "kernel", "environment", "pareto"]]
    """What is measured."""
    cases: tuple[str, ...] = ()
    """Names of cases; by default all."""
    starts: int = 1000
    """Random starts of a free runner."""
    quick: bool = False
    """Steps of 1 and 5 ms, 20 random starts; bodies of up to 20,480 triangles; fewer repetitions; one law each."""
    oracle: Path = Path("tests/oracle.py")
    """The tests' laws in NumPy, that kernel compares with where they are there."""
    plot: Path | None = None
    """Folder for the study's picture, NAME.png."""
    memory: Path = Path("out/bench")
    """Folder for what stability and pareto measured: if stopped, they go on from there."""
    json: bool = False
    """Print JSON instead of the tables."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Measure, print and draw."""
        if self.study == "kernel":
            costs.kernel(self.quick, self.oracle, self.plot, self.json)
        elif self.study == "environment":
            costs.environment(self.quick, self.plot, self.json)
        elif self.study == "pareto":
            costs.pareto(self.quick, self.memory, self.plot, self.json)
        else:
            stability(self.cases, self.starts, self.quick, self.memory, self.plot, self.json)
