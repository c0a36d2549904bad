"""Whether a face leads: the rule of all laws, and the look that tells beforehand which triangles it leaves out.

A face leads where its outward normal and its direction of motion make n.v_hat >= 0, for rounding >= -edge_on. The
implicit force lets it fall out over a ramp below that. `may_lead` follows from `share`: a property test holds the one
against the other.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim.law.vectors import larger, smaller
from rftsim.machine.kernel import kernel

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SHARP: Final = 1e300
"""Steepness of the rule as published, which is a jump."""
MARGIN: Final = 1.01
"""Room for rounding in the look, on the square of how far behind the edge triangles count."""
ALL: Final = 1.01
"""Square of a reach, n.v_hat, within which every triangle counts."""


class Edge(NamedTuple):
    """How the leading-edge rule treats what is near the edge."""

    tolerance: Any
    """Rounding of the normals [-]: n.v_hat down to minus this counts as leading, n.up within this as vertical."""
    ramp: Any
    """Steepness with which the share falls off below that [-]; SHARP for the rule as published."""


@kernel
def share(cosine: Any, speed2: Any, edge: Any) -> Any:
    """The share with which a face of n.v_hat = cosine counts: one or zero, or on the ramp between; zero at rest."""
    leading = smaller(larger(1.0 + (cosine + edge.tolerance) * edge.ramp, 0.0), 1.0)
    return leading if speed2 > 0.0 else 0.0


@kernel
def side(cosine: Any, edge: Any) -> Any:
    """The sign that makes m = sign n the downward representative of a face of n.up = cosine, [Agarwal] eq. (5.18).

    A vertical face has m = -n, as one that looks up: eq. (5.18) gives it beta = -pi/2 where n.r >= 0, and pi/2 where
    not. Between that and m = n the fit jumps, with Table C.3 by 10 % of the stress in the mean over all motions and by
    0.049 xi_n at most.
    """
    return 1.0 if cosine < -edge.tolerance else -1.0


@kernel
def reach2(edge: Any) -> Any:
    """The square of how far behind the edge, in n.v_hat, a face can still have a share."""
    reach = edge.tolerance + 1.0 / edge.ramp
    return MARGIN * reach * reach


@kernel
def may_lead(normal_speed: Any, speed2: Any, reach2: Any) -> Any:
    """A number that is negative where a face surely has no share; from n.v and v.v, without a root or a division."""
    return normal_speed * abs(normal_speed) + reach2 * speed2


@kernel
def speed_in_space(n: Any, v: Any, frame: Any) -> Any:
    """The speed n.v that the rule looks at, of laws that know all directions."""
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]


@kernel
def speed_in_plane(n: Any, v: Any, frame: Any) -> Any:
    """The speed n.v that the rule looks at, of laws that know only the parts of n and v in the plane of motion."""
    ux, uy, uz = frame.up
    ex, ey, ez = frame.forward
    px, py, pz = uy * ez - uz * ey, uz * ex - ux * ez, ux * ey - uy * ex
    across = (n[0] * px + n[1] * py + n[2] * pz) * (v[0] * px + v[1] * py + v[2] * pz)
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2] - across


def leads(normals: Array, velocities: Array, tolerance: float = 0.0) -> Flags:
    """Whether each of many faces leads under the rule as published, shape (n,).

    Args:
        normals: Outward unit normals, shape (n, 3).
        velocities: Velocities, shape (n, 3).
        tolerance: Rounding of the normals [-]: n.v_hat down to minus this counts as leading.
    """
    flags: Flags = may_lead((normals * velocities).sum(axis=1), (velocities**2).sum(axis=1), tolerance**2) >= 0.0
    return flags
