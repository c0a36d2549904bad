"""`run`, `inspect` and `drop` of somebody's robot: where it stands, what carries it, and the pose that is kept."""

import functools
import json

import mujoco
import numpy as np
import pytest
from test_cli import call

from rftsim.model.poses import posed

ROBOT = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 .4">
      <freejoint/>
      <geom type="box" size=".15 .1 .04" mass="6"/>
      <body name="left" pos="0 .1 0">
        <joint name="left" axis="1 0 0" range="-60 60" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0 .02 -.2" size=".01" mass=".3" contype="0" conaffinity="0"/>
        <geom type="box" size=".08 .03 .02" pos="0 .02 -.22" mass=".5"/>
      </body>
      <body name="right" pos="0 -.1 0">
        <joint name="right" axis="1 0 0" range="-60 60" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0 -.02 -.2" size=".01" mass=".3" contype="0" conaffinity="0"/>
        <geom type="box" size=".08 .03 .02" pos="0 -.02 -.22" mass=".5"/>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="left" kp="200"/><position joint="right" kp="200"/></actuator>
  <keyframe>
    <key name="straight" qpos="0 0 .5 1 0 0 0 0 0"/>
    <key name="wide" qpos="0 0 .5 1 0 0 0 .2 -.2"/>
  </keyframe>
</mujoco>"""
WEIGHT = 7.6 * 9.81


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(ROBOT)
    return path


def report(capsys, *arguments):
    code, out, err = call(capsys, *arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def test_run_measures_the_robot(capsys, robot):
    found = report(capsys, "run", robot, "--duration", 1)
    assert found["trunk"] == "trunk"
    assert found["carried"] == pytest.approx(1.0, abs=0.02)
    assert found["weight_N"] == pytest.approx(WEIGHT)
    assert set(found["feet_sinkage_m"]) == {"left", "right"}
    assert found["sinkage_m"] == pytest.approx(max(found["feet_sinkage_m"].values()), rel=0.02)
    assert 0.0 < found["sinkage_m"] < 0.1
    assert found["trunk_height_m"] == pytest.approx(0.24 - found["sinkage_m"], abs=5e-3)
    assert found["speed_m_s"] < 0.01
    assert found["slip"] is None
    said = call(capsys, "run", robot, "--duration", 0.1)[1]
    assert "trunk trunk: 0.2" in said
    assert "sinkage [mm]: " in said
    assert f"% of {WEIGHT:.4g} N" in said


def test_a_picture_of_any_model(capsys, robot, tmp_path):
    """The model's own offscreen buffer, of 640 x 480, is too small for it."""
    picture = tmp_path / "robot.png"
    report(capsys, "run", robot, "--duration", 0.05, "--picture", picture, "--tractions", "--buried")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert int.from_bytes(picture.read_bytes()[16:20], "big") == 960


def test_a_film_of_any_model(capsys, robot, tmp_path):
    """With ruts, thirty pictures a second, of the size of pictures; refused at once where it cannot be written."""
    av = pytest.importorskip("av")
    film = tmp_path / "robot.mp4"
    report(capsys, "run", robot, "--duration", 0.2, "--ruts", "--video", film)
    with av.open(str(film)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 6
    assert frames[0].shape == (540, 960, 3)
    assert frames[0].std() > 10.0
    code, _, err = call(capsys, "run", robot, "--video", tmp_path / "robot.gif")
    assert code == 2
    assert "must end in .mp4" in err


def test_run_without_settling_falls(capsys, robot):
    """From 0.5 m the feet are 0.26 m above the sand at first."""
    found = report(capsys, "run", robot, "--duration", 0.1, "--no-settle")
    assert found["feet_sinkage_m"] == {}
    assert found["sinkage_m"] < -0.1
    assert found["carried"] == 0.0


def test_the_options_of_a_model_file(capsys, robot):
    """The bodies that feel the sand, its height and the keyframe, of `inspect` and `run` alike."""
    coarse = ("inspect", robot, "--reduction", 0.9)
    told = report(capsys, *coarse, "--bodies", "left,right", "--terrain", 0.3, "--keyframe", "wide")
    assert not told["bodies"]["trunk"]["feels_sand"]
    assert told["surface"]["height"] == 0.3
    (stand,) = told["stands"]
    assert stand["root"] == "trunk"
    assert set(stand["feet"]) == {"left", "right"}
    assert sum(foot["share"] for foot in stand["feet"].values()) == pytest.approx(1.0)
    straight = report(capsys, *coarse, "--keyframe", "0", "--geoms", "all")
    assert stand["feet"]["left"]["sinkage_m"] > 1.1 * straight["stands"][0]["feet"]["left"]["sinkage_m"]
    assert straight["bodies"]["left"]["triangles"] == told["bodies"]["left"]["triangles"], "it has a geom that collides"
    assert "stands: trunk, 74.56 N, lowered by " in call(capsys, *coarse)[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("robot", "--keyframe", "crouch"), "the model has straight, wide"),
        (("robot", "--bodies", "lift"), "near are left"),
        (("grouser-wheel", "--keyframe", "0"), "--keyframe is for model files"),
    ],
)
def test_run_refuses(capsys, robot, arguments, words):
    code, _, err = call(capsys, "run", *(robot if word == "robot" else word for word in arguments))
    assert code == 2
    assert words in err


def test_drop_prints_a_keyframe_that_stands(capsys, robot):
    """The settled pose is kept: started in it, the trunk stays within a tenth of a millimetre."""
    code, out, _ = call(capsys, "drop", robot, "--keyframe", "wide")
    assert code == 0
    assert "rests after" in out
    assert "the sand carries 100.0 %" in out
    path = robot.with_name("again.xml")
    path.write_text(ROBOT.replace("<keyframe>", out[out.index("<keyframe>") : out.index("</keyframe>")]))
    again = report(capsys, "run", path, "--keyframe", "settled", "--no-settle", "--duration", 0.5)
    height = float(out.split("trunk trunk: ")[1].split(" m")[0])
    assert again["trunk_height_m"] == pytest.approx(height, abs=2e-4)


def test_drop_writes_what_can_be_included(capsys, robot, tmp_path):
    found = report(capsys, "drop", robot, "-o", tmp_path / "settled.xml")
    assert found["rests"]
    report(capsys, "drop", robot, "-o", tmp_path / "settled.npz")
    whole = tmp_path / "whole.xml"
    whole.write_text(ROBOT.replace("</mujoco>", '<include file="settled.xml"/></mujoco>'))
    model = mujoco.MjModel.from_xml_path(str(whole))
    assert model.key("settled").qpos == pytest.approx(found["qpos"], abs=1e-7)
    assert np.load(tmp_path / "settled.npz")["qpos"] == pytest.approx(found["qpos"])


def test_drop_says_what_did_not_rest(capsys, robot, tmp_path):
    assert any("does not rest" in one for one in report(capsys, "drop", robot, "--limit", 0.05)["warnings"])
    limp = tmp_path / "limp.xml"
    changes = {'kp="200"': 'kp=".01"', 'axis="1 0 0"': 'axis="0 1 0"', 'damping="1"': "", "0 .2 -.2": "0 .4 .4"}
    limp.write_text(functools.reduce(lambda text, change: text.replace(*change), changes.items(), ROBOT))
    assert any("do not hold the pose" in one for one in report(capsys, "drop", limp, "--keyframe", "1")["warnings"])
    code, _, err = call(capsys, "drop", robot, "-o", tmp_path / "settled.txt")
    assert code == 2
    assert "must end in .xml or .npz" in err


def test_poses():
    """Without controls of its own servos hold a keyframe's pose; without keyframes joints start in range."""
    model = mujoco.MjModel.from_xml_string(ROBOT)
    assert posed(model, "wide").ctrl == pytest.approx([0.2, -0.2])
    assert posed(model).ctrl == pytest.approx([0.0, 0.0])
    start = ROBOT[: ROBOT.index("<keyframe>")].replace('range="-60 60"', 'range="10 60"') + "</mujoco>"
    model = mujoco.MjModel.from_xml_string(start)
    assert posed(model).qpos[7:] == pytest.approx(np.radians([10, 10]))
    assert posed(model).ctrl == pytest.approx(np.radians([10, 10]))
