"""A flat plate moved through a level bed: the experiment that force laws are fitted to.

Angles as in [Agarwal] chapter 5: the plate's lower face has normal m = (sin b cos p, sin b sin p, -cos b) and moves
along (cos g, 0, -sin g), for b = beta, g = gamma and p = psi.
"""

import dataclasses
import math
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.body import Body, plane_rotation, turned
from rftsim_mpm.course import Course
from rftsim_mpm.errors import MpmError, check_not_negative, check_positive
from rftsim_mpm.fields import Camera
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.reading import History, limit
from rftsim_mpm.settings import later
from rftsim_mpm.shapes import Surface, box, patches
from rftsim_mpm.simulation import Simulation, Watch

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Plate:
    """One plate, its motion and its sand; SI and degrees."""

    dim: int = 2
    """2: plane strain, N/m; 3: a square plate, N."""
    beta: float = 0.0
    """Tilt of the plate [deg]."""
    gamma: float = 90.0
    """Motion: 0 level, 90 down, negative up [deg]."""
    psi: float = 0.0
    """Azimuth of its normal from the motion [deg]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and plate [-]."""
    rho: float = 1512.0
    """Critical density of the sand [kg/m^3]."""
    length: float = 0.05
    """Length, and in 3D width [m]."""
    thickness: float | None = None
    """Thickness; else 0.3 lengths, 0.2 in 3D [m]."""
    depth: float | None = None
    """Depth of the reading; else 0.4 lengths [m]."""
    speed: float = 0.1
    """Speed of the plate [m/s]."""
    buried: float = 0.6
    """Travel where it starts in the sand [lengths]."""
    cells: float = 10.0
    """Cells per plate length."""
    young: float | None = None
    """Young's modulus; else by softness [Pa]."""
    softness: float = 0.005
    """Strain of the sand, rho g z N_q / E."""
    courant: float = 0.3
    """Time step, in cells per wave."""
    shift: float = 0.0
    """Place on the grid, along x and y [cells]."""
    early: float = 0.0
    """How far outside its surface it acts [cells]."""
    bed: float = 1.0
    """Factor on the sand around the plate."""
    ppc: int = 2
    """Particles per cell along each axis."""
    xpic: int = 0
    """Order of XPIC; 0 is FLIP."""
    symmetric: bool = True
    """In 3D, model a part if it serves."""
    run_up: float = later(0.0)
    """Travel in which it speeds up [lengths]."""
    absorb: float = later(0.0)
    """Edge that absorbs waves [lengths]."""
    mu_2: float | None = later(None)
    """mu_2 of mu(I), else no rate [-]."""
    grain: float = later(1e-3)
    """Diameter of grains of mu(I) [m]."""

    def __post_init__(self) -> None:
        if self.dim not in (2, 3):
            raise MpmError(f"dim must be 2 or 3, not {self.dim}")
        if self.dim == 2 and self.psi:
            raise MpmError("psi needs dim 3")
        if not -90.0 <= self.beta <= 90.0 or not -90.0 <= self.gamma <= 90.0 or not -180.0 <= self.psi <= 180.0:
            raise MpmError("beta and gamma must be in [-90, 90] degrees and psi in [-180, 180]")
        check_positive(self, "rho", "length", "speed", "bed", "courant", "mu_int", "softness", "buried")
        check_positive(self, "thickness", "depth", "young")
        if not 4.0 <= self.cells <= 200.0:
            raise MpmError(f"cells must be in [4, 200], not {self.cells:g}")
        check_not_negative(self, "mu_surf", "run_up", "absorb")
        if not 0.0 <= self.early <= 2.0:
            raise MpmError(f"early must be in [0, 2] cells, not {self.early:g}")
        if self.ppc < 1 or self.xpic < 0:
            raise MpmError("ppc must be at least 1 and xpic at least 0")
        if self.thick < 1.06 * self.dx:
            raise MpmError(
                f"a plate of {self.thick:g} m is thinner than a cell of {self.dx:g} m: more cells or thickness"
            )

    @property
    def quick(self) -> Self:
        """The same with six cells, and less sand around: a look, not a measurement."""
        return dataclasses.replace(self, cells=6.0, bed=0.7 * self.bed)

    @property
    def dx(self) -> float:
        """Size of a cell of the grid [m]."""
        return self.length / self.cells

    @property
    def thick(self) -> float:
        """Thickness of the plate, the default filled in [m]."""
        return self.thickness or (0.3 if self.dim == 2 else 0.2) * self.length

    @property
    def z(self) -> float:
        """Depth of the leading face's centre at which the force is read, the default filled in [m]."""
        return self.depth or 0.4 * self.length

    @property
    def window(self) -> float:
        """Half of the travel over which the force is read [m]: a twentieth of the length, and at least 4 ms."""
        return max(0.05 * self.length, 4e-3 * self.speed)

    @property
    def area(self) -> float:
        """Area of one face [m^2], in the plane its length [m]."""
        return self.length if self.dim == 2 else self.length**2

    @property
    def material(self) -> Material:
        """Parameters of the sand; Young's modulus, if not given, from the softness at the reading's depth."""
        young = self.young or stiffness(self.rho, 9.81, self.z, self.mu_int, self.softness)
        return Material.of_density(self.mu_int, self.rho, young, self.mu_2, self.grain)

    @property
    def direction(self) -> Array:
        """Unit vector along which the plate moves, shape (dim,)."""
        g = math.radians(self.gamma)
        along = [math.cos(g), 0.0, -math.sin(g)]
        return np.array(along if self.dim == 3 else along[::2]).round(15)  # cos 90 degrees is nothing

    @property
    def leading(self) -> Array:
        """Outward normal of the face that leads, of the lower one where the plate moves along itself, shape (dim,)."""
        up: Array = self.rotation[:, -1]
        return up if up @ self.direction > 1e-12 else -up

    @property
    def rotation(self) -> Array:
        """Rotation from the plate's frame, in which its lower face looks down, to the world, shape (dim, dim)."""
        b, p = math.radians(self.beta), math.radians(self.psi)
        if self.dim == 2:
            return plane_rotation(-b)
        return turned(turned(np.eye(3), np.array([0.0, -b, 0.0])), np.array([0.0, 0.0, p]))


class PlateForce(NamedTuple):
    """Force on one plate at the reading and along its way, and what it cost to compute."""

    force: Array
    """Force of the sand on the plate at the reading, (dim,) [N, in the plane N/m]."""
    alpha: Array
    """Force per area and depth, (dim,) [N/m^3]."""
    depth: float
    """Depth of the leading face's centre at the reading [m]."""
    noise: float
    """Noise of averages over 0.5 ms, relative [-]."""
    heave: float
    """How far the sand has risen beside the plate, on average over a plate's length to either side [m]."""
    history: History
    """Averages along the way."""
    profile: tuple[Array, Array]
    """Mean stress on the surface while reading: places in the plate's frame [m] and stresses [Pa], (n, dim) both."""
    particles: int
    """Particles of the bed, without what the plate displaced at its start."""
    steps: int
    """Time steps of the whole run."""
    seconds: float
    """Time that the computation took [s]."""

    @property
    def report(self) -> dict[str, Any]:
        """The numbers at the reading as JSON has them, by name and unit."""
        return {
            "force": self.force.tolist(),
            "depth_m": self.depth,
            "alpha_N_m3": self.alpha.tolist(),
            "noise": self.noise,
            "heave_m": self.heave,
            "particles": self.particles,
            "steps": self.steps,
            "seconds": round(self.seconds, 2),
        }

    @property
    def series(self) -> dict[str, Any]:
        """The force along the way as files keep it, thinned."""
        return self.history.series


def course(plate: Plate) -> Course:
    """Return the plate's way through the sand, with as much sand around as its mechanism needs."""
    dim, size = plate.dim, plate.length
    grown = 2.0 * plate.early * plate.dx
    shape = box(*([size + grown] * (dim - 1)), plate.thick + grown)
    rotation, direction = plate.rotation, plate.direction
    corners = shape.vertices @ rotation.T
    face = 0.5 * plate.thick * plate.leading  # centre of the leading face, from the plate's own
    above = plate.z + face[-1] - corners[:, -1].min()  # of the plate's lowest point on its way down to the reading
    from_surface = above / -direction[-1] if direction[-1] < 0.0 else math.inf
    margin = plate.bed * spread(plate.mu_int) * size * (1.0 if dim == 2 else 0.6)
    mirror_x = dim == 3 and plate.symmetric and plate.beta == 0.0 and abs(plate.gamma) == 90.0 and plate.psi == 0.0
    mirror_y = dim == 3 and plate.symmetric and plate.psi in (0.0, 180.0, -180.0)
    return Course(
        shape=shape,
        rotation=rotation,
        direction=direction,
        speed=plate.speed,
        friction=plate.mu_surf,
        material=plate.material,
        depth=plate.z + float(face[-1]),
        approach=from_surface if from_surface <= size else plate.buried * size,
        window=plate.window,
        margin=margin,
        bed=plate.z + max(float(np.abs(corners[:, -1]).max()), 0.4 * size) + 0.6 * margin,
        dx=plate.dx,
        mirrors=(mirror_x, mirror_y)[: dim - 1],
        courant=plate.courant,
        ppc=plate.ppc,
        xpic=plate.xpic,
        shift=tuple(plate.shift - face[: dim - 1] / plate.dx),
        run_up=plate.run_up * size,
        absorb=plate.absorb * size,
    )


def measure(plate: Plate, watch: Watch | None = None) -> PlateForce:
    """Move the plate to a little beyond the reading and return the force on it.

    Args:
        plate: The plate, its motion and its sand.
        watch: Called after each step with the simulation and the share of the way that is done.
    """
    return reading(plate, course(plate), watch)


def reading(plate: Plate, way: Course, watch: Watch | None = None) -> PlateForce:
    """Return the force on a plate on a way of its own, read as `measure` reads it."""
    found = way.run(watch)
    return PlateForce(
        force=found.force,
        alpha=found.force / (plate.area * plate.z),
        depth=plate.z,
        noise=found.noise,
        heave=_heave(found.sim, plate, way.level),
        history=found.history._replace(depth=found.history.depth + plate.z - way.depth),
        profile=profile(found.sim.bodies[0], found.sim.surfaces[0], found.traction, plate.dx),
        particles=len(found.sim.particles),
        steps=found.sim.steps,
        seconds=found.seconds,
    )


def _heave(sim: Simulation, plate: Plate, level: float) -> float:
    """How far the free surface lies above a level, on average over a plate's length to either side [m]."""
    surface, body = Camera(sim).shoot(sim).surface, sim.bodies[0]
    beside = np.abs(surface[:, 0] - body.position[0]) - np.abs(body.vertices[:, 0] - body.position[0]).max()
    near = (beside > 0.0) & (beside < plate.length)
    return float(surface[near, 1].mean()) - level


def profile(body: Body, surface: Surface, traction: Array, dx: float) -> tuple[Array, Array]:
    """Return the stress on patches of a body's surface, about a cell long each, from that on its points.

    Returns:
        Centres of the patches [m] and stress of the sand on each [Pa], in the body's frame.
    """
    places, areas, _ = patches(body.shape.vertices[body.shape.faces], dx)
    force = np.zeros_like(places)
    nearest = ((surface.points[:, None, :] - places[None]) ** 2).sum(axis=2).argmin(axis=1)
    np.add.at(force, nearest, -surface.areas[:, None] * traction)
    return places, force / areas[:, None]


def spread(mu: float) -> float:
    """Return how far to either side sand fails under a plate, in plate lengths, and one more: Prandtl's mechanism."""
    phi = math.atan(mu)
    return 1.0 + math.tan(math.pi / 4 + phi / 2) * math.exp(0.5 * math.pi * mu)


def finer(plate: Plate) -> Plate:
    """Return the plate of the second resolution: twice the cells in the plane, half as many again in space."""
    return dataclasses.replace(plate, cells=plate.cells * (2.0 if plate.dim == 2 else 1.5))


def extrapolated(coarse: PlateForce, fine: PlateForce, ratio: float) -> Array:
    """Return the force in the limit of vanishing cells, from two resolutions, (dim,) [N, in the plane N/m]."""
    return limit(coarse.force, fine.force, ratio)
