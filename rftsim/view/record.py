"""A run as a Rerun recording: the bodies, what the sand does to them, and any scalars, over simulated time."""

import math
import os
import types
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import RrdReader
from scipy.spatial import cKDTree

from rftsim.errors import RftsimError, SceneError
from rftsim.law import layout
from rftsim.model.geometry import body_surface, geom_triangles, is_colliding
from rftsim.model.readout import Instance, body_velocities, instances, tractions, wrenches
from rftsim.surface.triangles import Array

OWN_PATHS: Final = ("world", "sand", "speed", "about")
"""First elements of the paths that the recorder itself writes."""
INACTIVE: Final = (150, 150, 150)
STOPS: Final = ((252, 197, 192), (250, 159, 181), (247, 104, 161), (197, 27, 138), (122, 1, 119))
"""Traction from none to the strongest, evenly spaced, ever darker: ColorBrewer's RdPu."""
SAND: Final = (0.76, 0.70, 0.50, 0.2)
GRID_CELLS: Final = 16
"""Along each side of the drawn sand."""
_BLOCK: Final = 64
"""Frames per chunk of the file."""

Channel = tuple[str, Any, dict[str, NDArray[Any]]]
"""Entity, Rerun archetype, and its fields in all frames, (nframe, ...)."""


class Recorder:
    """Records one MuJoCo simulation for the Rerun viewer.

    Under `world`: the geoms (not planes and height fields, which have no end), the surfaces that feel the sand coloured
    by traction, an arrow of the sand's force from each body's origin, and the sand's surface, which follows the bodies
    in whole cells of its grid. Under `sand`: force [N], moment about the body's origin [N m] and depth of the deepest
    triangle [m] of each body, and the total power [W]. Under `speed`: that of each root body [m/s]. All are those of
    the last mj_forward or mj_step of the data. `about` states the scales, which are those of the whole recording.

    Frames stay in memory, some 4 bytes per triangle each, until `close` writes the file. An exception inside the
    with-block does so too: the frames before it show what went wrong. When a reset turns time back, the recording goes
    on one period after its last frame.

    Args:
        model: A compiled model, with or without sand.
        path: The file, `*.rrd`; one that exists is replaced at `close`.
        application_id: Under which the viewer groups recordings.
        fps: Frames per second of simulated time.

    Attributes:
        path: The file.
        frames: How many frames were recorded.

    Raises:
        RftsimError: The path cannot be written.
    """

    def __init__(
        self, model: mujoco.MjModel, path: "str | Path", application_id: str = "rftsim", fps: float = 50.0
    ) -> None:
        if not 0.0 < fps < math.inf:
            raise RftsimError(f"fps must be positive and finite, not {fps:g}")
        self.path = Path(path).resolve()
        _check_writable(self.path)
        self._application_id, self._period, self._shift = application_id, 1.0 / fps, 0.0
        self._scene = _describe(model)
        self._frames: list[_Frame] = []
        self._scalars: dict[str, list[tuple[float, float]]] = {}
        self._closed = False

    @property
    def frames(self) -> int:
        """How many frames were recorded."""
        return len(self._frames)

    def log(self, data: mujoco.MjData, scalars: Mapping[str, float] | None = None) -> bool:
        """Record a frame, unless the last one is less than a period ago.

        Args:
            data: The model's data.
            scalars: More values of this frame, by path: `command/speed`. The first element groups them into plots.

        Returns:
            Whether a frame was recorded.

        Raises:
            RftsimError: The recorder is closed, or a scalar's path is one of its own.
        """
        if self._closed:
            raise RftsimError(f"the recorder of {self.path} is closed")
        time, last = data.time + self._shift, self._frames[-1].time if self._frames else -math.inf
        if time < last:
            self._shift = last + self._period - data.time
            time = last + self._period
        elif time - last < self._period * (1.0 - 1e-6):  # sums of time steps are not exact
            return False
        extra = {_scalar_entity(path): float(value) for path, value in (scalars or {}).items()}
        self._frames.append(_sample(self._scene, data, time))
        for entity, value in extra.items():
            self._scalars.setdefault(entity, []).append((time, value))
        return True

    def close(self) -> None:
        """Write the file beside its place, read it back and put it there; does nothing a second time.

        Raises:
            RftsimError: Frames are missing from the file, as on a full disk; what was at the path is left as it was.
        """
        if self._closed:
            return
        self._closed = True
        stream = rr.RecordingStream(self._application_id, recording_id=uuid.uuid4())
        memory = stream.memory_recording()  # unlike save, which on a full disk goes on, or waits for ever
        stream.send_recording_name(self.path.stem)
        stream.send_blueprint(_blueprint(self._scene, self._scalars))
        rows = _send(stream, self._scene, self._frames, self._scalars)
        _put(memory.drain_as_bytes(), rows, self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        self.close()


class _Scene(NamedTuple):
    """What a recording needs of a model."""

    model: mujoco.MjModel
    beds: "list[tuple[Instance, _Plane]]"
    skins: "list[_Skin]"
    roots: list[int]
    """Bodies whose speed is shown; the view follows the first."""
    weight: float
    """Of all that can move [N]."""
    centre: Array
    """Of what can move, at the start [m]."""
    extent: float
    """[m]."""

    @property
    def cell(self) -> float:
        """Side of the sand's grid [m]."""
        return _round_number(self.extent / 3.0)

    @property
    def felt(self) -> list[int]:
        """The bodies that feel sand."""
        return [skin.body for skin in self.skins]

    def name(self, body: int) -> str:
        return self.model.body(body).name or f"body{body}"


class _Skin(NamedTuple):
    """The drawn triangles of a body that feels the sand."""

    body: int
    geoms: list[int]
    """The geoms that they stand for."""
    area: float
    """[m^2]."""
    triangles: Array
    """Body frame [m], shape (nface, 3, 3)."""
    nearest: NDArray[np.intp]
    """The triangle of `tractions` that each shows, shape (nface,)."""


class _Plane(NamedTuple):
    """The surface of a bed of sand: unit vectors along, across and up, and its height along up [m]."""

    along: Array
    across: Array
    up: Array
    offset: float


class _Frame(NamedTuple):
    """One moment; or, with one more axis in front, all of them."""

    time: Any
    """[s]."""
    position: Array
    """[m], shape (nbody, 3)."""
    quaternion: Array
    """Rerun's, xyzw, shape (nbody, 4)."""
    speed: Array
    """[m/s], shape (nroot,)."""
    force: Array
    """[N], shape (nfelt, 3)."""
    moment: Array
    """[N m], shape (nfelt, 3)."""
    depth: Array
    """[m], shape (nfelt,)."""
    power: Any
    """[W]."""
    traction: NDArray[np.float32]
    """Of each drawn triangle of one skin after the other [Pa]; -1 where it is not active."""


def _describe(model: mujoco.MjModel) -> _Scene:
    start = mujoco.MjData(model)
    mujoco.mj_kinematics(model, start)
    beds = instances(model)
    skins = [_make_skin(model, start, body) for bed in beds for body in bed.bodies]
    roots = np.unique(model.body_rootid[[skin.body for skin in skins] or slice(1, None)]).tolist()
    weight = float(model.body_mass[model.body_weldid != 0].sum() * np.linalg.norm(model.opt.gravity))
    return _Scene(model, [(bed, _make_plane(bed.sand)) for bed in beds], skins, roots, weight, *_bounds(model, start))


def _make_skin(model: mujoco.MjModel, start: mujoco.MjData, body: int) -> _Skin:
    """What feels the sand has no corners, so they come from the geoms: those that have its area."""
    felt = tractions(model, start, body)
    area = float(felt.area.sum())
    own = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
    for collision_only in (True, False):
        drawn = body_surface(model, body, collision_only=collision_only, max_edge=None, allow_open=True)
        geoms = [geom for geom in own if is_colliding(model, geom) or not collision_only]
        if drawn is not None and np.isclose(drawn.areas.sum(), area, rtol=0.05):  # facets have a little less
            break
    assert drawn is not None, "a body that feels sand has geoms"
    rotation = start.xmat[body].reshape(3, 3)
    centres, normals = (felt.centre - start.xpos[body]) @ rotation, drawn.size * felt.normal @ rotation
    tree = cKDTree(np.hstack([centres, normals]))  # normals too, so that thin plates keep their sides apart
    _, nearest = tree.query(np.hstack([drawn.centres, drawn.size * drawn.normals]))
    return _Skin(body, geoms, area, drawn.triangles, nearest)


def _make_plane(sand: Array) -> _Plane:
    value = dict(zip(layout.SAND_FIELDS, sand.tolist(), strict=False))
    up = np.array([value["up_x"], value["up_y"], value["up_z"]])
    along = np.array([up[2], 0.0, -up[0]]) / math.hypot(up[2], up[0])
    return _Plane(along, np.cross(up, along), up, value["offset"])


def _bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, float]:
    """Centre and longest side of a box around the geoms that can move, or MuJoCo's where none can [m]."""
    geoms = (model.body_weldid[model.geom_bodyid] != 0) & (model.geom_rbound > 0.0)
    if not geoms.any():
        return model.stat.center.copy(), float(model.stat.extent)
    radii = model.geom_rbound[geoms, None]
    low, high = (data.geom_xpos[geoms] - radii).min(axis=0), (data.geom_xpos[geoms] + radii).max(axis=0)
    return 0.5 * (low + high), float((high - low).max())


def _sample(scene: _Scene, data: mujoco.MjData, time: float) -> _Frame:
    sand, felt = wrenches(scene.model, data), scene.felt
    found = [tractions(scene.model, data, body) for body in felt]
    shown = [
        np.where(one.active, np.linalg.norm(one.stress, axis=1), -1.0)[skin.nearest]
        for one, skin in zip(found, scene.skins, strict=True)
    ]
    return _Frame(
        time=time,
        position=data.xpos.copy(),
        quaternion=data.xquat[:, [1, 2, 3, 0]],
        speed=np.linalg.norm(body_velocities(scene.model, data)[0][scene.roots], axis=1),
        force=sand.force[felt],
        moment=sand.moment[felt],
        depth=np.array([one.depth.max() for one in found]),
        power=sand.power.sum(),
        traction=np.concatenate([np.empty(0), *shown], dtype=np.float32),
    )


def _send(
    stream: rr.RecordingStream, scene: _Scene, frames: list[_Frame], scalars: Mapping[str, list[tuple[float, float]]]
) -> Counter[str]:
    """Send everything; returns how many rows each entity has."""
    rows: Counter[str] = Counter()

    def send(time: Array, entity: str, archetype: Any, fields: Mapping[str, NDArray[Any]]) -> None:
        for start in range(0, len(time), _BLOCK):
            block = slice(start, start + _BLOCK)
            columns = archetype.columns(**{field: values[block] for field, values in fields.items()})
            stream.send_columns(entity, [rr.TimeColumn("sim_time", duration=time[block])], columns)
        rows[entity] += len(time)

    stacked = _Frame(*map(np.array, zip(*frames, strict=True))) if frames else None
    scales = _scales(scene, stacked)
    for entity, shown in _static(scene, *scales):
        stream.log(entity, shown, static=True)
        rows[entity] += 1
    if stacked is not None:
        for channel in _channels(scene, stacked, *scales):
            send(stacked.time, *channel)
    for entity, pairs in scalars.items():
        time, values = np.array(pairs).T
        send(time, entity, rr.Scalars, {"scalars": values})
    return rows


def _put(recording: bytes, rows: Mapping[str, int], path: Path) -> None:
    """Write a file and see that each entity has all its rows in it, then put it in place."""
    temporary = _beside(path)
    try:
        temporary.write_bytes(recording)
        found: Counter[str] = Counter()
        for chunk in RrdReader(temporary).stream():
            found[chunk.entity_path] += chunk.num_rows
        missing = [entity for entity, count in rows.items() if found[entity] < count]
        if missing:
            raise RftsimError(f"rows are missing of {', '.join(missing)}")
        os.replace(temporary, path)
    except (OSError, ValueError, RuntimeError) as error:
        raise RftsimError(f"the recording could not be written to {path}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _check_writable(path: Path) -> None:
    if path.suffix != ".rrd":
        raise RftsimError(f"a recording must be called *.rrd, by which Rerun knows it, not {path.name!r}")
    try:
        if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
            raise RftsimError(f"cannot write {path}: it exists and is not a file that may be replaced")
        temporary = _beside(path)
        temporary.touch(exist_ok=False)
        temporary.unlink()
    except OSError as error:
        raise RftsimError(f"cannot write {path}: {error.strerror}") from error


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}.rrd")


def _scales(scene: _Scene, frames: _Frame | None) -> tuple[float, float]:
    """Force [N] of an arrow as long as the extent and traction [Pa] of the strongest colour."""
    force = max(scene.weight, 1e-12)
    traction = force / (sum(skin.area for skin in scene.skins) or 1.0)
    if frames is None:
        return force, traction
    return _strong(np.linalg.norm(frames.force, axis=2), force), _strong(frames.traction, traction)


def _strong(values: NDArray[np.floating[Any]], least: float) -> float:
    """What 99 % of the positive values do not exceed, so that one spike does not dwarf the rest; not below least."""
    positive = values[(values > 0.0) & np.isfinite(values)]
    return max(least, float(np.percentile(positive, 99.0))) if positive.size else least


def _channels(scene: _Scene, frames: _Frame, force_scale: float, traction_scale: float) -> Iterator[Channel]:
    """What changes."""
    for body in range(1, scene.model.nbody):
        pose = {"translation": frames.position[:, body], "quaternion": frames.quaternion[:, body]}
        yield _entity("world", "body", scene.name(body)), rr.Transform3D, pose
    for root, speed in zip(scene.roots, frames.speed.T, strict=True):
        yield _entity("speed", scene.name(root)), rr.Scalars, {"scalars": speed}
    for bed, plane in scene.beds:
        middle = frames.position[:, list(bed.bodies)].mean(axis=1)
        yield _entity("world", "sand", bed.name), rr.Transform3D, {"translation": _snapped(middle, plane, scene.cell)}
    if scene.skins:
        yield "/sand/power", rr.Scalars, {"scalars": frames.power}
    ends = np.cumsum([len(skin.nearest) for skin in scene.skins])
    for i, skin in enumerate(scene.skins):
        name, traction = scene.name(skin.body), frames.traction[:, ends[i] - len(skin.nearest) : ends[i]]
        for quantity, values in ("force", frames.force), ("moment", frames.moment), ("depth", frames.depth):
            yield _entity("sand", quantity, name), rr.Scalars, {"scalars": values[:, i]}
        arrow = {"origins": frames.position[:, skin.body], "vectors": frames.force[:, i] * (scene.extent / force_scale)}
        yield _entity("world", "force", name), rr.Arrows3D, arrow
        colours = np.repeat(traction_colours(traction, traction_scale), 3, axis=1)  # one for each corner
        yield _entity("world", "body", name, "skin"), rr.Mesh3D, {"vertex_colors": colours}


def _static(scene: _Scene, force_scale: float, traction_scale: float) -> Iterator[tuple[str, rr.AsComponents]]:
    """What stays."""
    about = (
        f"**Arrows**: the sand's force, {scene.extent:.3g} m long for {force_scale:.3g} N. **Colours**: traction, "
        f"darkest from {traction_scale:.3g} Pa on; grey where the sand does not act. **Grid**: {scene.cell:g} m."
    )
    yield "/about", rr.TextDocument(about, media_type="text/markdown")
    yield "/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    for bed, plane in scene.beds:
        for shape in _sand_shape(plane, scene.cell):
            yield _entity("world", "sand", bed.name), shape
    for skin in scene.skins:
        name = scene.name(skin.body)
        yield _entity("world", "body", name, "skin"), _mesh(skin.triangles)
        yield _entity("world", "force", name), rr.Arrows3D.from_fields(radii=0.01 * scene.extent, colors=0x2878FFFF)
        for quantity in ("force", "moment"):
            yield _entity("sand", quantity, name), rr.SeriesLines(names=[f"{name} {axis}" for axis in "xyz"])
    skinned = [geom for skin in scene.skins for geom in skin.geoms]
    for geom in np.setdiff1d(range(scene.model.ngeom), skinned).tolist():
        body = int(scene.model.geom_bodyid[geom])
        mesh = _geom_mesh(scene.model, geom, opacity=0.3 if body in scene.felt else 1.0)  # not to hide the skin
        if mesh is not None:
            name = scene.model.geom(geom).name or f"geom{geom}"
            yield _entity("world", "body", scene.name(body), name), mesh


def traction_colours(traction: NDArray[np.floating[Any]], scale: float) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of tractions [Pa], the darkest from scale on; grey where they are negative, or not numbers."""
    strength = np.minimum(np.where(traction >= 0.0, traction, 0.0) / scale, 1.0)
    return _PALETTE[np.where(traction >= 0.0, 1.0 + 254.0 * strength, 0.0).astype(np.intp)]


def _palette() -> NDArray[np.uint32]:
    """Inactive, then 255 shades."""
    places, at = np.linspace(0.0, 1.0, len(STOPS)), np.linspace(0.0, 1.0, 255)
    shades = np.stack([np.interp(at, places, channel) for channel in np.array(STOPS).T], axis=1)
    rgb = np.vstack([INACTIVE, shades.round()]).astype(np.uint32)
    palette: NDArray[np.uint32] = (rgb[:, 0] << 24) + (rgb[:, 1] << 16) + (rgb[:, 2] << 8) + np.uint32(255)
    return palette


_PALETTE: Final = _palette()


def _snapped(place: Array, plane: _Plane, cell: float) -> Array:
    """The corners of the sand's grid nearest to places, (n, 3)."""
    corners: Array = plane.offset * plane.up + sum(
        cell * np.rint(place @ axis / cell)[:, None] * axis for axis in (plane.along, plane.across)
    )
    return corners


def _round_number(x: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed x."""
    power = 10.0 ** math.floor(math.log10(x))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= x)


def _sand_shape(plane: _Plane, cell: float) -> tuple[rr.Mesh3D, rr.LineStrips3D]:
    """A translucent square about the origin, and the grid on it."""
    along, across = plane.along, plane.across
    half = GRID_CELLS / 2 * cell
    corners = [half * (i * along + j * across) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    grid = [
        [offset * one - half * other, offset * one + half * other]
        for one, other in ((along, across), (across, along))
        for offset in np.linspace(-half, half, GRID_CELLS + 1)
    ]
    mesh = rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 1, 2], [0, 2, 3]], albedo_factor=SAND)
    return mesh, rr.LineStrips3D(grid, colors=SAND, radii=rr.Radius.ui_points(0.5))


def _geom_mesh(model: mujoco.MjModel, geom: int, opacity: float) -> rr.Mesh3D | None:
    """The geom in its body's frame; None where it is invisible or endless."""
    rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
    if material >= 0 and (rgba == (0.5, 0.5, 0.5, 1.0)).all():  # MuJoCo's rule: the default gives way
        rgba = model.mat_rgba[material]
    try:
        vertices, faces = geom_triangles(model, geom)
    except SceneError:
        return None
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    placed = vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom]
    return _mesh(placed[faces], rgba * [1.0, 1.0, 1.0, opacity]) if rgba[3] else None


def _mesh(triangles: Array, rgba: Array | None = None) -> rr.Mesh3D:
    """Triangles, (n, 3, 3), that share no corners: shaded flat, and each can have its colour."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3), vertex_normals=np.repeat(normals, 3, axis=0), albedo_factor=rgba
    )


def _entity(*parts: str) -> str:
    return rr.new_entity_path(list(parts))


def _scalar_entity(path: str) -> str:
    parts = path.strip("/").split("/")
    if parts[0] in OWN_PATHS or not all(parts):
        raise RftsimError(
            f"a scalar's path is a group and a name, the group not of {', '.join(OWN_PATHS)}; not {path!r}"
        )
    return _entity(*parts)


def _blueprint(scene: _Scene, scalars: Iterable[str]) -> rrb.Blueprint:
    """The bodies on the left; plots of the sand and of each group of scalars on the right."""
    eye = rrb.EyeControls3D(
        position=scene.centre + scene.extent * np.array([0.8, -1.6, 0.8]),
        look_target=scene.centre,
        tracking_entity=_entity("world", "body", scene.name(scene.roots[0])) if scene.roots else None,
    )
    view = rrb.Spatial3DView(origin="/world", name="Simulation", eye_controls=eye, line_grid=False)
    about = rrb.TextDocumentView(origin="/about", name="Scales")
    plots = {"/sand/force": "Force [N]", "/sand/power": "Power [W]", "/sand/depth": "Depth [m]"} if scene.skins else {}
    plots |= {"/speed": "Speed [m/s]"}
    plots |= {f"/{group}": group for group in dict.fromkeys(entity.split("/")[1] for entity in scalars)}
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(view, about, row_shares=[7, 1]),
            rrb.Vertical(*(rrb.TimeSeriesView(origin=origin, name=name) for origin, name in plots.items())),
            column_shares=[2, 1],
        ),
        rrb.TimePanel(timeline="sim_time", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
