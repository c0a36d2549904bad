"""A law's stress as a function of Warp, and the sand's parameters as its kernels read them."""

from typing import Any

import warp as wp

from rftsim.law.laws import Response
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
    """The part of a body's frame that a law reads: the horizontal axis of the plane of motion, body frame."""

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


def stress_of(response: Response, table: tuple[tuple[float, ...], ...]) -> Any:
    """Make the stress on a triangle, from n, v, up, frame, medium and edge, for kernels of Warp.

    Args:
        response: That of the law.
        table: Coefficients of f1, f2 and f3, which are made part of the machine code; empty where it has none.
    """
    names = {"Stress": _stress}
    terms = len(table[-1])
    if terms:
        vector = wp.types.vector(length=terms, dtype=wp.float32)
        names["medium.table"] = tuple(wp.constant(vector(*column)) for column in table)
    return translate(response.stress, names)
