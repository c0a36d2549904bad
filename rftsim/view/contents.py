"""The contents of a recording: what stays, what changes from frame to frame, and how the viewer arranges both."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rftsim.errors import RftsimError
from rftsim.surface.triangles import Array
from rftsim.view.colours import traction_colours
from rftsim.view.frames import Frame, Portrait
from rftsim.view.shapes import geom_mesh, sand_shapes, snapped, triangle_mesh
from rftsim.view.tile_shapes import ground_scale, tile_rows
from rftsim.view.tiles import Place, tile_triangles

OWN_PATHS: Final = ("world", "sand", "speed", "about")
"""First elements of the paths that the recorder itself writes."""
_CHUNK: Final = 64
"""Frames per chunk of the file."""

Channel = tuple[str, Any, dict[str, NDArray[Any]]]
"""An entity, its Rerun archetype, and the archetype's fields in all frames, (nframe, ...)."""


def send(
    stream: rr.RecordingStream,
    portrait: Portrait,
    frames: list[Frame],
    scalars: Mapping[str, list[tuple[float, float]]],
) -> Counter[str]:
    """Send all frames, and the caller's scalars as pairs of time [s] and value; returns each entity's rows."""
    rows: Counter[str] = Counter()
    together = Frame(*map(np.array, zip(*frames, strict=True))) if frames else None
    scales = _scales(portrait, together)
    for entity, shape in _fixed(portrait, *scales):
        stream.log(entity, shape, static=True)
        rows[entity] += 1
    if together is not None:
        for channel in _changing(portrait, together, *scales):
            rows[channel[0]] += _send_channel(stream, together.time, channel)
    for time, channel in _ground(portrait):
        rows[channel[0]] += _send_channel(stream, time, channel)
    for entity, pairs in scalars.items():
        time, values = np.array(pairs).T
        rows[entity] += _send_channel(stream, time, (entity, rr.Scalars, {"scalars": values}))
    return rows


def _send_channel(stream: rr.RecordingStream, time: Array, channel: Channel) -> int:
    """Send one entity's fields at all times in chunks; returns how many rows these are."""
    entity, archetype, fields = channel
    for start in range(0, len(time), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        columns = archetype.columns(**{field: values[chunk] for field, values in fields.items()})
        stream.send_columns(entity, [rr.TimeColumn("sim_time", duration=time[chunk])], columns)
    return len(time)


def _scales(portrait: Portrait, frames: Frame | None) -> tuple[float, float]:
    """Force [N] of an arrow as long as the extent and traction [Pa] of the strongest colour."""
    force = max(portrait.weight, 1e-12)
    traction = force / (sum(skin.area for skin in portrait.skins) or 1.0)
    if frames is None:
        return force, traction
    return _strong(np.linalg.norm(frames.force, axis=2), force), _strong(frames.traction, traction)


def _strong(values: NDArray[np.floating[Any]], least: float) -> float:
    """The value that 99 % of the positive ones do not exceed, so that no spike dwarfs the rest; not below `least`."""
    positive = values[(values > 0.0) & np.isfinite(values)]
    return max(least, float(np.percentile(positive, 99.0))) if positive.size else least


def _changing(portrait: Portrait, frames: Frame, force_scale: float, traction_scale: float) -> Iterator[Channel]:
    """The channels that change from frame to frame: each body's and the sand's."""
    for body in range(1, portrait.model.nbody):
        pose = {"translation": frames.position[:, body], "quaternion": frames.quaternion[:, body]}
        yield _entity("world", "body", portrait.name(body)), rr.Transform3D, pose
    for root, speed in zip(portrait.roots, frames.speed.T, strict=True):
        yield _entity("speed", portrait.name(root)), rr.Scalars, {"scalars": speed}
    for bed, plane, tiles in portrait.beds:
        if tiles is not None:
            continue
        middle = frames.position[:, list(bed.bodies)].mean(axis=1)
        yield _entity("world", "sand", bed.name), rr.Transform3D, {"translation": snapped(middle, plane, portrait.cell)}
    if portrait.skins:
        yield "/sand/power", rr.Scalars, {"scalars": frames.power}
    ends = np.cumsum([len(skin.nearest) for skin in portrait.skins])
    for i, skin in enumerate(portrait.skins):
        name, traction = portrait.name(skin.body), frames.traction[:, ends[i] - len(skin.nearest) : ends[i]]
        for quantity, values in ("force", frames.force), ("moment", frames.moment), ("depth", frames.depth):
            yield _entity("sand", quantity, name), rr.Scalars, {"scalars": values[:, i]}
        arrow = {
            "origins": frames.start[:, i],
            "vectors": frames.force[:, i] * (portrait.extent / force_scale),
        }
        yield _entity("world", "force", name), rr.Arrows3D, arrow
        colours = np.repeat(traction_colours(traction, traction_scale), 3, axis=1)  # one for each corner
        yield _entity("world", "body", name, "skin"), rr.Mesh3D, {"vertex_colors": colours}


def _ground(portrait: Portrait) -> Iterator[tuple[Array, Channel]]:
    """The tiles of ground, each with the times at which it changed."""
    for bed, _, tiles in portrait.beds:
        if tiles is not None:
            for place, time, fields in tile_rows(tiles, ground_scale(tiles)):
                yield time, (_tile(bed.name, place), rr.Mesh3D, fields)


def _fixed(portrait: Portrait, force_scale: float, traction_scale: float) -> Iterator[tuple[str, rr.AsComponents]]:
    """The entities that stay as they are, each with its shape, text or style."""
    about = (
        f"**Arrows**, from the surface above where it acts: the sand's force, {portrait.extent:.3g} m long for "
        f"{force_scale:.3g} N. **Colours**: traction, darkest from {traction_scale:.3g} Pa on; grey where sand does "
        f"not act. {_about_ground(portrait)}"
    )
    yield "/about", rr.TextDocument(about, media_type="text/markdown")
    yield "/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    for bed, plane, tiles in portrait.beds:
        if tiles is None:
            for shape in sand_shapes(plane, portrait.cell):
                yield _entity("world", "sand", bed.name), shape
        else:
            for place in tiles.kept:
                yield _tile(bed.name, place), rr.Mesh3D.from_fields(triangle_indices=tile_triangles())
    for skin in portrait.skins:
        name = portrait.name(skin.body)
        yield _entity("world", "body", name, "skin"), triangle_mesh(skin.triangles)
        yield _entity("world", "force", name), rr.Arrows3D.from_fields(radii=0.01 * portrait.extent, colors=0x2878FFFF)
        for quantity in ("force", "moment"):
            yield _entity("sand", quantity, name), rr.SeriesLines(names=[f"{name} {axis}" for axis in "xyz"])
    skinned = [geom for skin in portrait.skins for geom in skin.geoms]
    for geom in np.setdiff1d(range(portrait.model.ngeom), skinned).tolist():
        body = int(portrait.model.geom_bodyid[geom])
        mesh = geom_mesh(portrait.model, geom, opacity=0.3 if body in portrait.felt else 1.0)  # not to hide the skin
        if mesh is not None:
            name = portrait.model.geom(geom).name or f"geom{geom}"
            yield _entity("world", "body", portrait.name(body), name), mesh


def blueprint(portrait: Portrait, scalars: Iterable[str]) -> rrb.Blueprint:
    """Arrange the viewer: the bodies on the left, plots of the sand and of each group of scalars on the right."""
    eye = rrb.EyeControls3D(
        position=portrait.centre + portrait.extent * np.array([0.8, -1.6, 0.8]),
        look_target=portrait.centre,
        tracking_entity=_entity("world", "body", portrait.name(portrait.roots[0])) if portrait.roots else None,
    )
    view = rrb.Spatial3DView(origin="/world", name="Simulation", eye_controls=eye, line_grid=False)
    about = rrb.TextDocumentView(origin="/about", name="Scales")
    plots = (
        {"/sand/force": "Force [N]", "/sand/power": "Power [W]", "/sand/depth": "Depth [m]"} if portrait.skins else {}
    )
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


def _about_ground(portrait: Portrait) -> str:
    """What the drawn ground means."""
    marks = max((ground_scale(bed.tiles) for bed in portrait.beds if bed.tiles is not None), default=None)
    if marks is None:
        return f"**Grid**: {portrait.cell:g} m."
    if marks == 0.0:
        return "**Ground**: undisturbed."
    return f"**Ground**: darkest {1000.0 * marks:.2g} mm below the undisturbed, lightest as much above."


def scalar_entity(path: str) -> str:
    """The entity of a caller's scalar, from its path.

    Raises:
        RftsimError: The path is no group and name, or its group is one of the recorder's own.
    """
    parts = path.strip("/").split("/")
    if parts[0] in OWN_PATHS or not all(parts):
        raise RftsimError(
            f"a scalar's path is a group and a name, the group not of {', '.join(OWN_PATHS)}; not {path!r}"
        )
    return _entity(*parts)


def _tile(bed: str, place: Place) -> str:
    return _entity("world", "sand", bed, "{}_{}".format(*place))


def _entity(*parts: str) -> str:
    return rr.new_entity_path(list(parts))
