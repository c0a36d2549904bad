"""Robots that nobody here made load on sand without an option, and the sand carries those that stand; see `robots`."""

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
