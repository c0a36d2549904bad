"""A run as a Rerun recording: the bodies, what the sand does to them, and any scalars, over simulated time."""

import math
import os
import types
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
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
from rftsim.scene import SAND_RGBA
from rftsim.surface import Array

BLOCK: Final = 64
"""Frames that are gathered before they are written together."""
OWN_PATHS: Final = ("world", "sand", "speed", "about")
"""First elements of the paths that the recorder itself writes."""
INACTIVE: Final = (150, 150, 150)
STOPS: Final = ((255, 255, 178), (254, 204, 92), (253, 141, 60), (240, 59, 32), (189, 0, 38))
"""Traction from none to the strongest, evenly spaced, ever darker: ColorBrewer's YlOrRd."""
GRID_CELLS: Final = 16
"""Along each side of the drawn sand."""
_TINY: Final = 1e-12


class Recorder:
    """Writes one MuJoCo simulation to a Rerun file.

    Under `world`: the geoms (not planes and height fields, which have no end), the surfaces that feel the sand coloured
    by traction, per body an arrow of the sand's force and a thin one of its moment, and the sand's surface, which
    follows the bodies in whole cells of its grid. Under `sand`: force [N], moment about the body's origin [N m] and
    depth of the deepest triangle [m] of each body, total power [W], and the scales of arrows and colours. Under
    `speed`: that of each root body [m/s]. All are those of the last mj_forward or mj_step of the data.

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
        self._arrow, self._cell = model.stat.extent / 3.0, _round_number(model.stat.extent / 3.0)
        self._force_scale, self._traction_scale = _first_scales(model, self._beds)
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
            self._file.close(_blueprint(self._model, bool(self._skins), self._file.scalars))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        self.close()

    def _log_static(self) -> None:
        model, log = self._model, self._file.log_static
        log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        log("/about", rr.TextDocument(self._about(), media_type="text/markdown"))
        skinned = {geom for skin in self._skins for geom in skin.geoms}
        felt = {skin.body for skin in self._skins}
        for geom in set(range(model.ngeom)) - skinned:
            body = int(model.geom_bodyid[geom])
            mesh = _geom_mesh(model, geom, see_through=body in felt)
            if mesh is not None:
                log(_body_entity(model, body) + _entity(model.geom(geom).name or f"geom{geom}"), mesh)
        for bed in self._beds:
            log(_entity("world", "sand", bed.name), *_ground_shape(bed.sand, self._cell))
        components = rr.SeriesLines(names=["x", "y", "z"], colors=[(230, 80, 80), (90, 190, 90), (90, 140, 250)])
        for skin in self._skins:
            name = _name(model, skin.body)
            log(_body_entity(model, skin.body) + "/skin", _mesh(skin.triangles))
            log(_entity("sand", "force", name), components)
            log(_entity("sand", "moment", name), components)
            thick, thin = 0.05 * self._arrow, 0.02 * self._arrow
            log(_entity("world", "force", name), rr.Arrows3D.from_fields(radii=thick, colors=(40, 120, 255)))
            log(_entity("world", "moment", name), rr.Arrows3D.from_fields(radii=thin, colors=(190, 90, 230)))

    def _about(self) -> str:
        return (
            f"**Arrows**: the sand's force, {self._arrow:.3g} m long for the largest so far (plot `sand/scale/force`; at "
            f"first the weight, {self._force_scale:.3g} N); thin, its moment over that force, in metres as drawn. "
            f"**Colours**: traction, from pale to dark red for the largest so far (`sand/scale/traction`; at first the "
            f"weight over the area, {self._traction_scale:.3g} Pa); grey where the sand does not act. "
            f"**Grid**: {self._cell:g} m."
        )

    def _open_channels(self) -> None:
        """Room for a block of frames of all that changes, and which entity shows which part."""
        model, show, nfelt = self._model, self._file.show, len(self._skins)
        self._felt = [skin.body for skin in self._skins]
        self._roots = np.unique(model.body_rootid[self._felt or slice(1, None)]).tolist()
        self._pose = np.empty((BLOCK, model.nbody, 7))
        self._speed = np.empty((BLOCK, len(self._roots)))
        self._ground = np.empty((BLOCK, len(self._beds), 3))
        self._force, self._moment = np.empty((2, BLOCK, nfelt, 3))
        self._force_arrow, self._moment_arrow = np.empty((2, BLOCK, nfelt, 2, 3))
        self._depth, self._power, self._scales = np.empty((BLOCK, nfelt)), np.empty(BLOCK), np.empty((BLOCK, 2))
        self._colours = [np.empty((BLOCK, len(skin.nearest), 3), dtype=np.uint32) for skin in self._skins]
        for body in range(1, model.nbody):
            show(_body_entity(model, body), self._pose[:, body], _pose_columns)
        for i, root in enumerate(self._roots):
            show(_entity("speed", _name(model, root)), self._speed[:, i], _scalar_columns)
        for i, bed in enumerate(self._beds):
            show(_entity("world", "sand", bed.name), self._ground[:, i], _place_columns)
        for i, body in enumerate(self._felt):
            name = _name(model, body)
            show(_entity("sand", "force", name), self._force[:, i], _scalar_columns)
            show(_entity("sand", "moment", name), self._moment[:, i], _scalar_columns)
            show(_entity("sand", "depth", name), self._depth[:, i], _scalar_columns)
            show(_entity("world", "force", name), self._force_arrow[:, i], _arrow_columns)
            show(_entity("world", "moment", name), self._moment_arrow[:, i], _arrow_columns)
            show(_body_entity(model, body) + "/skin", self._colours[i], _colour_columns)
        if nfelt:
            show("/sand/power", self._power, _scalar_columns)
            show("/sand/scale/force", self._scales[:, 0], _scalar_columns)
            show("/sand/scale/traction", self._scales[:, 1], _scalar_columns)

    def _fill(self, data: mujoco.MjData, k: int) -> None:
        """Set frame k of the block."""
        self._pose[k, :, :3], self._pose[k, :, 3:] = data.xpos, data.xquat
        self._speed[k] = [_speed(self._model, data, root) for root in self._roots]
        for i, bed in enumerate(self._beds):
            self._ground[k, i] = _snapped(data.xpos[list(bed.bodies)].mean(axis=0), bed.sand, self._cell)
        if not self._felt:
            return
        sand = wrenches(self._model, data)
        found = [tractions(self._model, data, body) for body in self._felt]
        magnitudes = [np.linalg.norm(one.stress, axis=1) for one in found]
        self._force_scale = max(self._force_scale, float(np.linalg.norm(sand.force, axis=1).max()))
        self._traction_scale = max(self._traction_scale, *(float(one.max()) for one in magnitudes))
        self._force[k], self._moment[k] = sand.force[self._felt], sand.moment[self._felt]
        self._force_arrow[k, :, 0] = self._moment_arrow[k, :, 0] = data.xpos[self._felt]
        self._force_arrow[k, :, 1] = self._force[k] * (self._arrow / self._force_scale)
        self._moment_arrow[k, :, 1] = self._moment[k] / self._force_scale
        self._depth[k] = [one.depth.max() for one in found]
        self._power[k] = sand.power.sum()
        self._scales[k] = self._force_scale, self._traction_scale
        for skin, colours, one, magnitude in zip(self._skins, self._colours, found, magnitudes, strict=True):
            colours[k] = traction_colours(magnitude, one.active, self._traction_scale)[skin.nearest, None]


def traction_colours(magnitude: Array, active: NDArray[np.bool_], scale: float) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of tractions [Pa] up to scale; grey where they are not active, or not numbers."""
    shade = np.where(active & (magnitude <= scale), 1.0 + 254.0 / scale * magnitude, 0.0)
    return _PALETTE[shade.astype(np.intp)]


def _palette() -> NDArray[np.uint32]:
    places, at = np.linspace(0.0, 1.0, len(STOPS)), np.linspace(0.0, 1.0, 255)
    shades = np.stack([np.interp(at, places, channel) for channel in np.array(STOPS).T], axis=1)
    rgb = np.vstack([INACTIVE, shades.round()]).astype(np.uint32)
    return (rgb @ np.array([1 << 24, 1 << 16, 1 << 8], dtype=np.uint32) + np.uint32(255)).astype(np.uint32)


_PALETTE: Final = _palette()


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
        if drawn is not None and np.allclose(
            [*drawn.triangles.min((0, 1)), *drawn.triangles.max((0, 1))], surface[1:7]
        ):
            break
    assert drawn is not None, "a body that feels sand has geoms"
    columns = surface[packed.HEADER :].reshape(packed.COLUMNS, -1)
    weights = np.array([1.0, 1.0, 1.0, *[drawn.size] * 3])  # so that thin plates keep their two sides apart
    tree = cKDTree(columns[:6].T * weights)
    _, nearest = tree.query(np.hstack([drawn.centres, drawn.normals]) * weights)
    return _Skin(body, geoms, drawn.triangles, nearest)


def _first_scales(model: mujoco.MjModel, beds: Iterable[Instance]) -> tuple[float, float]:
    """Weight of all that can move [N], and that weight over the area that feels sand [Pa]."""
    weight = float(model.body_mass[model.body_weldid != 0].sum() * np.linalg.norm(model.opt.gravity))
    columns = [one[packed.HEADER :].reshape(packed.COLUMNS, -1) for bed in beds for one in bed.bodies.values()]
    area = float(sum(one[6].sum() for one in columns))
    return max(weight, _TINY), max(weight / max(area, _TINY), _TINY)


def _speed(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """Of the body's origin [m/s]."""
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
    return float(np.linalg.norm(velocity[3:]))


def _plane_axes(sand: Array) -> tuple[Array, Array, Array]:
    """Of a packed sand: along its surface, across, and up."""
    up = sand[3:6]
    along = np.array([up[2], 0.0, -up[0]])
    along /= np.linalg.norm(along)
    return along, np.cross(up, along), up


def _snapped(place: Array, sand: Array, cell: float) -> Array:
    """The corner of the sand's grid nearest to a place."""
    along, across, up = _plane_axes(sand)
    i, j = round(float(place @ along) / cell), round(float(place @ across) / cell)
    return np.asarray(sand[6] * up + cell * (i * along + j * across))


def _round_number(x: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed x."""
    power = 10.0 ** math.floor(math.log10(x))
    return max(one * power for one in (1.0, 2.0, 5.0) if one * power <= x)


def _ground_shape(sand: Array, cell: float) -> tuple[rr.Mesh3D, rr.LineStrips3D]:
    along, across, _ = _plane_axes(sand)
    half = GRID_CELLS // 2 * cell
    corners = [half * (i * along + j * across) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    at = np.linspace(-half, half, GRID_CELLS + 1)
    lines = [
        [x * one - half * other, x * one + half * other]
        for one, other in ((along, across), (across, along))
        for x in at
    ]
    return (
        rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 1, 2], [0, 2, 3]], albedo_factor=SAND_RGBA),
        rr.LineStrips3D(lines, colors=[(*SAND_RGBA[:3], 0.8)], radii=rr.Radius.ui_points(0.5)),
    )


def _geom_mesh(model: mujoco.MjModel, geom: int, see_through: bool) -> rr.Mesh3D | None:
    """The geom in its body's frame; None where it is invisible or endless."""
    rgba = _geom_rgba(model, geom)
    try:
        vertices, faces = geom_triangles(model, geom)
    except SceneError:
        return None
    if rgba[3] == 0.0:
        return None
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    placed = vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom]
    return _mesh(placed[faces], rgba * [1.0, 1.0, 1.0, 0.3 if see_through else 1.0])


def _geom_rgba(model: mujoco.MjModel, geom: int) -> Array:
    """As MuJoCo draws it: its own colour where it is not the default, else its material's."""
    rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
    if material >= 0 and (rgba == (0.5, 0.5, 0.5, 1.0)).all():
        rgba = model.mat_rgba[material]
    return rgba.astype(float)


def _mesh(triangles: Array, rgba: Array | None = None) -> rr.Mesh3D:
    """Flat-shaded triangles, (n, 3, 3), that share no corners, so that each face can have its colour."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), _TINY**2)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3), vertex_normals=np.repeat(normals, 3, axis=0), albedo_factor=rgba
    )


def _entity(*parts: str) -> str:
    return rr.new_entity_path(list(parts))


def _name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"body{body}"


def _body_entity(model: mujoco.MjModel, body: int) -> str:
    return _entity("world", "body", _name(model, body))


def _scalar_entity(path: str) -> str:
    parts = path.strip("/").split("/")
    if parts[0] in OWN_PATHS or not all(parts):
        raise RftsimError(f"a scalar's path cannot be {path!r}: give a group and a name, not of {', '.join(OWN_PATHS)}")
    return _entity(*parts)


def _scalar_columns(values: NDArray[Any]) -> Iterable[Any]:
    return rr.Scalars.columns(scalars=values)


def _pose_columns(values: NDArray[Any]) -> Iterable[Any]:
    """MuJoCo's quaternions are wxyz, Rerun's xyzw."""
    return rr.Transform3D.columns(translation=values[:, :3], quaternion=values[:, [4, 5, 6, 3]])


def _place_columns(values: NDArray[Any]) -> Iterable[Any]:
    return rr.Transform3D.columns(translation=values)


def _arrow_columns(values: NDArray[Any]) -> Iterable[Any]:
    return rr.Arrows3D.columns(origins=values[:, 0], vectors=values[:, 1])


def _colour_columns(values: NDArray[Any]) -> Iterable[Any]:
    frames, corners = len(values), values[0].size
    return rr.Mesh3D.columns(vertex_colors=values.ravel()).partition([corners] * frames)


def _blueprint(model: mujoco.MjModel, with_sand: bool, scalars: Iterable[str]) -> rrb.Blueprint:
    """The bodies on the left, plots of the sand and of each group of scalars on the right."""
    extent, centre = model.stat.extent, model.stat.center
    eye = rrb.EyeControls3D(position=centre + extent * np.array([0.8, -1.6, 0.8]), look_target=centre)
    plots = {"/speed": "Speed [m/s]"}
    if with_sand:
        names = {"force": "Force of the sand [N]", "power": "Power of the sand [W]", "depth": "Deepest triangle [m]"}
        plots = {f"/sand/{one}": name for one, name in names.items()} | plots
    plots |= {f"/{one}": one for one in dict.fromkeys(path.split("/")[1] for path in scalars)}
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(origin="/world", name="Simulation", eye_controls=eye, line_grid=False),
                rrb.TextDocumentView(origin="/about", name="Scales"),
                row_shares=[6, 1],
            ),
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
    values: NDArray[Any]
    """Shape (BLOCK, ...)."""
    columns: Callable[[NDArray[Any]], Iterable[Any]]
    """Rerun's columns of some of the values."""


class _File:
    """A Rerun file that is written in blocks of frames and appears once it is complete."""

    def __init__(self, path: Path, application_id: str) -> None:
        self.pending, self.closed = 0, False
        self.scalars: dict[str, list[tuple[float, float]]] = {}
        """Time [s] and value of each, since the last block."""
        self._path, self._temporary = path, _reserved(path)
        self._time, self._channels = np.empty(BLOCK), list[_Channel]()
        self._rows: Counter[str] = Counter()
        self._stream = rr.RecordingStream(application_id, recording_id=uuid.uuid4())
        self._stream.save(self._temporary)
        self._stream.send_recording_name(path.stem)

    def log_static(self, entity: str, *shown: Any) -> None:
        self._stream.log(entity, *shown, static=True)
        self._rows[entity] += 1

    def show(self, entity: str, values: NDArray[Any], columns: Callable[[NDArray[Any]], Iterable[Any]]) -> None:
        """Let an entity show an array of a block's frames, (BLOCK, ...), which the caller fills at `pending`."""
        self._channels.append(_Channel(entity, values, columns))

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
        if self.pending:
            for channel in self._channels:
                self._send(channel.entity, self._time[: self.pending], channel.columns(channel.values[: self.pending]))
        for entity, pairs in self.scalars.items():
            if pairs:
                time, values = np.array(pairs).T
                self._send(entity, time, _scalar_columns(values))
                pairs.clear()
        self.pending = 0

    def _send(self, entity: str, time: Array, columns: Iterable[Any]) -> None:
        self._stream.send_columns(entity, [rr.TimeColumn("sim_time", duration=time)], columns)
        self._rows[entity] += len(time)


def _reserved(path: Path) -> Path:
    """An empty file beside the path, which shows that it can be written."""
    if path.suffix != ".rrd":
        raise RftsimError(f"a recording is called *.rrd, by which Rerun knows it, not {path.name!r}")
    temporary = path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}.rrd")
    try:
        if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
            raise RftsimError(f"cannot write {path}: it exists and is no file that may be replaced")
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
        raise RftsimError(f"the recording for {path} cannot be read back, is the disk full? {error}") from error
    missing = {entity: rows - found[entity] for entity, rows in sent.items() if found[entity] < rows}
    if missing:
        raise RftsimError(
            f"the recording for {path} lacks {sum(missing.values())} of {sum(sent.values())} rows, in {len(missing)} "
            f"entities, first in {next(iter(missing))}: is the disk full?"
        )
