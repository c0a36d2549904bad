"""Depths within a step: whether a body can reach the sand, and how deep it is after a part."""

from typing import Final

import numpy as np

from rftsim.law import step_frame
from rftsim.law.body import frame_over, header_at
from rftsim.law.free_surface import after, lowest_depth
from rftsim.law.vectors import dot
from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, stack_doubles
from rftsim.solver import equation
from rftsim.solver.motion import frame_at, twist_of

FALL: Final = 30.0
"""Acceleration that bodies are watched for on their way to the sand [m/s^2]."""


@inline
def is_near(sand, surface, xpos, xmat, speed, h):
    """Whether any triangle can be in the sand within a step: by a body's bounding box and the size of its twist."""
    header, still, way = header_at(surface), (0.0, 0.0, 0.0), h * (speed + h * FALL)
    frame = frame_over(sand, surface, xpos, xmat, still, still, way)
    return lowest_depth(header.lowest, header.highest, frame) + np.sqrt(dot(frame.rise, frame.rise)) * way > 0.0


@exact
def sink(p, v, h):
    """Move the depths by a time h of the motion v; positions and normals stay."""
    twist = doubles(stack_doubles(6), 6)
    for b in range(equation.head(p).nbody):
        twist_of(p, b, v, twist)
        step_frame.keep(after(frame_at(p, b, twist), h), equation.frame(p, b).ctypes.data)
