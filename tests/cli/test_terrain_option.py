"""`--terrain` of `run`, `drop` and `inspect`: robots on slopes, dunes and height fields; and what is refused."""

import functools
import json
import math

import numpy as np
import pytest
from PIL import Image
from test_cli import call
from test_robots_in_sand import ROBOT, WEIGHT

from rftsim import make_terrain

COMMANDS = (("run", "--duration", "0.02"), ("drop", "--limit", "0.02"), ("inspect",), ("view", "--seconds", "0.1"))
FIELD = '<asset><hfield name="field" nrow="3" ncol="3" size="2 2 .1 .1" elevation="0 1 2 1 2 3 2 3 4"/></asset>'


@pytest.fixture
def robot(tmp_path):
    """A robot on a plane, and a height field far beside it."""
    path = tmp_path / "robot.xml"
    hill = '<geom name="hill" type="hfield" hfield="field" pos="20 0 0"/>'
    path.write_text(ROBOT.replace("<worldbody>", FIELD + "<worldbody>" + hill))
    return path


def report(capsys, *arguments):
    code, out, err = call(capsys, *arguments, "--json")
    assert code == 0, err
    return json.loads(out)


@pytest.mark.parametrize(
    ("terrain", "words"),
    [
        ("mountains", "no terrain 'mountains': it must be a height [m], slope=DEGREES, dunes, or a file"),
        ("floor", "or the name of a height field geom of the model, which has 'hill'"),
        ("slope=100", "a slope must be less than 90 degrees steep, not 100"),
        ("dunes,amplitude=1", "take an amplitude of"),
        ("dunes,depth=1", "is no option; there are amplitude, wavelength, size, spacing, seed"),
        ("gone.png,size=1,high=1", "no terrain file gone.png"),
    ],
)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_terrain_that_is_none_is_refused_in_one_line(capsys, robot, command, terrain, words):
    code, _, err = call(capsys, command[0], robot, *command[1:], "--terrain", terrain)
    assert code == 2
    assert words in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("terrain", ["0.1", "slope=8,heading=30", "dunes,seed=1,amplitude=0.03", "hill"])
def test_inspect_says_where_the_sand_lies_and_where_the_robot_stands(capsys, robot, terrain):
    found = report(capsys, "inspect", robot, "--terrain", terrain)
    surface = found["surface"]
    if terrain == "hill":
        assert (surface["rows"], surface["columns"], surface["spacing_m"]) == (3, 3, [2.0, 2.0])
        assert (surface["lowest_m"], surface["highest_m"]) == pytest.approx((0.0, 0.1))
        assert surface["origin_m"] == [18.0, -2.0]
    elif terrain.startswith("dunes"):
        assert surface["repeat"]
        assert surface["highest_m"] == pytest.approx(make_terrain(terrain).heights.max())
        assert 5.0 < surface["steepest_deg"] < 25.0
    elif terrain.startswith("slope"):
        assert surface["normal"][2] == pytest.approx(math.cos(math.radians(8.0)))
    else:
        assert surface["height"] == 0.1
    (tree,) = found["stands"]
    assert sum(foot["share"] for foot in tree["feet"].values()) == pytest.approx(1.0)


@pytest.mark.parametrize("terrain", ["slope=4", "slope=10,heading=90", "dunes,seed=1,amplitude=0.02"])
def test_a_robot_that_is_dropped_on_terrain_rests_on_it(capsys, robot, terrain):
    """Above the ground under it, in the sand by its feet alone, all of its weight carried."""
    found = report(capsys, "drop", robot, "--terrain", terrain)
    assert found["rests"], found["warnings"]
    assert found["carried"] == pytest.approx(1.0, abs=0.02)
    assert found["weight_N"] == pytest.approx(WEIGHT)
    assert 0.1 < found["trunk_height_m"] < 0.35
    assert set(found["feet_sinkage_m"]) == {"left", "right"}
    assert max(found["feet_sinkage_m"].values()) < 0.1


def test_run_on_a_picture(capsys, robot, tmp_path):
    """Heights between black and white; the robot stands over the picture's middle."""
    grey = np.clip(np.add.outer(np.linspace(0, 200, 30), np.linspace(0, 55, 40)), 0, 255)
    Image.fromarray(grey.astype(np.uint8)).save(tmp_path / "ramp.png")
    terrain = f"{tmp_path}/ramp.png,size=4x3,low=0.1,high=0.4"
    found = report(capsys, "run", robot, "--duration", 1, "--terrain", terrain)
    assert found["carried"] == pytest.approx(1.0, abs=0.05)
    assert found["trunk_height_m"] > 0.1


def test_a_shipped_scene_takes_terrain_too(capsys):
    """A wheel in the plane drives up a slope more slowly than on level sand, and falls down no hole."""
    run = functools.partial(report, capsys, "run", "grouser-wheel", "--duration", 1.0)
    level, uphill = run(), run("--terrain", "slope=4")
    assert 0.0 < uphill["speed_m_s"] < level["speed_m_s"]
    assert uphill["sinkage_m"] == pytest.approx(level["sinkage_m"], rel=0.3)
