"""The frame of a body: what its triangles have in common during one evaluation of the force."""

from typing import Any, NamedTuple

from rftsim.law.vectors import cross, nine, to_body
from rftsim.machine.kernel import exact_kernel, merged_kernel


class Frame(NamedTuple):
    """Motion of a body, and the free surface as the body sees it; vectors in the body frame."""

    v0: Any
    """Velocity of the body's origin [m/s], shape (3,)."""
    omega: Any
    """Angular velocity [rad/s], shape (3,)."""
    up: Any
    """Normal of the free surface, shape (3,)."""
    rise: Any
    """Gradient of the height above the free surface, shape (3,): `up`, unless a sub-cycled step has turned it."""
    forward: Any
    """Horizontal axis of the plane of motion of the 2D laws, shape (3,)."""
    height: Any
    """Depth of the body's origin below the free surface [m]."""
    rear: Any
    """Half-space whose free surface has dropped: normal (3,) and offset, empty where all zero; shape (4,)."""
    drop: Any
    """Drop of the free surface there, delta h of [Agarwal] section 4.6.2 [m]."""
    relief: Any
    """Whether the free surface is no plane (0 or 1): then `rise` and `height` are those of a plane nowhere below it."""
    place: Any
    """Position of the body's origin, world frame [m], shape (3,)."""
    turn: Any
    """Body to world, row-major, shape (9,)."""
    moved: Any
    """Way that the body has gone since, in the parts of a step, along and about its axes [m, rad], shape (6,)."""


@merged_kernel
def point_velocity(frame: Any, x: Any, y: Any, z: Any) -> Any:
    """The velocity of a point of the body [m/s], shape (3,)."""
    v0x, v0y, v0z = frame.v0
    wx, wy, wz = frame.omega
    return v0x + wy * z - wz * y, v0y + wz * x - wx * z, v0z + wx * y - wy * x


@exact_kernel
def level_frame(bed: Any, xpos: Any, xmat: Any, velocity: Any, omega: Any) -> Any:
    """The frame of a body over undisturbed sand.

    Args:
        bed: Record of the sand, see `layout.BED`.
        xpos: Position of the body's origin [m], shape (3,).
        xmat: Body to world, row-major, shape (9,).
        velocity: Velocity of the origin, world frame [m/s], shape (3,).
        omega: Angular velocity, world frame [rad/s], shape (3,).
    """
    v0 = to_body(xmat, velocity[0], velocity[1], velocity[2])
    w = to_body(xmat, omega[0], omega[1], omega[2])
    up = to_body(xmat, bed.up[0], bed.up[1], bed.up[2])
    plane = to_body(xmat, bed.plane[0], bed.plane[1], bed.plane[2])
    height = bed.offset - (bed.up[0] * xpos[0] + bed.up[1] * xpos[1] + bed.up[2] * xpos[2])
    rear, moved = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    place, turn = (xpos[0], xpos[1], xpos[2]), nine(xmat)
    return Frame(v0, w, up, up, cross(plane, up), height, rear, 0.0, 0.0, place, turn, moved)


@exact_kernel
def over(frame: Any, up: Any, rise: Any, forward: Any, height: Any, relief: Any) -> Any:
    """A frame over another free surface, or over a plane that stands for it."""
    f = frame
    return Frame(f.v0, f.omega, up, rise, forward, height, f.rear, f.drop, relief, f.place, f.turn, f.moved)


@exact_kernel
def behind(frame: Any, rear: Any, drop: Any) -> Any:
    """A frame whose free surface has dropped in a half-space."""
    f = frame
    return Frame(
        f.v0, f.omega, f.up, f.rise, f.forward, f.height, rear, drop, f.relief, f.place, f.turn, f.moved
    )  # fmt: skip


@exact_kernel
def sunk(frame: Any, rise: Any, height: Any, moved: Any) -> Any:
    """A frame at other depths, of a body that has moved by so much."""
    f = frame
    return Frame(
        f.v0, f.omega, f.up, rise, f.forward, height, f.rear, f.drop, f.relief, f.place, f.turn, moved
    )  # fmt: skip
