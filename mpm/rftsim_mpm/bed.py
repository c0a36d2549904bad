"""Particles, and the level beds that they begin as."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material

Array = NDArray[np.float64]

MOST_PARTICLES = 10_000_000
"""Most particles of a bed, some 3 GB."""


@dataclasses.dataclass
class Particles:
    """The sand's state; each row a particle. In the plane, stresses are xx, yy, zz, xz, else xx, yy, zz, yz, xz, xy."""

    x: Array
    """Places, (n, dim) [m]."""
    v: Array
    """Velocities, (n, dim) [m/s]."""
    mass: Array
    """Masses, (n,) [kg, in the plane kg/m]."""
    volume: Array
    """Volumes, pores included, (n,) [m^3, in the plane m^2]."""
    stress: Array
    """Cauchy stress, tension positive, (n, 4 or 6) [Pa]."""
    theta: Array
    """Logarithm of the packing fraction, (n,) [-]."""
    theta_d: Array
    """Logarithm of the packing fraction of the dense state, (n,) [-]."""
    strain: Array
    """Equivalent plastic shear strain, (n,) [-]."""
    number: NDArray[np.int64]
    """Place of each particle in the order before any sorting, (n,)."""

    def __len__(self) -> int:
        return len(self.x)

    @property
    def dim(self) -> int:
        """Dimensions of space: 2 for plane strain, or 3."""
        return int(self.x.shape[1])

    @property
    def pressure(self) -> Array:
        """Mean of the three normal stresses, compression positive, shape (n,) [Pa]."""
        found: Array = -self.stress[:, :3].sum(axis=1) / 3.0
        return found

    @property
    def shear(self) -> Array:
        """Equivalent shear stress tau of each particle, shape (n,) [Pa]."""
        normal = self.stress[:, :3] + self.pressure[:, None]
        found: Array = np.sqrt(0.5 * (normal**2).sum(axis=1) + (self.stress[:, 3:] ** 2).sum(axis=1))
        return found

    @property
    def packing(self) -> Array:
        """Packing fraction phi of each particle, shape (n,) [-]."""
        return np.exp(self.theta)

    @property
    def momentum(self) -> Array:
        """Sum of the momentum of all particles, shape (dim,) [kg m/s]."""
        found: Array = self.mass @ self.v
        return found

    def select(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> None:
        """Keep, in this order, the particles of an index or a mask."""
        for field in dataclasses.fields(self):
            setattr(self, field.name, np.ascontiguousarray(getattr(self, field.name)[which]))


def earth_pressure(mu: float, fall: float = 0.0) -> float:
    """Ratio K_0 of the stresses along to that across the surface of a bed, or the least that can stand.

    Jaky's 1 - sin(phi) where it is level and one where it falls by mu, the steepest that stands; a line in between.
    nu / (1 - nu) would violate the yield condition: with both stresses along the surface K times that across and a
    shear of `fall` times it, sand stands for 3 (1 - K)^2 + 9 fall^2 <= mu^2 (1 + 2 K)^2; in plane strain sin(phi) = mu.

    Args:
        mu: Internal friction of the sand [-].
        fall: Slope of the surface, the tangent of its angle, below mu [-].
    """
    if mu == math.inf:
        return 1.0
    root = 3.0 * math.sqrt(3.0 * mu**2 - fall**2 * (3.0 - 4.0 * mu**2))
    least = (3.0 + 9.0 * fall**2 - mu**2) / (3.0 + 2.0 * mu**2 + root)
    return max(1.0 - mu + fall, least * (1.0 + 1e-9))


def level_bed(
    material: Material,
    size: tuple[float, ...],
    dx: float,
    *,
    gravity: Array | float = 9.81,
    phi: float | None = None,
    ppc: int = 2,
) -> Particles:
    """Return sand at rest in equilibrium, from the origin to `size`; where gravity leans, as on an endless slope.

    Args:
        material: The sand.
        size: Extent along each axis [m], the last one up; whole numbers of cells.
        dx: Size of a cell [m].
        gravity: Acceleration, (dim,), or the strength of one along -z [m/s^2].
        phi: Packing fraction of a stress-free particle; the critical one if not given.
        ppc: Particles per cell along each axis.

    Raises:
        MpmError: The bed is not made of whole cells, too large or too loose, or it does not stand.
    """
    phi = material.phi_c if phi is None else phi
    if not material.phi_min <= phi < 1.0:
        raise MpmError(f"the bed's packing fraction must be in [{material.phi_min:g}, 1), not {phi:g}")
    cells = [round(s / dx) for s in size]
    if any(c < 1 or abs(c * dx - s) > 1e-6 * s for c, s in zip(cells, size, strict=True)):
        raise MpmError(f"a bed of {' x '.join(f'{s:g}' for s in size)} m is not made of whole cells of {dx:g} m")
    dim = len(size)
    if math.prod(cells) * ppc**dim > MOST_PARTICLES:
        raise MpmError(
            f"a bed of {' x '.join(map(str, cells))} cells has more than {MOST_PARTICLES:g} particles: "
            "take larger cells, or less sand"
        )
    axes = [(np.arange(ppc * c) + 0.5) * (dx / ppc) for c in cells]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    n = len(x)
    across, fall = _leaning(gravity, dim)
    mu = material.mu + (phi - material.phi_c) * material.chi
    if not np.linalg.norm(fall) < mu:
        raise MpmError(
            f"sand of friction {mu:g} does not stand on a slope of {np.linalg.norm(fall):.3g}: it needs more than that"
        )
    k0 = earth_pressure(mu, float(np.linalg.norm(fall)))
    theta_d = np.full(n, math.log(phi))
    above = phi * material.rho_g * across * (size[-1] - x[:, -1])
    for _ in range(3):  # the weight of what is above, compressed by it: the change is of the order of p / K
        theta = theta_d + above * (1.0 + 2.0 * k0) / 3.0 / material.bulk
        above = _weight_above(x[:, -1], np.exp(theta) * material.rho_g * across, dx / ppc)
    stress = np.zeros((n, 4 if dim == 2 else 6))
    stress[:, 2] = -above
    stress[:, :2] = -k0 * above[:, None]
    for axis, component in enumerate((3,) if dim == 2 else (4, 3)):  # xz, and yz
        stress[:, component] = above * fall[axis]
    volume = np.full(n, (dx / ppc) ** dim)
    return Particles(
        x=x,
        v=np.zeros((n, dim)),
        mass=volume * material.rho_g * np.exp(theta),
        volume=volume,
        stress=stress,
        theta=theta,
        theta_d=theta_d,
        strain=np.zeros(n),
        number=np.arange(n),
    )


def _leaning(gravity: Array | float, dim: int) -> tuple[float, Array]:
    """Gravity across the surface [m/s^2], and the slope that it makes along each other axis, shape (dim - 1,) [-]."""
    if np.ndim(gravity) == 0:
        return float(gravity), np.zeros(dim - 1)
    *along, down = np.asarray(gravity, float)
    return -float(down), np.array(along) / -down


def _weight_above(z: Array, weight: Array, spacing: float) -> Array:
    """Vertical stress at each particle of a bed of even layers [Pa]."""
    layer = np.rint(z / spacing - 0.5).astype(np.int64)
    per_layer = np.zeros(layer.max() + 1)
    per_layer[layer] = weight * spacing
    above = np.cumsum(per_layer[::-1])[::-1] - 0.5 * per_layer
    found: Array = above[layer]
    return found
