"""The parts of a model that a recording shows, and the numbers that it keeps of each moment."""

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rftsim.model.bounds import bounds
from rftsim.model.geometry import MESHES, bounding_geoms
from rftsim.model.ground import ground
from rftsim.model.readout import Instance, body_velocities, instances, tractions, wrenches
from rftsim.model.shaping import Fineness, body_surface
from rftsim.model.standing import moving_weight
from rftsim.surface.triangles import Array
from rftsim.view.forces import resultants
from rftsim.view.tiles import Tiles


class Plane(NamedTuple):
    """The free surface of a bed of sand, with axes in it."""

    along: Array
    """Unit vector in the surface and in the x-z plane, shape (3,)."""
    across: Array
    """Unit vector in the surface, normal to `along`, shape (3,)."""
    up: Array
    """Unit normal, out of the sand, shape (3,)."""
    offset: float
    """Distance of the surface from the world's origin, along `up` [m]."""


class Bed(NamedTuple):
    """A bed of sand as it is shown: a plane that follows the bodies, or tiles of ground that stay."""

    instance: Instance
    """The bed."""
    plane: Plane
    """Its free surface, where it is a plane."""
    tiles: Tiles | None
    """The ground that has been seen; None of a plane that keeps no marks."""


class Skin(NamedTuple):
    """The drawn triangles of a body that feels the sand."""

    body: int
    """The body's id."""
    geoms: list[int]
    """Ids of the geoms that the triangles stand for."""
    area: float
    """Area of what feels the sand [m^2]."""
    triangles: Array
    """Corners in the body's frame [m], shape (nface, 3, 3)."""
    nearest: NDArray[np.intp]
    """Index of the triangle of `tractions` whose traction each shows, shape (nface,)."""


class Portrait(NamedTuple):
    """A model as recordings show it: its sand, its bodies, and their size and weight."""

    model: mujoco.MjModel
    """The compiled model."""
    beds: list[Bed]
    """Each bed of sand, and what has been seen of it."""
    skins: list[Skin]
    """The drawn triangles of each body that feels sand."""
    roots: list[int]
    """Ids of the bodies whose speed is shown; the view follows the first."""
    weight: float
    """Weight of everything that can move [N]."""
    centre: Array
    """Middle of everything that can move, at the start [m], shape (3,)."""
    extent: float
    """Longest side of a box around everything that can move [m]."""

    @property
    def cell(self) -> float:
        """Side of a cell of the sand's grid [m]."""
        return _round_down(self.extent / 3.0)

    @property
    def felt(self) -> list[int]:
        """Ids of the bodies that feel sand."""
        return [skin.body for skin in self.skins]

    def name(self, body: int) -> str:
        """The name of a body, or one made of its id where it has none."""
        return self.model.body(body).name or f"body{body}"


class Frame(NamedTuple):
    """The numbers of one moment; or, with one more axis in front, those of all frames."""

    time: Any
    """Time of the recording [s]."""
    position: Array
    """Origin of each body [m], shape (nbody, 3)."""
    quaternion: Array
    """Attitude of each body in Rerun's order, xyzw, shape (nbody, 4)."""
    speed: Array
    """Speed of each root body [m/s], shape (nroot,)."""
    force: Array
    """The sand's force on each body that feels it [N], shape (nfelt, 3)."""
    moment: Array
    """The sand's moment about each such body's origin [N m], shape (nfelt, 3)."""
    start: Array
    """Point of the free surface above where each such force acts [m], shape (nfelt, 3), see `Resultant`."""
    depth: Array
    """Depth of each such body's deepest triangle [m], shape (nfelt,)."""
    power: Any
    """Power of the sand on all bodies [W]."""
    traction: NDArray[np.float32]
    """Traction on each drawn triangle, one skin after the other [Pa]; -1 where it is not active."""


def describe(model: mujoco.MjModel) -> Portrait:
    """Gather what a recording shows of a model, as the model stands at its start."""
    start = mujoco.MjData(model)
    mujoco.mj_kinematics(model, start)
    beds = instances(model)
    skins = [_make_skin(model, start, body) for bed in beds for body in bed.bodies]
    roots = np.unique(model.body_rootid[[skin.body for skin in skins] or slice(1, None)]).tolist()
    centre, extent = bounds(model, start)
    shown = [Bed(bed, _make_plane(bed.bed), _make_tiles(model, start, bed, extent)) for bed in beds]
    return Portrait(model, shown, skins, roots, moving_weight(model), centre, extent)


def _make_tiles(model: mujoco.MjModel, data: mujoco.MjData, bed: Instance, extent: float) -> Tiles | None:
    spacing = ground(model, data, bed.name).spacing
    return None if spacing is None else Tiles(min(spacing), extent)


def note_ground(portrait: Portrait, data: mujoco.MjData, time: float) -> None:
    """Keep the ground around the bodies, where it is new or has changed, to stand at a time of the recording [s]."""
    for bed, _, tiles in portrait.beds:
        if tiles is not None:
            places = data.xpos[list(bed.bodies), :2]
            tiles.note(places, ground(portrait.model, data, bed.name), time)


def _make_skin(model: mujoco.MjModel, start: mujoco.MjData, body: int) -> Skin:
    """Take the corners of what feels the sand from its geoms, as they are or as hulls: `tractions` has none."""
    felt = tractions(model, start, body)
    area = float(felt.area.sum())
    geoms = bounding_geoms(model, body, "all")
    for meshes in MESHES:
        drawn = body_surface(model, body, Fineness("all", meshes))
        if drawn is not None and np.isclose(drawn.areas.sum(), area, rtol=0.05):  # facets have a little less
            break
    assert drawn is not None, "a body that feels sand has geoms"
    rotation = start.xmat[body].reshape(3, 3)
    centres, normals = (felt.centre - start.xpos[body]) @ rotation, drawn.size * felt.normal @ rotation
    tree = cKDTree(np.hstack([centres, normals]))  # normals too, so that thin plates keep their sides apart
    _, nearest = tree.query(np.hstack([drawn.centres, drawn.size * drawn.normals]))
    return Skin(body, geoms, area, drawn.triangles, nearest)


def _make_plane(bed: Any) -> Plane:
    up = bed.up.copy()
    along = np.array([up[2], 0.0, -up[0]]) / math.hypot(up[2], up[0])
    return Plane(along, np.cross(up, along), up, float(bed.offset))


def _round_down(x: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed x."""
    power = 10.0 ** math.floor(math.log10(x))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= x)


def sample(portrait: Portrait, data: mujoco.MjData, time: float) -> Frame:
    """Read one frame from a model's data, to stand at a time of the recording [s]."""
    sand, felt = wrenches(portrait.model, data), portrait.felt
    found = [tractions(portrait.model, data, body) for body in felt]
    strengths = [
        np.where(one.active, np.linalg.norm(one.stress, axis=1), -1.0)[skin.nearest]
        for one, skin in zip(found, portrait.skins, strict=True)
    ]
    return Frame(
        time=time,
        position=data.xpos.copy(),
        quaternion=data.xquat[:, [1, 2, 3, 0]],
        speed=np.linalg.norm(body_velocities(portrait.model, data)[0][portrait.roots], axis=1),
        force=sand.force[felt],
        moment=sand.moment[felt],
        start=np.array([one.start for one in resultants(portrait.model, data)]).reshape(-1, 3),
        depth=np.array([one.depth.max() for one in found]),
        power=sand.power.sum(),
        traction=np.concatenate([np.empty(0), *strengths], dtype=np.float32),
    )
