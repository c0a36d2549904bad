"""Sand, rigid bodies and a box, stepped explicitly in time."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rftsim_mpm.bed import Particles
from rftsim_mpm.body import Body
from rftsim_mpm.contact import make_contact
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.transfer import ROW, make_transfer
from rftsim_mpm.walls import make_grid_step

Array = NDArray[np.float64]

INSET = 0.5
"""How far inside a body's true surface contact lies, in cells.

What is pushed on the grid moves with it a good part of a cell further out, so that bodies act too wide and too deep.
"""
SPACING = 0.25
"""Distance between the points of a body's surface, in cells: more points make no difference."""
CONTACT_STIFFNESS = 1.0
"""Stiffness of the contact layer, in Young's moduli per cell: sand sinks in by p / E cells."""
COURANT = 0.3
"""Time step in cells per compression wave."""
MOST_STEPS = 1e7
"""Most time steps of a run."""
MOST_NODES = 10_000_000
"""Most nodes of a grid."""
SORT_EVERY = 80
"""Steps between sorting the particles by cell."""
CALM_EVERY = 20
"""Steps between takings of what the grid does not see from the velocities."""
CALM_ORDER = 6
"""Order of XPIC that tells what the grid does not see."""
ABSORB_EVERY = 5
"""Steps between takings from the velocities in layers that absorb waves."""
ABSORBED = 3.0
"""Logarithm of what a compression wave loses on its way through such a layer, once."""


class _Kernels(NamedTuple):
    scatter: Any
    gather: Any
    order: Any
    project: Any
    step: Any
    touch: Any


@cache
def _kernels(dim: int) -> _Kernels:
    return _Kernels(*make_transfer(dim), make_grid_step(dim), make_contact(dim))


class Simulation:
    """Explicit MPM: FLIP, quadratic B-splines, stress updated last; deterministic in one thread.

    Args:
        material: The sand.
        particles: The sand as it begins; taken over, not copied.
        dx: Size of a cell [m].
        size: The box, from the origin [m]; its lower and upper faces across each axis but the top are mirrors.
        bodies: Rigid intruders.
        gravity: Acceleration, (dim,), or the strength of one along -z [m/s^2].
        wall_friction: Friction of the lower and the upper face across each axis, (dim, 2), or one number for all [-].
        dt: Time step; COURANT cells per wave if not given [s].
        xpic: Order of the velocity filter; 0 for FLIP. It acts on each step, so it damps.
        inset: How far inside a body's surface contact lies, see INSET [cells].
        spacing: Distance between the points of a body's surface, see SPACING [cells].
        calm: Time in which velocities that the grid does not see die down; 0 leaves them, as FLIP does [s]. They do no
            harm in sand that is pushed once, but in sand that goes on flowing they mix particles until some lie twice
            as dense as they know, and heaps are too small.
        absorb: Width of the layer before the lower and the upper face across each axis in which waves that are shorter
            than it die down, (dim, 2) [m]. What flows is slowed down there, too, so that it belongs where the sand
            would hardly move; 0 for none.
    """

    def __init__(
        self,
        material: Material,
        particles: Particles,
        dx: float,
        size: Sequence[float],
        *,
        bodies: Sequence[Body] = (),
        gravity: Array | float = 9.81,
        wall_friction: Array | float = 0.0,
        dt: float | None = None,
        xpic: int = 0,
        inset: float = INSET,
        spacing: float = SPACING,
        calm: float = 0.0,
        absorb: ArrayLike = 0.0,
    ) -> None:
        dim = particles.dim
        cells = [math.ceil(round(s / dx, 6)) for s in size]
        if len(cells) != dim or min(cells) < 4:
            raise MpmError(f"the box must be at least 4 cells of {dx:g} m along each of {dim} axes, not {cells}")
        if math.prod(cells) > MOST_NODES:
            raise MpmError(
                f"a box of {cells} cells has more than {MOST_NODES:g} nodes: take larger cells, or less room"
            )
        if xpic < 0:
            raise MpmError(f"xpic must be zero (FLIP) or an order, not {xpic}")
        self.material, self.particles, self.dx, self.bodies = material, particles, dx, list(bodies)
        self.size = np.array(cells) * dx
        self.dt = COURANT * dx / material.wave_speed if dt is None else dt
        self.time, self.steps = 0.0, 0
        self.gravity = np.array([0.0] * (dim - 1) + [-gravity]) if np.ndim(gravity) == 0 else np.asarray(gravity, float)
        self.wall_friction = np.array(np.broadcast_to(wall_friction, (dim, 2)), float)
        self.wall_impulse = np.zeros((dim, 2, dim))
        """Impulse of each wall on the sand during the last step, (dim, 2, dim) [N s]."""
        self.force = np.zeros((len(self.bodies), dim))
        """Force of the sand on each body at the last step, (nbody, dim) [N, in the plane N/m]."""
        self.moment = np.zeros((len(self.bodies), 1 if dim == 2 else 3))
        """Moment of the sand about each body's origin, (nbody, 1 or 3) [N m, in the plane N]."""
        self.xpic, self.calm = xpic, calm
        self._absorb = np.array(np.broadcast_to(absorb, (dim, 2)), float)
        self._shape = np.array(cells) + 3
        self._low = np.zeros(dim)
        self._kernels = _kernels(dim)
        nodes = int(np.prod(self._shape))
        self._grid, self._flow = np.zeros((nodes, ROW)), np.zeros((nodes, ROW))
        self.inset = inset * dx
        self.surfaces = [body.shape.surface(spacing * dx, self.inset) for body in self.bodies]
        """Surface of each body where it touches the sand, `inset` inside its own."""
        self.traction = [np.zeros_like(surface.points) for surface in self.surfaces]
        """Traction of each body on the sand at the last step, at its points and in its frame, (n, dim) [Pa]."""
        self._check()

    def _check(self) -> None:
        p = self.particles
        if len(p) == 0:
            raise MpmError("there is no sand")
        if (p.x < 0.0).any() or (p.x > self.size).any():
            raise MpmError(f"particles lie outside the box of {' x '.join(f'{s:g}' for s in self.size)} m")
        for body, surface in zip(self.bodies, self.surfaces, strict=True):
            if len(surface.points) == 0:
                raise MpmError(
                    f"{body.shape.name} is too thin for cells of {self.dx:g} m: contact lies {self.inset:g} m inside "
                    "its surface; use smaller cells"
                )

    def clear_bodies(self) -> None:
        """Take away the sand in the places that bodies occupy."""
        keep = np.ones(len(self.particles), bool)
        for body in self.bodies:
            keep &= body.shape.distances(body.to_local(self.particles.x)) > -self.inset
        self.particles.select(keep)
        self._check()

    def step(self) -> None:
        """Move sand and bodies by one time step."""
        if self.steps % SORT_EVERY == 0:
            self._sort()
        p, k, grid = self.particles, self._kernels, (self._low, 1.0 / self.dx, self._shape)
        if self.xpic:
            self._filter(self.xpic)
        if self.calm and self.steps % CALM_EVERY == 0:
            self._filter(CALM_ORDER, min(1.0, CALM_EVERY * self.dt / self.calm))
        if self._absorb.any() and self.steps % ABSORB_EVERY == 0:
            self._damp()
        k.scatter(p.x, p.v, p.mass, p.volume, p.stress, *grid, self._grid)
        self._touch()
        k.step(self._grid, self._shape, self.gravity, self.dt, self.wall_friction, self._flow, self.wall_impulse)
        k.gather(
            p.x, p.v, p.mass, p.volume, p.stress, p.theta, p.theta_d, p.strain, *grid, self._flow, self.dt,
            self.material.constants(self.dt),
        )  # fmt: skip
        self.steps += 1
        self.time = self.steps * self.dt
        for i, body in enumerate(self.bodies):
            body.advance(self.force[i], self.moment[i], self.time, self.dt)

    def _sort(self) -> None:
        p = self.particles
        if not np.isfinite(p.x).all() or (p.x < 0.0).any() or (p.x > self.size).any():
            raise MpmError(f"sand left the box at {self.time:g} s: make it larger or the motion slower")
        p.select(self._kernels.order(p.x, self._low, 1.0 / self.dx, self._shape))

    def _filter(self, order: int, share: float = 1.0) -> None:
        """XPIC of order m [Hammerquist and Nairn 2017]: v -> (1 - (1 - P)^m) v, or a share of that change."""
        p = self.particles
        rest = p.v.copy()
        for _ in range(order):
            self._kernels.project(p.x, p.mass, self._low, 1.0 / self.dx, self._shape, self._grid, rest)
        p.v -= rest if share == 1.0 else share * rest

    def _damp(self) -> None:
        """Take from the velocities in absorbing layers, by a rate that grows with the square of the way into them."""
        p, wave = self.particles, self.material.wave_speed
        for axis, widths in enumerate(self._absorb):
            for side, width in enumerate(widths):
                if width > 0.0:
                    way = p.x[:, axis] if side == 0 else self.size[axis] - p.x[:, axis]
                    inside = np.flatnonzero(way < width)
                    rate = 3.0 * ABSORBED * wave / width * (1.0 - way[inside] / width) ** 2
                    p.v[inside] *= np.exp(-ABSORB_EVERY * self.dt * rate)[:, None]

    def _touch(self) -> None:
        full = self.material.rho_c * self.dx**self.particles.dim
        stiffness = CONTACT_STIFFNESS * self.material.young / self.dx * self.dt
        for i, (body, surface) in enumerate(zip(self.bodies, self.surfaces, strict=True)):
            place, push = np.empty_like(surface.points), np.empty_like(surface.points)
            self._kernels.touch(
                self._grid, self._low, 1.0 / self.dx, self._shape, full,
                (body.position, body.rotation, body.velocity, body.spin), *surface,
                stiffness, body.friction, self.traction[i], place, push,
            )  # fmt: skip
            self.force[i] = -push.sum(axis=0)
            arm = place - body.position
            if arm.shape[1] == 2:
                self.moment[i, 0] = float(np.sum(arm[:, 0] * push[:, 1] - arm[:, 1] * push[:, 0]))
            else:
                self.moment[i] = -np.cross(arm, push).sum(axis=0)


Watch = Callable[[Simulation, float], None]
"""Called after each step with the simulation and the share of the whole that is done."""
