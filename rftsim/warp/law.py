"""A law's stress as a function of Warp, and the sand's parameters as its kernels read them."""

from typing import Any

import warp as wp

from rftsim.law.laws import Law
from rftsim.law.tables import columns
from rftsim.warp.translate import translate


@wp.struct
class Medium:
    """The sand of one world as a law reads it, see `layout.Medium`."""

    dynamic: float
    xi_n: float
    zeta: float
    mu_surf: float
    lambda_: float
    rho_c: float
    g: float


@wp.struct
class Edge:
    """How the leading-edge rule treats what is near the edge, see `leading.Edge`."""

    tolerance: float
    ramp: float


@wp.struct
class Plane:
    """What a law reads of a body's frame: the horizontal axis of the plane of motion, body frame."""

    forward: wp.vec3


@wp.struct
class Stress:
    """The stress on a triangle, see `stress.Stress`; all vectors in the body frame."""

    per_depth: wp.vec3
    inertia: float
    along: wp.vec3


@wp.func
def _stress(per_depth: Any, inertia: float, along: Any):
    s = Stress()
    s.per_depth = wp.vec3(per_depth[0], per_depth[1], per_depth[2])
    s.inertia = inertia
    s.along = wp.vec3(along[0], along[1], along[2])
    return s


def stress_of(law: Law) -> Any:
    """Make a law's stress on a triangle, from n, v, up, frame, medium and edge, for kernels of Warp.

    The law's table is made part of the machine code: a fitted one is compiled on its own.
    """
    names = {"Stress": _stress}
    if law.table:
        vector = wp.types.vector(length=len(law.table), dtype=wp.float32)
        names["medium.table"] = tuple(wp.constant(vector(*column)) for column in columns(law.table))
    return translate(law.response.stress, names)
