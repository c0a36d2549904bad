"""A run as a Rerun recording: the bodies, what the sand does to them, and any scalars, over simulated time."""

import math
import os
import types
import uuid
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import RrdReader
from scipy.spatial import cKDTree

from rftsim import packed
from rftsim.errors import RftsimError, SceneError
from rftsim.geometry import body_surface, geom_triangles, is_colliding
from rftsim.readout import Instance, instances, tractions, wrenches
from rftsim.surface import Array

BLOCK: Final = 64
"""Frames that are gathered before they are written together."""
OWN_PATHS: Final = ("world", "sand", "speed", "about")
"""First elements of the paths that the recorder itself writes."""
INACTIVE: Final = (150, 150, 150)
STOPS: Final = ((252, 197, 192), (250, 159, 181), (247, 104, 161), (197, 27, 138), (122, 1, 119))
"""Traction from none to the strongest, evenly spaced, ever darker: ColorBrewer's RdPu."""
SAND: Final = (0.76, 0.70, 0.50, 0.3)
GRID_CELLS: Final = 16
"""Along each side of the drawn sand."""
ABOUT: Final = """
**Arrows**: the sand's force, {extent:.3g} m long per `sand/scale/force`: the largest so far, at first the weight,
{scale.force:.3g} N. **Colours**: traction, light to dark up to `sand/scale/traction`: the largest so far, at first the
weight over the area, {scale.traction:.3g} Pa; grey where the sand does not act. **Grid**: {cell:g} m.
"""


class Recorder:
    """Writes one MuJoCo simulation to a Rerun file.

    Under `world`: the geoms (not planes and height fields, which have no end), the surfaces that feel the sand coloured
    by traction, an arrow of the sand's force on each body, and the sand's surface, which follows the bodies in whole
    cells of its grid. Under `sand`: force [N], moment about the body's origin [N m] and depth of the deepest
    triangle [m] of each body, total power [W], and the scales of arrows and colours. Under `speed`: that of each root
    body [m/s]. All are those of the last mj_forward or mj_step of the data.

    The file appears at `close`, after it was read back and found complete. An exception inside the with-block closes
    the recording too: its frames show what went wrong. When a reset turns time back, the recording goes on one period
    after its last frame.

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
        self.path, self.frames = Path(path).resolve(), 0
        self._model, self._period, self._last, self._shift = model, 1.0 / fps, -math.inf, 0.0
        self._beds = instances(model)
        self._skins = [_make_skin(model, body, surface) for bed in self._beds for body, surface in bed.bodies.items()]
        self._centre, self._extent = _initial_bounds(model)
        self._cell = _round_number(self._extent / 3.0)
        self._scale = _first_scale(model, self._beds)
        self._file = _File(self.path, application_id)
        self._log_static()
        self._open_channels()

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
        if self._file.closed:
            raise RftsimError(f"the recorder of {self.path} is closed")
        time = data.time + self._shift
        if time < self._last:
            self._shift = self._last + self._period - data.time
            time = data.time + self._shift
        elif time - self._last < self._period * (1.0 - 1e-6):  # sums of time steps are not exact
            return False
        extra = {_scalar_entity(path): float(value) for path, value in (scalars or {}).items()}
        self._fill(data, self._file.pending)
        self._file.end_frame(time, extra)
        self._last = time
        self.frames += 1
        return True

    def close(self) -> None:
        """Finish the file, read it back and put it in place; does nothing a second time.

        Raises:
            RftsimError: Frames are missing from the file, as on a full disk; what was at the path is left as it was.
        """
        if not self._file.closed:
            follow = _entity("world", "body", _name(self._model, self._roots[0])) if self._roots else None
            self._file.close(_blueprint(self._centre, self._extent, follow, bool(self._felt), self._file.scalars))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        self.close()

    def _log_static(self) -> None:
        model, log = self._model, self._file.log_static
        about = ABOUT.format(extent=self._extent, scale=self._scale, cell=self._cell)
        log("/about", rr.TextDocument(about, media_type="text/markdown"))
        log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for bed in self._beds:
            log(_entity("world", "sand", bed.name), *_sand_shape(bed.sand, self._cell))
        for skin in self._skins:
            name = _name(model, skin.body)
            log(_entity("world", "body", name, "skin"), _mesh(skin.triangles))
            log(_entity("world", "force", name), rr.Arrows3D.from_fields(radii=0.01 * self._extent, colors=0x2878FFFF))
            for quantity in ("force", "moment"):
                log(_entity("sand", quantity, name), rr.SeriesLines(names=[f"{name} {axis}" for axis in "xyz"]))
        skinned, felt = {geom for skin in self._skins for geom in skin.geoms}, {skin.body for skin in self._skins}
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            mesh = None if geom in skinned else _geom_mesh(model, geom, opacity=0.3 if body in felt else 1.0)
            if mesh is not None:
                log(_entity("world", "body", _name(model, body), model.geom(geom).name or f"geom{geom}"), mesh)

    def _open_channels(self) -> None:
        """Room for a block of frames of all that changes, and what shows which part of it."""
        model, show, nfelt = self._model, self._file.show, len(self._skins)
        self._felt = [skin.body for skin in self._skins]
        self._roots = np.unique(model.body_rootid[self._felt or slice(1, None)]).tolist()
        self._position, self._quaternion = np.empty((BLOCK, model.nbody, 3)), np.empty((BLOCK, model.nbody, 4))
        self._speed, self._power, self._scales = (
            np.empty((BLOCK, len(self._roots))),
            np.empty(BLOCK),
            np.empty((BLOCK, 2)),
        )
        self._ground, self._depth = np.empty((BLOCK, len(self._beds), 3)), np.empty((BLOCK, nfelt))
        self._force, self._moment, self._arrows = np.empty((3, BLOCK, nfelt, 3))
        self._colours = [np.empty((BLOCK, len(skin.nearest), 3), dtype=np.uint32) for skin in self._skins]
        for i in range(1, model.nbody):
            pose = {"translation": self._position[:, i], "quaternion": self._quaternion[:, i]}
            show(_entity("world", "body", _name(model, i)), rr.Transform3D, **pose)
        for i, root in enumerate(self._roots):
            show(_entity("speed", _name(model, root)), rr.Scalars, scalars=self._speed[:, i])
        for i, bed in enumerate(self._beds):
            show(_entity("world", "sand", bed.name), rr.Transform3D, translation=self._ground[:, i])
        for i, body in enumerate(self._felt):
            name = _name(model, body)
            for quantity, values in ("force", self._force), ("moment", self._moment), ("depth", self._depth):
                show(_entity("sand", quantity, name), rr.Scalars, scalars=values[:, i])
            show(
                _entity("world", "force", name),
                rr.Arrows3D,
                origins=self._position[:, body],
                vectors=self._arrows[:, i],
            )
            show(_entity("world", "body", name, "skin"), rr.Mesh3D, vertex_colors=self._colours[i])
        if nfelt:
            show("/sand/power", rr.Scalars, scalars=self._power)
            show("/sand/scale/force", rr.Scalars, scalars=self._scales[:, 0])
            show("/sand/scale/traction", rr.Scalars, scalars=self._scales[:, 1])

    def _fill(self, data: mujoco.MjData, k: int) -> None:
        """Set frame k of the block."""
        self._position[k], self._quaternion[k] = data.xpos, data.xquat[:, [1, 2, 3, 0]]  # MuJoCo's wxyz to Rerun's xyzw
        self._speed[k] = [_speed(self._model, data, root) for root in self._roots]
        for i, bed in enumerate(self._beds):
            self._ground[k, i] = _snapped(data.xpos[list(bed.bodies)].mean(axis=0), bed.sand, self._cell)
        if not self._felt:
            return
        sand = wrenches(self._model, data)
        found = [tractions(self._model, data, body) for body in self._felt]
        magnitudes = [np.linalg.norm(one.stress, axis=1) for one in found]
        self._scale = _Scale(
            max(self._scale.force, np.linalg.norm(sand.force, axis=1).max()),
            max(self._scale.traction, *(one.max() for one in magnitudes)),
        )
        self._force[k], self._moment[k] = sand.force[self._felt], sand.moment[self._felt]
        self._arrows[k] = self._force[k] * (self._extent / self._scale.force)
        self._depth[k] = [one.depth.max() for one in found]
        self._power[k], self._scales[k] = sand.power.sum(), self._scale
        for skin, colours, one, magnitude in zip(self._skins, self._colours, found, magnitudes, strict=True):
            colours[k] = traction_colours(magnitude, one.active, self._scale.traction)[skin.nearest, None]


def traction_colours(magnitude: Array, active: NDArray[np.bool_], scale: float) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of tractions [Pa] up to scale, (ntri,); grey where they are not active, or not numbers."""
    shade = np.where(active & (magnitude <= scale), 1.0 + 254.0 / scale * magnitude, 0.0)
    return _PALETTE[shade.astype(np.intp)]


def _palette() -> NDArray[np.uint32]:
    """Inactive, then 255 shades."""
    places, at = np.linspace(0.0, 1.0, len(STOPS)), np.linspace(0.0, 1.0, 255)
    shades = np.stack([np.interp(at, places, channel) for channel in np.array(STOPS).T], axis=1)
    rgb = np.vstack([INACTIVE, shades.round()]).astype(np.uint32)
    palette: NDArray[np.uint32] = (rgb[:, 0] << 24) + (rgb[:, 1] << 16) + (rgb[:, 2] << 8) + np.uint32(255)
    return palette


_PALETTE: Final = _palette()


class _Scale(NamedTuple):
    force: float
    """Of an arrow as long as the bodies' extent [N]."""
    traction: float
    """Of the strongest colour [Pa]."""


def _first_scale(model: mujoco.MjModel, beds: Iterable[Instance]) -> _Scale:
    """The weight of all that can move, and that over the area that feels sand."""
    weight = float(model.body_mass[model.body_weldid != 0].sum() * np.linalg.norm(model.opt.gravity))
    area = sum(float(_columns(surface)[6].sum()) for bed in beds for surface in bed.bodies.values())
    return _Scale(max(weight, 1e-12), max(weight, 1e-12) / (area or 1.0))


class _Skin(NamedTuple):
    """The drawn triangles of a body that feels the sand."""

    body: int
    geoms: list[int]
    """The geoms that they stand for."""
    triangles: Array
    """Body frame [m], shape (nface, 3, 3)."""
    nearest: NDArray[np.intp]
    """The triangle of the packed surface whose traction each shows, shape (nface,)."""


def _make_skin(model: mujoco.MjModel, body: int, surface: Array) -> _Skin:
    """The packed surface has no corners, so they come from the geoms, each with the traction nearest to it."""
    own = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
    for collision_only in (True, False):
        drawn = body_surface(model, body, collision_only=collision_only, max_edge=None, allow_open=True)
        geoms = [geom for geom in own if is_colliding(model, geom) or not collision_only]
        if drawn and np.allclose(
            [drawn.triangles.min((0, 1)), drawn.triangles.max((0, 1))], surface[1:7].reshape(2, 3)
        ):
            break
    assert drawn is not None, "a body that feels sand has geoms"
    weights = np.array([1.0, 1.0, 1.0, *[drawn.size] * 3])  # normals too, so that thin plates keep their sides apart
    _, nearest = cKDTree(_columns(surface)[:6].T * weights).query(np.hstack([drawn.centres, drawn.normals]) * weights)
    return _Skin(body, geoms, drawn.triangles, nearest)


def _columns(surface: Array) -> Array:
    """Of a packed surface: centre (3), normal (3), area; shape (COLUMNS, ntri)."""
    return surface[packed.HEADER :].reshape(packed.COLUMNS, -1)


def _initial_bounds(model: mujoco.MjModel) -> tuple[Array, float]:
    """Centre and longest side of a box around the geoms that can move, or all if none can [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = (model.body_weldid[model.geom_bodyid] != 0) & (model.geom_rbound > 0.0)
    if not geoms.any():
        return model.stat.center.copy(), float(model.stat.extent)
    radii = model.geom_rbound[geoms, None]
    low, high = (data.geom_xpos[geoms] - radii).min(axis=0), (data.geom_xpos[geoms] + radii).max(axis=0)
    return 0.5 * (low + high), float((high - low).max())


def _speed(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """Of the body's origin [m/s]."""
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
    return float(np.linalg.norm(velocity[3:]))


def _axes(sand: Array) -> tuple[Array, Array, Array]:
    """Of a packed sand: along its surface, across, and up."""
    up = sand[3:6]
    along = np.array([up[2], 0.0, -up[0]]) / math.hypot(up[2], up[0])
    return along, np.cross(up, along), up


def _snapped(place: Array, sand: Array, cell: float) -> Array:
    """The corner of the sand's grid nearest to a place."""
    along, across, up = _axes(sand)
    snapped: Array = sand[6] * up + cell * (
        np.rint(place @ along / cell) * along + np.rint(place @ across / cell) * across
    )
    return snapped


def _round_number(x: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed x."""
    power = 10.0 ** math.floor(math.log10(x))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= x)


def _sand_shape(sand: Array, cell: float) -> tuple[rr.Mesh3D, rr.LineStrips3D]:
    """A translucent square about the origin, and the grid on it."""
    along, across, _ = _axes(sand)
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


def _name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"body{body}"


def _entity(*parts: str) -> str:
    return rr.new_entity_path(list(parts))


def _scalar_entity(path: str) -> str:
    parts = path.strip("/").split("/")
    if parts[0] in OWN_PATHS or not all(parts):
        raise RftsimError(
            f"a scalar's path is a group and a name, the group not of {', '.join(OWN_PATHS)}; not {path!r}"
        )
    return _entity(*parts)


def _blueprint(
    centre: Array, extent: float, follow: str | None, with_sand: bool, scalars: Iterable[str]
) -> rrb.Blueprint:
    """The bodies on the left; plots of the sand and of each group of scalars on the right."""
    eye = rrb.EyeControls3D(
        position=centre + extent * np.array([0.8, -1.6, 0.8]), look_target=centre, tracking_entity=follow
    )
    view = rrb.Spatial3DView(origin="/world", name="Simulation", eye_controls=eye, line_grid=False)
    about = rrb.TextDocumentView(origin="/about", name="Scales")
    plots = {"/sand/force": "Force [N]", "/sand/power": "Power [W]", "/sand/depth": "Depth [m]"} if with_sand else {}
    plots |= {"/speed": "Speed [m/s]"}
    plots |= {f"/{group}": group for group in dict.fromkeys(entity.split("/")[1] for entity in scalars)}
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(view, about, row_shares=[6, 1]),
            rrb.Vertical(*(rrb.TimeSeriesView(origin=origin, name=name) for origin, name in plots.items())),
            column_shares=[2, 1],
        ),
        rrb.TimePanel(timeline="sim_time", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


class _Channel(NamedTuple):
    """What one entity shows, frame by frame."""

    entity: str
    archetype: Any
    fields: dict[str, NDArray[Any]]
    """Arrays of a block's frames, (BLOCK, ...)."""


class _File:
    """A Rerun file that is written in blocks of frames and appears once it is complete."""

    def __init__(self, path: Path, application_id: str) -> None:
        self.pending, self.closed = 0, False
        self.scalars: dict[str, list[tuple[float, float]]] = {}
        """Time [s] and value of each, since the last block."""
        self._path, self._temporary = path, _reserved(path)
        self._time, self._channels, self._rows = np.empty(BLOCK), list[_Channel](), Counter[str]()
        self._stream = rr.RecordingStream(application_id, recording_id=uuid.uuid4())
        self._stream.save(self._temporary)
        self._stream.send_recording_name(path.stem)

    def log_static(self, entity: str, *shown: rr.AsComponents) -> None:
        self._stream.log(entity, *shown, static=True)
        self._rows[entity] += 1

    def show(self, entity: str, archetype: Any, **fields: NDArray[Any]) -> None:
        """Let an entity show arrays, (BLOCK, ...), of which the caller fills row `pending` before `end_frame`."""
        self._channels.append(_Channel(entity, archetype, fields))

    def end_frame(self, time: float, scalars: Mapping[str, float]) -> None:
        for entity, value in scalars.items():
            self.scalars.setdefault(entity, []).append((time, value))
        self._time[self.pending] = time
        self.pending += 1
        if self.pending == BLOCK:
            self._send_block()

    def close(self, blueprint: rrb.Blueprint) -> None:
        self.closed = True
        try:
            self._send_block()
            self._stream.send_blueprint(blueprint)
            self._stream.disconnect()
            _check_rows(self._temporary, self._rows, self._path)
            os.replace(self._temporary, self._path)
        finally:
            self._temporary.unlink(missing_ok=True)

    def _send_block(self) -> None:
        n, self.pending = self.pending, 0
        if not n:
            return
        for channel in self._channels:
            fields = {field: values[:n] for field, values in channel.fields.items()}
            self._send(channel.entity, self._time[:n], channel.archetype.columns(**fields))
        for entity, pairs in self.scalars.items():
            if pairs:
                time, values = np.array(pairs).T
                self._send(entity, time, rr.Scalars.columns(scalars=values))
                pairs.clear()

    def _send(self, entity: str, time: Array, columns: Any) -> None:
        self._stream.send_columns(entity, [rr.TimeColumn("sim_time", duration=time)], columns)
        self._rows[entity] += len(time)


def _reserved(path: Path) -> Path:
    """An empty file beside the path, which shows that it can be written."""
    if path.suffix != ".rrd":
        raise RftsimError(f"a recording must be called *.rrd, by which Rerun knows it, not {path.name!r}")
    temporary = path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}.rrd")
    try:
        if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
            raise RftsimError(f"cannot write {path}: it exists and is not a file that may be replaced")
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise RftsimError(f"cannot write {path}: {error.strerror}") from error
    return temporary


def _check_rows(written: Path, sent: Mapping[str, int], path: Path) -> None:
    """Read a finished file back and see that each entity has all its rows."""
    found: Counter[str] = Counter()
    try:
        for chunk in RrdReader(written).stream():
            found[chunk.entity_path] += chunk.num_rows
    except (OSError, ValueError, RuntimeError) as error:
        raise RftsimError(f"the recording {path} cannot be read back; is the disk full? {error}") from error
    missing = {entity: rows - found[entity] for entity, rows in sent.items() if found[entity] < rows}
    if missing:
        raise RftsimError(
            f"the recording {path} lacks {sum(missing.values())} of {sum(sent.values())} rows, among them of "
            f"{next(iter(missing))}; is the disk full?"
        )
