"""Into how many parts a step must be split, by how far its bodies move against their depths."""

from typing import Final

import numpy as np

from rftsim.law.exports import AHEAD
from rftsim.law.stress import TINY
from rftsim.machine.compiling import exact
from rftsim.solver import equation, matrices
from rftsim.solver.equation import POINT
from rftsim.solver.motion import generalised, speed_of

FINENESS: Final = 7.5
"""Error of the position in a step, over the depth and the tolerance, above which the step is split."""
SHALLOWEST: Final = 1e-4
"""Depth [m] below which none is resolved."""
FIRST: Final = 3.9
"""What counts for that error in a first step in which a body moves by more than is allowed: two parts."""


@exact
def parts_needed(p, time):
    """Into how many parts a step must be split, by the solution of a time of it in point POINT.best."""
    h = equation.numbers(p).timestep
    after, start = equation.velocity_of(p, POINT.best), equation.start(p)
    grown, late, stopped = equation.grown(p), equation.late(p), equation.stopped(p)
    pressed = equation.pressed(p)
    generalised(p, POINT.best, 1, grown)
    matrices.substitute(p, equation.mass_factors(p), grown, pressed)
    generalised(p, POINT.best, 0, late)
    for k in range(after.size):
        grown[k] = time * (grown[k] - late[k])
        stopped[k] = after[k] - start[k]
    matrices.substitute(p, equation.mass_factors(p), grown, late)
    worst = _position_error(p, time)
    return np.ceil(np.sqrt(worst) * h / time) if worst > (time / h) ** 2 else 1.0


@exact
def _position_error(p, time):
    """The bodies' error of position over what is allowed, after `parts_needed` filled what it follows from.

    It is the mean square by the bodies' shares of the sand's force: what a grazing body errs by changes the motion
    little, for a force goes with the depth, and its share of all forces with it.
    """
    start, late = equation.start(p), equation.late(p)
    stopped, pressed, began = equation.stopped(p), equation.pressed(p), equation.numbers(p).started > 0.0
    nbody, fineness = equation.head(p).nbody, FINENESS * equation.numbers(p).tolerance
    square, first, total = 0.0, 0.0, TINY
    for b in range(nbody):
        total += _later_force(p, b)
    for b in range(nbody):
        travel, share = time * speed_of(p, b, start), _later_force(p, b) / total
        by_sand = min(speed_of(p, b, stopped), time * speed_of(p, b, pressed))
        error = min(time * max(speed_of(p, b, late), by_sand) / 8.0, travel) / fineness
        if error <= SHALLOWEST:
            continue
        depth = equation.answer_of(p, POINT.best, b)[AHEAD - 1]
        if depth <= 0.0:
            continue
        square += share * (error / max(depth, SHALLOWEST)) ** 2
        if not began and travel > fineness * max(depth, SHALLOWEST):
            first = FIRST
    return max(np.sqrt(square), first)


@exact
def _later_force(p, b):
    """Size of the sand's force on a body at the later depths [N]."""
    f = equation.wrench_of(p, POINT.best, b, 1)
    return np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
