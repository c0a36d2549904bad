"""Robots that nobody here made load on sand without an option, and the sand carries those that stand; see `robots`."""

import re

import pytest
import robots
from rich.console import Console


@pytest.mark.slow
def test_robots_of_others():
    """At least 95 % of what MuJoCo loads, weights to 1 %, and no run is lost that is not lost without sand."""
    paths = list(robots.find_models())
    if not paths:
        pytest.skip("no robots: set MENAGERIE_ROOT")
    found = robots.summary(robots.measure(paths, Console(quiet=True)))
    print(found)
    assert found["loaded"] >= 0.95 * found["tried"]
    assert found["carried"] == found["stand"] > 0
    assert found["lost_on_sand_alone"] == 0


@pytest.mark.parametrize("robot", ["unitree_go1", "agility_cassie"])
def test_a_robot_stands(robot):
    """Two of them, quickly: no option, no doubt, its weight carried."""
    path = next((p for p in robots.find_models() if p.parts[-2] == robot), None)
    if path is None:
        pytest.skip(f"no {robot}")
    row = robots.try_model(path)
    assert row["carried"] == pytest.approx(1.0, abs=0.01)
    assert row["warnings"] == []
    assert len(row["choices"]) <= 3


@pytest.mark.parametrize("terrain", ["slope=8", "dunes,amplitude=0.03,wavelength=2,seed=3"])
@pytest.mark.parametrize("robot", ["unitree_go1", "google_barkour_vb"])
def test_a_robot_stands_on_terrain(robot, terrain):
    """Quadrupeds that hold their pose rest on a slope and on dunes, their weight carried; nothing is doubtful."""
    path = next((p for p in robots.find_models() if p.parts[-2] == robot), None)
    if path is None:
        pytest.skip(f"no {robot}")
    row = robots.try_model(path, terrain=terrain)
    assert row["carried"] == pytest.approx(1.0, abs=0.02)
    assert row["speed"] < 5 * robots.REST
    assert row["warnings"] == []


def test_a_scene_with_a_height_field_becomes_sand_with_its_relief():
    """The scene as it comes: its noise is steeper than sand lies, which is said; the robot's weight is carried."""
    path = next((p for p in robots.find_models() if "hfield" in p.name), None)
    if path is None:
        pytest.skip("no scene with a height field")
    row = robots.try_model(path)
    assert any("with the relief of geom floor" in choice for choice in row["choices"])
    (said,) = [one for one in row["warnings"] if "repose" in one]
    assert re.search(r"up to \d+\.?\d* degrees against gravity, on \d+ % of its area, beyond its angle of repose", said)
    assert row["carried"] == pytest.approx(1.0, abs=0.02)
