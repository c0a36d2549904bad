"""What is recorded is what was simulated, and a file is there whole or not at all."""

import resource

import mujoco
import numpy as np
import pytest
from scipy.spatial import cKDTree

import rftsim
from rftsim.view import record, recording_file
from rftsim.view.colours import traction_colours

rerun_chunk = pytest.importorskip("rerun.chunk")

DROP = """
<mujoco><option timestep="0.001"/><worldbody>
  <body name="ball" pos="0 0 .11"><freejoint/><geom type="sphere" size=".1" mass="4"/></body>
  <body name="front box" pos=".4 0 .12" euler="20 30 0"><freejoint/>
    <geom type="box" size=".1 .08 .06" mass="6"/>
    <geom name="mark" type="sphere" size=".03" pos="0 0 .1" contype="0" conaffinity="0" mass="0"/>
  </body>
</worldbody></mujoco>"""
BODIES = {"ball": "ball", "front box": r"front\ box"}
"""Entities of the bodies by name."""
FPS = 100.0
UPWARD = (-0.1, 0.0, 1.0)


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    """A recorded drop: the model, the file's contents, and what `rftsim` said at each frame."""
    model = rftsim.load(DROP, terrain=rftsim.FreeSurface(0.01, UPWARD), reduction=0.0)
    data, path, truth = mujoco.MjData(model), tmp_path_factory.mktemp("drop") / "drop.rrd", []
    with record.Recorder(model, path, fps=FPS) as recorder:
        while data.time < 0.8:
            mujoco.mj_step(model, data)
            if recorder.log(data, {"command/speed": 2.0 * data.time}):
                felt = {name: rftsim.tractions(model, data, name) for name in BODIES}
                truth.append((data.time, rftsim.wrenches(model, data), data.xpos.copy(), data.xquat.copy(), felt))
    assert recorder.frames == len(truth)
    return model, read(path), truth


def read(path):
    """Every component of a recording, (rows, ...), by entity and component; times [ns] under "sim_time"."""
    found = {}
    for chunk in rerun_chunk.RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            values = column.cast("int64") if name == "sim_time" else column
            found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(values.to_pylist())
    return found


def scalars(contents, entity):
    return np.array(contents[entity]["Scalars:scalars"])


def test_a_frame_per_period(drop):
    _, contents, truth = drop
    times = np.array(contents["/sand/power"]["sim_time"]) * 1e-9
    assert times == pytest.approx([time for time, *_ in truth], abs=1e-9)
    assert len(truth) == 80  # the first after one step, the others 10 ms apart
    assert np.diff(times) == pytest.approx(1.0 / FPS, abs=2e-9)


@pytest.mark.parametrize("name", BODIES)
def test_wrenches_are_bit_equal(drop, name):
    model, contents, truth = drop
    body = model.body(name).id
    for quantity in ("force", "moment"):
        expected = np.array([getattr(sand, quantity)[body] for _, sand, *_ in truth])
        assert (scalars(contents, f"/sand/{quantity}/{BODIES[name]}") == expected).all()
        assert expected.any()


def test_power_and_depth(drop):
    _, contents, truth = drop
    assert (scalars(contents, "/sand/power")[:, 0] == [sand.power.sum() for _, sand, *_ in truth]).all()
    assert (scalars(contents, "/sand/depth/ball")[:, 0] == [felt["ball"].depth.max() for *_, felt in truth]).all()


@pytest.mark.parametrize("name", BODIES)
def test_poses(drop, name):
    model, contents, truth = drop
    body, pose = model.body(name).id, contents[f"/world/body/{BODIES[name]}"]
    position, quaternion = np.array(pose["Transform3D:translation"]), np.array(pose["Transform3D:quaternion"])
    assert (position[:, 0] == np.float32([xpos[body] for *_, xpos, _, _ in truth])).all()
    assert (quaternion[:, 0] == np.float32([xquat[body] for *_, xquat, _ in truth])[:, [1, 2, 3, 0]]).all()


@pytest.mark.parametrize("name", BODIES)
def test_triangles_are_drawn_where_they_feel_the_sand_and_grey_where_they_do_not(drop, name):
    model, contents, truth = drop
    skin = contents[f"/world/body/{BODIES[name]}/skin"]
    triangles = np.array(skin["Mesh3D:vertex_positions"][0]).reshape(-1, 3, 3)
    colours = np.array(skin["Mesh3D:vertex_colors"], dtype=np.uint32).reshape(len(truth), -1, 3)
    rotation, grey = np.empty(9), traction_colours(np.array([-1.0]), 1.0)
    for (*_, xpos, xquat, felt), shown in zip(truth, colours, strict=True):
        mujoco.mju_quat2Mat(rotation, xquat[model.body(name).id])
        centres = triangles.mean(axis=1) @ rotation.reshape(3, 3).T + xpos[model.body(name).id]
        distance, same = cKDTree(felt[name].centre).query(centres)
        assert distance.max() < 1e-6
        assert sorted(same) == list(range(len(felt[name].centre)))
        assert (shown == shown[:, :1]).all()
        assert ((shown[:, 0] != grey) == felt[name].active[same]).all()


def test_colours_darken_with_traction():
    colours = traction_colours(np.array([-1.0, np.nan, 0.0, 1.0, 2.0, 3.0, 4.0, 9.0]), 4.0)
    channels = colours[:, None] >> np.array([24, 16, 8, 0], dtype=np.uint32) & 255
    assert colours[0] == colours[1] != colours[2]
    assert colours[-1] == colours[-2]
    assert (np.diff(channels[2:-1, :3] @ [0.2126, 0.7152, 0.0722]) < 0.0).all()
    assert (channels[:, 3] == 255).all()


def test_arrows_are_forces_to_one_scale(drop):
    model, contents, truth = drop
    for name, entity in BODIES.items():
        arrows = np.array(contents[f"/world/force/{entity}"]["Arrows3D:vectors"])[:, 0]
        forces = np.array([sand.force[model.body(name).id] for _, sand, *_ in truth])
        scale = np.linalg.norm(arrows, axis=1).max() / np.linalg.norm(forces, axis=1).max()
        assert arrows == pytest.approx(forces * scale, abs=1e-6)
    stated = contents["/about"]["TextDocument:text"][0][0].split("force, ")[1].split(" N")[0]
    length, force = (float(x) for x in stated.split(" m long for "))
    assert scale == pytest.approx(length / force, rel=0.01)


def test_arrows_start_at_the_surface_above_where_the_force_acts(drop):
    _, contents, truth = drop
    up = np.array(UPWARD) / np.linalg.norm(UPWARD)
    starts = np.array(contents["/world/force/ball"]["Arrows3D:origins"])[:, 0]
    pressed = [sand.force[1].any() for _, sand, *_ in truth]
    assert any(pressed)
    assert starts[pressed] @ up == pytest.approx(0.01 * up[2], abs=1e-6)
    assert np.linalg.norm(starts - [xpos[1] for *_, xpos, _, _ in truth], axis=1).max() < 0.15


def test_the_sand_stays_below_the_bodies_in_its_plane(drop):
    _, contents, truth = drop
    up = np.array(UPWARD) / np.linalg.norm(UPWARD)
    ground = np.array(contents["/world/sand/sand"]["Transform3D:translation"])[:, 0]
    assert ground @ up == pytest.approx(0.01 * up[2], abs=1e-6)
    middle = np.array([xpos[1:].mean(axis=0) for *_, xpos, _, _ in truth])
    cell = float(contents["/about"]["TextDocument:text"][0][0].split("**Grid**: ")[1].split(" m")[0])
    assert np.linalg.norm(np.cross(ground - middle, up), axis=1).max() <= cell / np.sqrt(2.0) + 1e-6


def test_what_does_not_feel_the_sand_is_drawn_too(drop):
    _, contents, _ = drop
    assert "/world/body/front\\ box/mark" in contents
    assert not any(entity.startswith("/world/body/world") for entity in contents), "the sand's own plane has no end"


def test_scalars_of_the_caller(drop):
    _, contents, truth = drop
    assert (scalars(contents, "/command/speed")[:, 0] == [2.0 * time for time, *_ in truth]).all()


@pytest.fixture(scope="module")
def model():
    return rftsim.load(DROP, reduction=0.0)


@pytest.mark.parametrize("path", ["sand/force", "/world/x", "", "reward//x"])
def test_paths_that_scalars_cannot_have(model, tmp_path, path):
    with record.Recorder(model, tmp_path / "x.rrd") as recorder:
        with pytest.raises(rftsim.RftsimError, match="scalar's path"):
            recorder.log(mujoco.MjData(model), {path: 1.0})
        assert recorder.frames == 0


def test_scalars_that_come_and_go(model, tmp_path):
    data = mujoco.MjData(model)
    with record.Recorder(model, tmp_path / "x.rrd") as recorder:
        for k in range(6):
            data.time = k / 50.0
            assert recorder.log(data, {"reward/odd": k} if k % 2 else None)
            assert not recorder.log(data)
    odd = read(tmp_path / "x.rrd")["/reward/odd"]
    assert odd["Scalars:scalars"] == [[1.0], [3.0], [5.0]]
    assert odd["sim_time"] == [20_000_000, 60_000_000, 100_000_000]


def test_a_reset_goes_on_after_the_last_frame(model, tmp_path):
    data = mujoco.MjData(model)
    with record.Recorder(model, tmp_path / "x.rrd", fps=10.0) as recorder:
        for data.time in (0.0, 0.1, 0.0, 0.05, 0.1):
            recorder.log(data)
    assert read(tmp_path / "x.rrd")["/sand/power"]["sim_time"] == [k * 100_000_000 for k in range(4)]


def test_no_frames_and_closing_twice(model, tmp_path):
    with record.Recorder(model, tmp_path / "x.rrd") as recorder:
        recorder.close()
    assert "/world/body/ball/skin" in read(tmp_path / "x.rrd")
    with pytest.raises(rftsim.RftsimError, match="closed"):
        recorder.log(mujoco.MjData(model))


def test_a_model_without_sand(tmp_path):
    model = mujoco.MjModel.from_xml_string(DROP)
    with record.Recorder(model, tmp_path / "x.rrd") as recorder:
        assert recorder.log(mujoco.MjData(model))
    contents = read(tmp_path / "x.rrd")
    assert "/world/body/ball/geom0" in contents
    assert not any(entity.startswith("/sand") for entity in contents)


def test_a_finer_surface(tmp_path):
    """The drawn triangles need not be those that feel the sand; each takes the nearest one's traction."""
    model = rftsim.load(DROP, max_edge=0.02, reduction=0.0)
    data = mujoco.MjData(model)
    data.qpos[2] = 0.05
    data.qvel[2] = -1.0
    mujoco.mj_forward(model, data)
    with record.Recorder(model, tmp_path / "x.rrd") as recorder:
        recorder.log(data)
    contents = read(tmp_path / "x.rrd")
    skin = contents["/world/body/ball/skin"]
    height = np.array(skin["Mesh3D:vertex_positions"][0]).reshape(-1, 3, 3)[..., 2].mean(axis=1) + 0.05
    coloured = np.array(skin["Mesh3D:vertex_colors"][0])[::3] != traction_colours(np.array([-1.0]), 1.0)
    assert coloured[height < -0.01].all()
    assert not coloured[height > 0.01].any()
    assert "/world/body/front\\ box/mark" in contents, "it collides with nothing, and the box has a geom that does"


def unwritable(folder):
    (folder / "folder.rrd").mkdir()
    (folder / "file").touch()
    return [folder / "none" / "x.rrd", folder / "folder.rrd", folder / "file" / "x.rrd", folder / "x.mp4"]


@pytest.mark.parametrize("which", range(4))
def test_an_unwritable_path_is_refused_before_anything_is_written(model, tmp_path, which):
    path = unwritable(tmp_path)[which]
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(rftsim.RftsimError, match=path.name):
        record.Recorder(model, path)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("fps", [0.0, -1.0, np.nan, np.inf])
def test_fps_is_positive(model, tmp_path, fps):
    with pytest.raises(rftsim.RftsimError, match="fps"):
        record.Recorder(model, tmp_path / "x.rrd", fps=fps)


def test_an_exception_keeps_what_was_recorded(model, tmp_path):
    def run():
        with record.Recorder(model, tmp_path / "x.rrd") as recorder:
            recorder.log(mujoco.MjData(model))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert len(read(tmp_path / "x.rrd")["/sand/power"]["sim_time"]) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["x.rrd"]


def test_a_full_disk_leaves_what_was_there(model, tmp_path):
    path = tmp_path / "x.rrd"
    path.write_text("old")
    recorder = record.Recorder(model, path)
    recorder.log(mujoco.MjData(model))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(rftsim.RftsimError, match="could not be written"):
            recorder.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["x.rrd"]


def test_a_file_that_lacks_rows_is_not_put_in_place(model, tmp_path, monkeypatch):
    class Forgetful(rerun_chunk.RrdReader):
        def stream(self):
            return (chunk for chunk in super().stream() if chunk.entity_path != "/sand/power")

    monkeypatch.setattr(recording_file, "RrdReader", Forgetful)
    recorder = record.Recorder(model, tmp_path / "x.rrd")
    recorder.log(mujoco.MjData(model))
    with pytest.raises(rftsim.RftsimError, match="/sand/power"):
        recorder.close()
    assert not list(tmp_path.iterdir())


def test_a_finished_recording_replaces_an_older_one(model, tmp_path):
    path = tmp_path / "x.rrd"
    path.write_text("old")
    with record.Recorder(model, path):
        assert path.read_text() == "old"
    assert "/about" in read(path)
