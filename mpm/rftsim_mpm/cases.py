"""The four verification cases of [Agarwal] section 2.4."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rftsim_mpm.bed import level_bed
from rftsim_mpm.body import Body, speeding_up
from rftsim_mpm.errors import MpmError, check_not_negative
from rftsim_mpm.fields import Frame
from rftsim_mpm.follow import Track, follow, part
from rftsim_mpm.material import Material, stiffness
from rftsim_mpm.reading import AVERAGE
from rftsim_mpm.shapes import box, disc
from rftsim_mpm.simulation import Simulation, Watch

Array = NDArray[np.float64]
GRAVITY = 9.8
"""Acceleration of gravity as in the source [m/s^2]."""


def _whole_cells(size: tuple[float, float], dx: float) -> tuple[float, float]:
    """A bed's size, rounded up to whole cells [m]."""
    return math.ceil(size[0] / dx) * dx, math.ceil(size[1] / dx) * dx


def _sim(
    material: Material,
    size: tuple[float, float],
    dx: float,
    top: float,
    bodies: list[Body],
    phi: float | None = None,
    absorb: float = 0.0,
) -> Simulation:
    """Bodies in a level bed of the initial packing `phi`, the box's walls at `top` and as rough as the bodies."""
    bed = level_bed(material, size, dx, gravity=GRAVITY, phi=phi)
    friction, layers = bodies[0].friction, np.array([[absorb, absorb], [absorb, 0.0]])
    sim = Simulation(
        material, bed, dx, (size[0], top), bodies=bodies, gravity=GRAVITY, wall_friction=friction, absorb=layers
    )
    sim.clear_bodies()
    return sim


@dataclasses.dataclass(frozen=True)
class CylinderDrag:
    """Case 1: a cylinder dragged at several depths (NDPM)."""

    depths: tuple[float, ...] = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07)
    """Depths of the axis [m]."""
    diameter: float = 0.004
    """Diameter of the cylinder [m]."""
    cells: float = 5.0
    """Cells per diameter; the source has 8."""
    speed: float = 0.15
    """Speed of the cylinder [m/s]."""
    travel: float = 3.0
    """Length of the way [diameters]."""
    mu_int: float = 0.48
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and cylinder [-]."""
    rho: float = 1512.0
    """Critical density of the sand [kg/m^3]."""
    width: float = 0.1
    """Width of the bed [m]; the source has 0.20 x 0.16."""


class CylinderForces(NamedTuple):
    """Drag and lift over pi (D/2)^2 rho g, the means of the last 40 % of the way."""

    depth: Array
    """Depths of the axis, (n,) [m]."""
    drag: Array
    """Force against the motion over pi (D/2)^2 rho g, (n,) [-]."""
    lift: Array
    """Upward force over pi (D/2)^2 rho g, (n,) [-]."""
    r_squared: float
    """Coefficient of determination of a straight line through the drag [-]."""
    frames: list[Frame]
    """The sand at the end of each run."""


def cylinder_drag(study: CylinderDrag, watch: Watch | None = None) -> CylinderForces:
    """Run case 1 of the source, the dragged cylinder."""
    if len(study.depths) < 3 or min(study.depths) < 1.5 * study.diameter:
        raise MpmError("case 1 needs three or more depths, each at least 1.5 diameters")
    dx = study.diameter / study.cells
    unit = math.pi * (study.diameter / 2.0) ** 2 * study.rho * GRAVITY
    forces, frames = [], []
    for i, depth in enumerate(study.depths):
        young = stiffness(study.rho, GRAVITY, depth, study.mu_int, 0.01)
        material = Material.of_density(study.mu_int, study.rho, young)
        size = _whole_cells((study.width, depth + 8.0 * study.diameter), dx)
        place = np.array([0.5 * size[0], size[1] - depth])
        body = Body(disc(study.diameter / 2.0), place, np.array([study.speed, 0.0]), study.mu_surf)
        sim = _sim(material, size, dx, size[1] + 4.0 * study.diameter, [body])
        duration = study.travel * study.diameter / study.speed
        track = follow(sim, duration, part(watch, i, len(study.depths)))
        forces.append(track.after(0.6 * duration).force[:, 0].mean(axis=0) / unit)
        frames.append(track.frames[-1])
    depths, force = np.array(study.depths), np.array(forces)
    line = np.polyval(np.polyfit(depths, -force[:, 0], 1), depths)
    rest = ((-force[:, 0] - line) ** 2).sum() / ((force[:, 0] - force[:, 0].mean()) ** 2).sum()
    return CylinderForces(depths, -force[:, 0], force[:, 1], 1.0 - float(rest), frames)


@dataclasses.dataclass(frozen=True)
class Plates:
    """Case 2: one plate of several lengths, and two side by side (NDPM)."""

    lengths: tuple[float, ...] = (0.05, 0.1, 0.15, 0.2, 0.25)
    """Lengths of the single plates [m]."""
    gaps: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0)
    """Gaps between two plates of `pair`, in their lengths [-]."""
    pair: float = 0.1
    """Length of each of two plates [m]."""
    depth: float = 0.08
    """How deep the plates are pushed [m]."""
    dx: float = 0.005
    """Size of a cell [m]; the source has 0.00125."""
    speed: float = 0.2
    """Speed of the plates, downward [m/s]; the source has 0.1."""
    run_up: float = 0.01
    """Way in which they evenly come to it, so that no jolt hides the first peak [m]."""
    absorb: float = 0.15
    """Width of the layers before the floor and the walls in which waves die down [m]."""
    mu_int: float = 0.4
    """Internal friction of the sand [-]."""
    mu_surf: float = 0.35
    """Friction between sand and plates [-]."""
    rho: float = 1512.0
    """Critical density of the sand [kg/m^3]."""
    bed: tuple[float, float] = (1.2, 0.6)
    """Width and depth of the bed [m]."""


class PlatesForces(NamedTuple):
    """Forces on the plates of case 2, and the exponents that they grow with."""

    curves: list[tuple[Array, Array]]
    """Depth [m] and force [N/m] of each single plate."""
    peak: Array
    """First peak, the highest force above L/6 [N/m]."""
    deep: Array
    """Mean over the last quarter of the way [N/m]."""
    peak_exponent: float
    """Exponent of L that the first peak grows with [-]."""
    deep_exponent: float
    """Exponent of L that the mean over the last quarter grows with [-]."""
    pair: Array
    """Mean force on each of two plates, over the last quarter, for each gap [N/m]."""
    frame: Frame
    """The sand at the end, about the pair with the last gap."""


def plates(study: Plates, watch: Watch | None = None) -> PlatesForces:
    """Run case 2 of the source, the plates pushed down."""
    if len(study.lengths) < 2:
        raise MpmError("case 2 needs two or more lengths for its exponents")
    check_not_negative(study, "run_up", "absorb")
    count = len(study.lengths) + len(study.gaps)
    curves, pairs = [], []
    for i, length in enumerate(study.lengths):
        track = _push(study, [0.0], length, part(watch, i, count))
        curves.append((_first_height(study) - track.position[:, 0, 1], track.force[:, 0, 1]))
    for i, gap in enumerate(study.gaps):
        offset = 0.5 * (1.0 + gap) * study.pair
        track = _push(study, [-offset, offset], study.pair, part(watch, len(study.lengths) + i, count))
        last = track.after(0.75 * track.time[-1])
        pairs.append(float(last.force[:, :, 1].mean()))
    lengths = np.array(study.lengths)
    peak = np.array([f[z < length / 6.0].max() for length, (z, f) in zip(lengths, curves, strict=True)])
    deep = np.array([f[z > 0.75 * study.depth].mean() for z, f in curves])
    slopes = [float(np.polyfit(np.log(lengths), np.log(f), 1)[0]) for f in (peak, deep)]
    return PlatesForces(curves, peak, deep, slopes[0], slopes[1], np.array(pairs), track.frames[-1])


def _first_height(study: Plates) -> float:
    """Height of the middle of plates that stand on the sand [m]."""
    return _whole_cells(study.bed, study.dx)[1] + 2.0 * study.dx


def _push(study: Plates, offsets: list[float], length: float, watch: Watch | None) -> Track:
    """Push plates of a length down side by side, their middles at offsets from the bed's [m]."""
    young = stiffness(study.rho, GRAVITY, study.depth, study.mu_int, 0.01)
    material = Material.of_density(study.mu_int, study.rho, young)
    size = _whole_cells(study.bed, study.dx)
    shape, down = box(length, 4.0 * study.dx), np.array([0.0, -study.speed])
    places = [np.array([0.5 * size[0] + o, _first_height(study)]) for o in offsets]
    steer = speeding_up(down, study.run_up)
    bodies = [Body(shape, place, np.zeros(2), study.mu_surf, steer=steer) for place in places]
    sim = _sim(material, size, study.dx, size[1] + study.depth + 8.0 * study.dx, bodies, absorb=study.absorb)
    return follow(sim, (study.depth + study.run_up) / study.speed, watch)


@dataclasses.dataclass(frozen=True)
class Plowing:
    """Case 3: a plate plowing sand of several packings (DPM)."""

    packings: tuple[float, ...] = (0.57, 0.59, 0.61, 0.63)
    """Initial packing fractions [-]."""
    chi: float = 2.5
    """Slope of friction against packing: 2.5 in the source's text, 5.0 in its captions [-]."""
    dx: float = 0.006
    """Size of a cell [m]; the source has 0.004."""
    bed: tuple[float, float] = (1.2, 0.2)
    """Width and depth of the bed [m]; the source has 2.4 x 0.4."""
    depth: float = 0.05
    """Depth of the plate's lower edge [m]."""
    travel: float = 0.5
    """Length of the way [m]."""
    speed: float = 0.2
    """Speed of the plate [m/s]."""
    mu_int: float = 0.4
    """Internal friction of the sand at the critical packing [-]."""
    mu_surf: float = 0.35
    """Friction between sand and plate [-]."""


class PlowingForces(NamedTuple):
    """Drag against travel, and how it fluctuates."""

    travel: Array
    """Distance moved, (n,) [m]."""
    drag: list[Array]
    """Force against the motion for each packing, (n,) each [N/m]."""
    mean: Array
    """Mean drag over the last half of the way, for each packing [N/m]."""
    fluctuation: Array
    """Standard deviation about a smooth trend over the last half, after averaging over a cell, relative [-]."""
    frames: list[Frame]
    """The sand at the end, for each packing."""


def plowing(study: Plowing, watch: Watch | None = None) -> PlowingForces:
    """Run case 3 of the source, the plowing plate."""
    drags, frames, means, sizes = [], [], [], []
    travel = np.zeros(0)
    for i, phi in enumerate(study.packings):
        material = Material(study.mu_int, chi=study.chi, young=stiffness(1512.0, GRAVITY, study.depth, 0.5, 0.01))
        size = _whole_cells(study.bed, study.dx)
        place = np.array([0.15, size[1] - study.depth + 0.04])
        body = Body(box(0.03, 0.08), place, np.array([study.speed, 0.0]), study.mu_surf)
        sim = _sim(material, size, study.dx, size[1] + 0.15, [body], phi)
        track = follow(sim, study.travel / study.speed, part(watch, i, len(study.packings)))
        travel, force = track.time * study.speed, -track.force[:, 0, 0]
        late = travel > 0.5 * study.travel
        window = np.ones(max(1, round(study.dx / study.speed / AVERAGE)))
        smooth = np.convolve(force, window / window.size, "same")[late]
        trend = np.polyval(np.polyfit(travel[late], smooth, 2), travel[late])
        inner = slice(window.size, -window.size)
        drags.append(force)
        frames.append(track.frames[-1])
        means.append(smooth.mean())
        sizes.append((smooth - trend)[inner].std() / smooth.mean())
    return PlowingForces(travel, drags, np.array(means), np.array(sizes), frames)


@dataclasses.dataclass(frozen=True)
class ShearZone:
    """Case 4: the rigid wedge that grows under a plate (DPM)."""

    phi: float = 0.55
    """Initial packing fraction [-]."""
    dx: float = 0.002
    """Size of a cell [m]; the source has 0.0005."""
    bed: tuple[float, float] = (0.5, 0.2)
    """Width and depth of the bed [m]."""
    depth: float = 0.04
    """How deep the plate is pushed [m]."""
    speed: float = 0.15
    """Speed of the plate, downward [m/s]."""
    mu_int: float = 0.53
    """Internal friction of the sand at the critical packing [-]."""
    mu_surf: float = 0.35
    """Friction between sand and plate [-]."""
    chi: float = 5.0
    """Slope of friction and dilatancy against packing fraction [-]."""
    phi_c: float = 0.60
    """Critical packing fraction [-]."""
    rho_g: float = 1100.0
    """Density of the grains [kg/m^3]."""


class Wedge(NamedTuple):
    """The sand that moves with the plate, at several moments."""

    time: Array
    """Time of each moment in plate lengths travelled, t v / L [-]."""
    height: Array
    """Height of the sand below the plate that moves with it, in plate lengths [-]."""
    bluntness: Array
    """Width half way down over width at the plate: one for a rectangle, a half for a triangle."""
    track: Track
    """The whole run, with a frame for each moment."""


def shear_zone(study: ShearZone, watch: Watch | None = None) -> Wedge:
    """Run case 4 of the source, the wedge under a plate."""
    young = stiffness(study.phi_c * study.rho_g, GRAVITY, study.depth, study.mu_int, 0.01)
    material = Material(study.mu_int, rho_g=study.rho_g, phi_c=study.phi_c, chi=study.chi, young=young)
    size = _whole_cells(study.bed, study.dx)
    length = 0.04
    place = np.array([0.5 * size[0], size[1] + 0.01])
    body = Body(box(length, 0.02), place, np.array([0.0, -study.speed]), study.mu_surf)
    sim = _sim(material, size, study.dx, size[1] + study.depth + 0.03, [body], study.phi)
    duration = study.depth / study.speed
    shots = [share * duration for share in (0.1, 0.2, 0.35, 0.6)]
    track = follow(sim, duration, watch, shots)
    heights, blunt = zip(*(_wedge(frame, study.speed, length, study.dx) for frame in track.frames), strict=True)
    times = np.array([frame.time for frame in track.frames]) * study.speed / length
    return Wedge(times, np.array(heights), np.array(blunt), track)


def _wedge(frame: Frame, speed: float, length: float, dx: float) -> tuple[float, float]:
    """Height and bluntness of what moves down with at least 0.8 of the plate's speed."""
    outline = frame.outlines[0]
    base, middle = outline[:, 1].min(), outline[:, 0].mean()
    near = (np.abs(frame.place[:, 0] - middle) < 0.6 * length) & (frame.place[:, 1] < base)
    rigid = near & (frame.velocity[:, -1] < -0.8 * speed)
    if rigid.sum() < 10:
        return 0.0, 1.0
    below = base - frame.place[rigid, 1]
    rows = np.floor(below / dx).astype(int)
    widths = np.array([np.ptp(frame.place[rigid, 0][rows == r]) + 0.5 * dx if (rows == r).sum() > 1 else 0.0 for r in
                       range(rows.max() + 1)])  # fmt: skip
    # The wedge ends where its width first falls below two cells: what moves further down is not part of it.
    narrow = np.flatnonzero(widths[1:] < 2.0 * dx)
    count = int(narrow[0]) + 1 if narrow.size else len(widths)
    return count * dx / length, float(widths[count // 2] / max(widths[: max(2, count // 4)].max(), dx))
