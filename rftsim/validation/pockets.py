"""Grousers that shade one another: which sand between them moves, and which is carried along.

Between two grousers the sand can do one of two things: flow in the pocket, so that hub and grousers feel it (the wheel
as it is), or stay there and turn with the wheel, so that sand shears on sand along the circle of the tips (a disc of
the tips' radius whose friction is the sand's own). By the upper bound theorem of limit analysis a frictional body gives
way where that costs least power; so each pocket takes the cheaper of the two. Nothing is fitted.

Unlike [Agarwal] section 4.6.2, where every grouser keeps a third of its height.
"""

from typing import Any, NamedTuple

import numpy as np
from rftsim_models.outline import extruded, lugged_outline

from rftsim.law import evaluate, layout
from rftsim.law.laws import get_law
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.medium import Sand
from rftsim.surface.triangles import Array, Surface, make_surface

STRIPS, RINGS = 4, 6
"""Strips across the rim and rings on the sides of the wheel's mesh."""


class Solid(NamedTuple):
    """A surface, and its form for repeated evaluation."""

    surface: Surface
    """Its triangles."""
    numbers: Array
    """The same, packed for evaluation."""


class Grousers(NamedTuple):
    """A grousered wheel about the y axis; lengths in metres."""

    hub: float
    """Radius of the hub [m]."""
    tip: float
    """Radius of the grousers' tips [m]."""
    width: float
    """Width of the wheel [m]."""
    number: int
    """Number of grousers."""
    thickness: float
    """Thickness of a grouser along the rim [m]."""

    @property
    def pitch(self) -> float:
        """Angle between one grouser and the next [rad]."""
        return 2 * np.pi / self.number

    def with_height(self, share: float) -> Solid:
        """Make the wheel with grousers of a share of their height."""
        height = share * (self.tip - self.hub)
        return self._extruded(self.hub, height)

    def disc(self) -> Solid:
        """Make the disc whose rim is the circle of the tips."""
        return self._extruded(self.tip, 0.0)

    def _extruded(self, radius: float, height: float) -> Solid:
        outline = lugged_outline(radius, self.number, height, self.thickness, arc=6, flank=3 if height else 1, top=2)
        surface = make_surface(*extruded(outline, self.width, rings=RINGS, strips=STRIPS))
        return Solid(surface, layout.pack_surface(surface))

    def pocket_of(self, surface: Surface) -> Any:
        """Number of the pocket that each triangle belongs to, from the middle of one grouser to the next, (ntri,)."""
        angle = np.arctan2(surface.centres[:, 2], surface.centres[:, 0])
        return np.floor(angle / self.pitch).astype(int) % self.number


class Motion(NamedTuple):
    """Pose and motion of a wheel whose axle is parallel to y."""

    height: float
    """Height of the axle above the sand [m]."""
    phase: float
    """Angle that the wheel has turned about y [rad]."""
    velocity: Array
    """Velocity of the axle [m/s], shape (3,)."""
    rate: float
    """Angular velocity about y [rad/s]."""


class Shaded:
    """A wheel each of whose pockets flows or is carried along, whichever costs less power."""

    def __init__(self, wheel: Grousers) -> None:
        self.wheel = wheel
        self.flowing, self.carried = wheel.with_height(1.0), wheel.disc()

    def force(self, sand: Sand, motion: Motion, law: str) -> Array:
        """Force of the sand on the wheel under a law [N], shape (3,)."""
        flowing, flowing_power = self._by_pocket(self.flowing, sand, sand, motion, law)
        carried, carried_power = self._by_pocket(self.carried, sand, _on_itself(sand), motion, law)
        flows = flowing_power >= carried_power  # the sand's power is negative
        total: Array = np.where(flows[:, None], flowing, carried).sum(axis=0)
        return total

    def _by_pocket(self, solid: Solid, sand: Sand, rim: Sand, motion: Motion, law: str) -> tuple[Array, Array]:
        """Force [N] and power [W] on each pocket, (number, 3) and (number,); at the rim by the friction of `rim`."""
        surface, count = solid.surface, self.wheel.number
        loads, velocity = _loads(solid, sand, motion, law)
        if rim is not sand:
            is_rim = np.abs(surface.normals[:, 1]) < 0.5
            loads = np.where(is_rim[:, None], _loads(solid, rim, motion, law)[0], loads)
        pocket = self.wheel.pocket_of(surface)
        forces = np.zeros((count, 3))
        np.add.at(forces, pocket, loads)
        power = np.zeros(count)
        np.add.at(power, pocket, np.einsum("ij,ij->i", loads, velocity))
        return forces, power


def force(solid: Solid, sand: Sand, motion: Motion, law: str) -> Array:
    """Force of the sand on a solid as it is [N], shape (3,)."""
    total: Array = _loads(solid, sand, motion, law)[0].sum(axis=0)
    return total


def _on_itself(sand: Sand) -> Sand:
    """Make the sand whose friction with a surface is that with itself."""
    assert sand.mu_int is not None, "the pockets need the sand's internal friction"
    return sand.replace(mu_surf=sand.mu_int)


def _loads(solid: Solid, sand: Sand, motion: Motion, law: str) -> tuple[Array, Array]:
    """Force [N] on and velocity [m/s] of each triangle, (ntri, 3) each."""
    c, s = np.cos(motion.phase), np.sin(motion.phase)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    omega, place = np.array([0.0, motion.rate, 0.0]), np.array([0.0, 0.0, motion.height])
    bed = layout.pack_bed(sand, get_law(law), FreeSurface(), (0.0, 1.0, 0.0))
    stress, _ = evaluate.triangle_stresses(bed, solid.numbers, place, rotation.ravel(), motion.velocity, omega)
    velocity = motion.velocity + np.cross(omega, solid.surface.centres @ rotation.T)
    return stress @ rotation.T * solid.surface.areas[:, None], velocity
