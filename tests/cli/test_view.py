"""The live view: what its loop and its keys do, in a window of its own where there is a virtual display."""

import contextlib
import functools
import subprocess

import mujoco
import numpy as np
import pytest
from test_cli import call

import rftsim
from rftsim.run.robot import measure, total_force
from rftsim.run.scenes import stage
from rftsim.run.start import begin
from rftsim.view import live
from rftsim.view.drawing import Shown

MODEL = """
<mujoco><worldbody><light pos="0 0 2"/>
  <body name="box" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .05 .04" mass="12"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "box.xml"
    path.write_text(MODEL)
    return path


@pytest.fixture
def shown(path):
    staged = stage(str(path))
    return live.Live(staged.model, functools.partial(begin, staged))


class FakeHandle:
    """A window that is closed after some pictures."""

    def __init__(self, model, pictures):
        self.user_scn = mujoco.MjvScene(model, maxgeom=2000)
        self.perturb, self.left, self.texts, self.updated = mujoco.MjvPerturb(), pictures, None, []

    def is_running(self):
        self.left -= 1
        return self.left >= 0

    def lock(self):
        return contextlib.nullcontext()

    def set_texts(self, texts):
        self.texts = texts

    def update_hfield(self, hfieldid):
        self.updated.append(hfieldid)

    def sync(self):
        pass


def test_the_loop_shows_a_robot_that_stands(shown):
    handle = FakeHandle(shown.model, 12)
    live.follow(shown, handle)
    assert 0.05 < shown.data.time < 0.7
    assert shown.data.qpos[2] == pytest.approx(shown.start.qpos[2], abs=5e-3)
    assert handle.user_scn.ngeom > 1
    assert "sand carries" in handle.texts[2]
    assert "% of 117.7 N" in handle.texts[3]
    assert handle.texts[2].count("\n") == handle.texts[3].count("\n")
    live.follow(shown, FakeHandle(shown.model, 10_000), seconds=0.1)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (-5.886, 0.0, -7.848)])
def test_the_share_is_against_gravity(path, gravity):
    """On a slope, as the measures of a robot have it: what lies still is carried whole, however the sand is tilted."""
    with pytest.warns(rftsim.RftsimWarning, match="tilted by 45 degrees against gravity"):
        staged = stage(str(path), terrain=rftsim.FreeSurface(normal=(1.0, 0.0, 1.0)))
    staged.model.opt.gravity[:] = gravity
    shown = live.Live(staged.model, functools.partial(begin, staged))
    for _ in range(4):
        shown.advance(0.02, mujoco.MjvPerturb())
    robot = measure(staged.model, shown.data, "box")
    down = np.array(gravity) / np.linalg.norm(gravity)
    assert robot.carried == pytest.approx(-total_force(staged.model, shown.data) @ down / robot.weight)
    assert f"{100 * robot.carried:.0f} % of {robot.weight:.4g} N" in shown.texts()[1]


def test_keys(shown):
    still = mujoco.MjvPerturb()
    bed = rftsim.instances(shown.model)[0].bed
    strength, plane = float(bed.xi_n), shown.model.geom("sand_surface")
    shown.press(live.UP)
    shown.press(live.SPACE)
    shown.advance(0.02, still)
    assert bed.xi_n == pytest.approx(strength * live.FACTOR)
    assert shown.data.time == 0.0
    for key in (live.DOWN, live.DOWN, live.SPACE, ord("6"), ord("7"), ord("8")):
        shown.press(key)
    shown.advance(0.04, still)
    assert bed.xi_n == pytest.approx(strength / live.FACTOR)
    assert shown.data.time == pytest.approx(0.04)
    assert shown.shown == Shown(False, True)
    assert "traction, 0 to" in shown.texts()[0]
    assert plane.rgba[3] == live.OPACITIES[1] < 1.0
    shown.data.qpos[2] += 1.0
    shown.press(live.BACKSPACE)
    shown.advance(0.0, still)
    assert shown.data.time == 0.0
    assert (shown.data.qpos == shown.start.qpos).all()


def test_a_slow_simulation_falls_behind(shown):
    shown.advance(10.0, mujoco.MjvPerturb())
    assert shown.data.time == pytest.approx(live.LONGEST)


def test_the_mouse_pushes(shown):
    push = mujoco.MjvPerturb()
    push.select, push.active = 1, int(mujoco.mjtPertBit.mjPERT_TRANSLATE)
    push.scale, push.localmass = 1.0, 12.0
    push.refselpos[:] = shown.data.xpos[1] + [0.0, 0.0, 0.5]
    shown.advance(0.05, push)
    assert shown.data.xfrc_applied[1, 2] > 0.0
    push.active = 0
    shown.advance(0.01, push)
    assert not shown.data.xfrc_applied.any()


def test_without_a_display(capsys, path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    code, out, err = call(capsys, "view", path)
    assert code == 2
    assert "Backspace: start again" in out
    assert "no display to show the model on" in err
    code, _, err = call(capsys, "view", path, "--seconds", 0)
    assert code == 2
    assert "seconds must be positive" in err


def test_a_window_opens_and_closes(display, path):
    """The command in a process of its own ends by itself, and well."""
    ended = subprocess.run(
        display.command("view", path, "--seconds", 0.5),
        env=display.environment(),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "Backspace: start again" in ended.stdout


def test_nothing_of_the_model_changes_but_what_the_keys_change(shown):
    """A copy that is stepped beside it goes the same way."""
    other = mujoco.MjData(shown.model)
    other.qpos[:] = shown.start.qpos
    mujoco.mj_forward(shown.model, other)
    shown.advance(0.02, mujoco.MjvPerturb())
    mujoco.mj_step(shown.model, other, nstep=round(shown.data.time / shown.model.opt.timestep))
    assert np.array_equal(other.qpos, shown.data.qpos)
