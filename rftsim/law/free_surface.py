"""The free surface at a point of a body: how deep the point lies, which way is up, how fast it sinks.

Everything that asks for a depth or a normal calls these; a surface that is no plane would change this module.
"""

from typing import Any

from rftsim.law.frame import Frame
from rftsim.machine.kernel import exact_kernel, kernel, merged_kernel


@kernel
def up(x: Any, y: Any, z: Any, frame: Any) -> Any:
    """The free surface's normal above a point, shape (3,)."""
    return frame.up


@kernel
def undisturbed_depth(x: Any, y: Any, z: Any, frame: Any) -> Any:
    """The depth of a point below the free surface [m], whatever a wheel has made of it; negative above the sand."""
    ux, uy, uz = frame.rise
    return frame.height - (ux * x + uy * y + uz * z)


@kernel
def depth(x: Any, y: Any, z: Any, frame: Any) -> Any:
    """The effective depth of a point, less the drop behind a wheel [m], [Agarwal] eq. (4.2)."""
    rx, ry, rz, r0 = frame.rear
    drop = frame.drop if rx * x + ry * y + rz * z + r0 < 0.0 else 0.0
    return undisturbed_depth(x, y, z, frame) - drop


@merged_kernel
def rising(v: Any, frame: Any) -> Any:
    """How fast what moves with a velocity v rises over the free surface [m/s]."""
    ux, uy, uz = frame.rise
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
    r, v, w = frame.rise, frame.v0, frame.omega
    turned = (
        r[0] + h * (r[1] * w[2] - r[2] * w[1]),
        r[1] + h * (r[2] * w[0] - r[0] * w[2]),
        r[2] + h * (r[0] * w[1] - r[1] * w[0]),
    )
    lowered = frame.height - h * (v[0] * r[0] + v[1] * r[1] + v[2] * r[2])
    return Frame(frame.v0, frame.omega, frame.up, turned, frame.forward, lowered, frame.rear, frame.drop)
