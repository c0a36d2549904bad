"""The free surface of a frame as a plane: how deep a point of the body lies, how fast it rises, what is clear of it.

Of a relief it is a plane nowhere below it, which tells what can be in the sand; `relief` tells its depths.
"""

from typing import Any

from rftsim.law.frame import sunk
from rftsim.machine.kernel import exact_kernel, kernel, merged_kernel


@kernel
def plane_depth(x: Any, y: Any, z: Any, frame: Any) -> Any:
    """The depth of a point below the plane of a frame [m], whatever a wheel has made of it; negative above it."""
    ux, uy, uz = frame.rise
    return frame.height - (ux * x + uy * y + uz * z)


@kernel
def drop(x: Any, y: Any, z: Any, frame: Any) -> Any:
    """How much lower the free surface lies behind a wheel [m], [Agarwal] eq. (4.2)."""
    rx, ry, rz, r0 = frame.rear
    return frame.drop if rx * x + ry * y + rz * z + r0 < 0.0 else 0.0


@merged_kernel
def rising(v: Any, rise: Any) -> Any:
    """How fast what moves with a velocity v rises over a surface whose height has the gradient `rise` [m/s]."""
    ux, uy, uz = rise
    return v[0] * ux + v[1] * uy + v[2] * uz


@exact_kernel
def box_is_clear(centre: Any, half: Any, frame: Any, margin: Any) -> Any:
    """Whether a box, its centre and half its size in the body frame [m], lies a margin above the undisturbed sand."""
    r = frame.rise
    middle = r[0] * centre[0] + r[1] * centre[1] + r[2] * centre[2]
    below = abs(r[0]) * half[0] + abs(r[1]) * half[1] + abs(r[2]) * half[2]
    return middle - below >= frame.height + margin


@exact_kernel
def lowest_depth(lowest: Any, highest: Any, frame: Any) -> Any:
    """The depth of the deepest corner of a box between two corners in the body frame [m]."""
    r, deepest = frame.rise, frame.height
    for k in range(3):
        deepest -= min(r[k] * lowest[k], r[k] * highest[k])
    return deepest


@exact_kernel
def after(frame: Any, h: Any) -> Any:
    """The frame at the depths after a time h of its motion, to first order; positions and normals stay."""
    r, v, w, m = frame.rise, frame.v0, frame.omega, frame.moved
    by = h * (1.0 - frame.relief)  # of a relief the depths of its points change, and not the plane
    turned = (
        r[0] + by * (r[1] * w[2] - r[2] * w[1]),
        r[1] + by * (r[2] * w[0] - r[0] * w[2]),
        r[2] + by * (r[0] * w[1] - r[1] * w[0]),
    )
    lowered = frame.height - by * (v[0] * r[0] + v[1] * r[1] + v[2] * r[2])
    moved = m[0] + h * v[0], m[1] + h * v[1], m[2] + h * v[2], m[3] + h * w[0], m[4] + h * w[1], m[5] + h * w[2]
    return sunk(frame, turned, lowered, moved)
