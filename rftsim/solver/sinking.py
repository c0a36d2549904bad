"""Depths within a step: whether a body can reach the sand, how deep it comes, and how deep it is after a part."""

from typing import Final

from rftsim.law import step_frame, sums
from rftsim.law.body import bed_at, body_at, header_at
from rftsim.law.frame import level_frame
from rftsim.law.free_surface import after, lowest_depth
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation
from rftsim.solver.motion import frame_at, twist_of

FALL: Final = 30.0
"""Acceleration that bodies are watched for on their way to the sand [m/s^2]."""


@inline
def is_near(sand, surface, xpos, xmat, speed, h):
    """Whether any triangle can be in the sand within a step: by a body's bounding box and the size of its twist."""
    bed, header = bed_at(sand), header_at(surface)
    frame = level_frame(bed, xpos, xmat, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return lowest_depth(header.lowest, header.highest, frame) + h * (speed + h * FALL) > 0.0


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
