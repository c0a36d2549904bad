"""Depths within a step: whether a body can reach the sand, how deep it comes, and how deep it is after a part."""

from typing import Final

from rftsim.law import step_frame, sums
from rftsim.law.body import body_at
from rftsim.law.exports import deepest_corner
from rftsim.law.free_surface import after
from rftsim.machine.compiling import exact
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation
from rftsim.solver.motion import frame_at, speed_of, twist_of

FALL: Final = 30.0
"""Acceleration that bodies are watched for on their way to the sand [m/s^2]."""


@exact
def is_near(p):
    """Whether any triangle can be in the sand within the step."""
    v, h, twist = equation.velocity(p), equation.numbers(p).timestep, doubles(stack_doubles(6), 6)
    for k in range(6):
        twist[k] = 0.0
    for b in range(equation.head(p).nbody):
        depth = deepest_corner(equation.surface(p)[b], frame_at(p, b, twist))
        if depth + h * (speed_of(p, b, v, 2.0) + h * FALL) > 0.0:
            return True
    return False


@exact
def sink(p, v, h):
    """Move the depths by a time h of the motion v; positions and normals stay."""
    twist = doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        twist_of(p, b, v, twist)
        step_frame.keep(after(frame_at(p, b, twist), h), equation.frame(p, b).ctypes.data)


@exact
def deepest(p, b, v, h):
    """Largest depth of a body's triangles, now or after a time h of the motion v [m]."""
    twist = doubles(stack_doubles(6), 6)
    twist_of(p, b, v, twist)
    body, frame, found = body_at(equation.surface(p)[b]), frame_at(p, b, twist), -1e30
    for _ in range(2):
        found = max(found, sums.deepest(body, frame))
        frame = after(frame, h)
    return found
