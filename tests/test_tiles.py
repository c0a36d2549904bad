"""The ground in recordings: on the surface at every time, and recorded again only where it has changed."""

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim.view import frames, record, tile_shapes
from rftsim.view.tiles import CELLS, Tiles

rerun_chunk = pytest.importorskip("rerun.chunk")

BALL = '<mujoco><worldbody><body name="ball" pos="0 0 .1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
SPACING = 0.02


class Pressed:
    """Waves of 1 cm, with a print 2 cm deep at the origin once it is deep."""

    spacing = SPACING, SPACING

    def __init__(self):
        self.deep = 0.0

    def undisturbed_at(self, x, y):
        return 0.01 * np.sin(5.0 * x) * np.cos(4.0 * y)

    def height_at(self, x, y):
        return self.undisturbed_at(x, y) - self.deep * np.exp(-(x**2 + y**2) / 0.05**2)


def rows(path):
    """The rows of each tile in a recording: times [s], vertices (n, 3) and colours (n, 4), by entity."""
    found = {}
    for chunk in rerun_chunk.RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path.startswith("/world/sand/sand/") and "Mesh3D:vertex_positions" in batch.schema.names:
            columns = [batch.column("sim_time").cast("int64")]
            columns += [batch.column(f"Mesh3D:{name}") for name in ("vertex_positions", "vertex_colors")]
            time, vertices, colours = (np.array(column.to_pylist()) for column in columns)
            rgba = colours[..., None] >> np.array([24, 16, 8, 0]) & 255
            found[chunk.entity_path] = [*zip(1e-9 * time, vertices, rgba, strict=True)]
    return found


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """A recording of 1 s in which a print is pressed at 0.45 s; the surface, and the rows of each tile."""
    surface, path = Pressed(), tmp_path / "x.rrd"
    monkeypatch.setattr(frames, "ground", lambda model, data, bed: surface)
    model = rftsim.load(BALL)
    data = mujoco.MjData(model)
    with record.Recorder(model, path) as recorder:
        for k in range(51):
            data.time, surface.deep = 0.02 * k, 0.02 * (k > 22)
            mujoco.mj_kinematics(model, data)
            recorder.log(data)
    return surface, rows(path)


def test_every_vertex_lies_on_the_ground_of_its_time(recorded):
    surface, found = recorded
    for own in found.values():
        for time, vertices, _ in own:
            surface.deep = 0.02 * (time > 0.45)
            assert vertices[:, 2] == pytest.approx(surface.height_at(vertices[:, 0], vertices[:, 1]), abs=1e-6)


def test_only_what_has_changed_is_recorded_again(recorded):
    """The four tiles about the print, once, at the next look after it was pressed; the others at the start."""
    _, found = recorded
    times = {entity: [round(time, 6) for time, *_ in own] for entity, own in found.items()}
    again = {entity.rsplit("/", 1)[1] for entity, own in times.items() if len(own) > 1}
    assert again == {"0_0", "-1_0", "0_-1", "-1_-1"}
    assert {tuple(own) for own in times.values()} == {(0.0,), (0.0, 0.5)}
    assert len(found) >= 16


def test_the_print_is_dark_and_the_rest_has_the_colour_of_sand(recorded):
    _, found = recorded
    _, vertices, colours = found["/world/sand/sand/0_0"][-1]
    distance = np.linalg.norm(vertices[:, :2], axis=1)
    assert (colours[distance > 0.2] == [*tile_shapes.SHADES[1], 255]).all()
    assert (colours[distance < 0.01] == [*tile_shapes.SHADES[0], 255]).all()


def test_tiles_cover_the_ground_around_bodies_without_gaps():
    tiles = Tiles(0.1, 1.0)
    tiles.note(np.array([[3.0, -2.0], [3.5, -2.0]]), Pressed(), 0.0)
    corners = tiles.cell * CELLS * np.array(sorted(tiles.kept))
    width = tiles.cell * CELLS
    assert (corners.min(axis=0) <= [0.0, -5.0]).all()
    assert (corners.max(axis=0) + width >= [6.5, 1.0]).all()
    assert len(tiles.kept) == np.prod(np.rint((np.ptp(corners, axis=0)) / width) + 1)
