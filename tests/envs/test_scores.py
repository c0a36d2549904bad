"""Scores of policies as a person asks for them: grounds, tables of several policies, baselines."""

import json

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from commands import call
from rftsim_envs import tasks
from rftsim_envs.env import SandEnv
from rftsim_envs.training import evaluate, ppo
from rftsim_envs.training.folder import make_plan
from short_runs import SHORT, TASK, TINY

from rftsim.cli import evaluate as results


def test_a_policy_is_scored_on_grounds(finished, tmp_path, capsys):
    arguments = ("evaluate", finished, "--on", "sand,rigid", "--episodes", 2, "--baseline", "--json")
    report = json.loads(call(capsys, *arguments, "--plot", tmp_path / "scores.png")[1])
    assert [(one["ground"], one["actor"]) for one in report[str(finished)]] == [
        (ground, actor) for ground in ("sand", "rigid") for actor in ("policy", "random", "open loop")
    ]
    assert (tmp_path / "scores.png").stat().st_size > 10_000
    played = json.loads(call(capsys, "play", finished, "--seed", 10_001, "--json")[1])["episodes"][0]
    scored = report[str(finished)][0]["episodes"][1]
    assert scored["r"] == pytest.approx(played["r"], rel=1e-6)  # actions of a batch differ in their last bits
    for one in report[str(finished)]:
        assert one["ended_early"] == 0.0
        assert one["which"].endswith("rad/s") == (one["actor"] == "open loop")


def test_the_share_that_arrives_is_told_where_any_does():
    one = {"r": 1.0, "early": 0.0, "reached": 1.0}
    for episodes, told in (
        ([one, one | {"reached": 0.0}], ["arrived [%]", "50"]),
        ([one | {"reached": 0.0}], ["early [%]", "0"]),
    ):
        head, row = results._grid([evaluate.Score("sand", evaluate.POLICY, episodes)], False)
        assert [head[-1], row[-1]] == told


def test_several_runs_make_a_table_of_transfer(finished, tmp_path, capsys):
    ppo.train(make_plan(TASK, SHORT | {"ground": "rigid"}, TINY), tmp_path / "rigid" / "seed-0")
    code, out, _ = call(capsys, "evaluate", finished, tmp_path / "rigid", "--episodes", 1, "--markdown")
    head, _, *rows = (line for line in out.splitlines() if line.startswith("|"))
    assert code == 0
    assert head == "| return | on sand | on rigid |"
    assert ["trained on sand" in rows[0], "trained on rigid" in rows[1]] == [True, True]
    assert f"    rftsim evaluate {finished} {tmp_path / 'rigid'} --episodes 1 --markdown" in out
    code, _, err = call(capsys, "evaluate", finished, "--on", "mud")
    assert (code, "grounds are as trained, sand" in " ".join(err.split())) == (2, True)
    code, _, err = call(capsys, "evaluate", tmp_path / "nothing")
    assert (code, "holds no training run" in " ".join(err.split())) == (2, True)


def test_a_sand_that_a_law_cannot_have_is_left_out(finished, tmp_path, capsys):
    """medium-sand has no density: of two runs the one whose law needs it has a dash there, and alone it is refused."""
    ppo.train(make_plan(TASK, SHORT | {"law": "rft2d"}, TINY), tmp_path)
    given = ("--on", "sand,medium-sand", "--episodes", 2, "--markdown")
    code, out, _ = call(capsys, "evaluate", finished, tmp_path, *given)
    first, second = (row.split("|")[2:4] for row in out.splitlines()[2:4])
    assert code == 0
    assert ([cell.strip() == "-" for cell in first], [cell.strip() == "-" for cell in second]) == (
        [False, True],
        [False, False],
    )
    code, _, err = call(capsys, "evaluate", finished, *given)
    assert (code, "has no density" in " ".join(err.split())) == (2, True)


def test_the_grid_has_each_ground_once():
    found = evaluate.grid(make_plan(TASK))
    assert "as trained" in found
    assert "poppy-seeds" not in found  # that is what the runner is trained on
    assert "medium-sand" not in found  # it has no density
    assert "rigid" in found


@pytest.mark.parametrize("name", tasks.TASKS)
def test_drives_that_see_nothing_are_actions(name):
    task = tasks.make(name, {})
    env = SandEnv(name)
    for drive in task.open_loops().values():
        for time_ in (0.0, 1.23):
            action = drive(time_)
            assert action.shape == (env.task.naction,)
            assert np.abs(action).max() <= 1.0


def test_a_policy_with_a_past_is_trained_and_scored(tmp_path, capsys):
    plan = make_plan(TASK, SHORT | {"history": 3, "observe_ground": True}, TINY)
    ppo.train(plan, tmp_path)
    code, out, _ = call(capsys, "evaluate", tmp_path, "--episodes", 2, "--on", "sand,dunes", "--json")
    assert (code, len(json.loads(out)[str(tmp_path)])) == (0, 2)


@pytest.mark.slow
def test_scores_on_ray_are_those_of_here(finished, capsys):
    """`evaluate --ray` gives, ground by ground, the numbers of the same command without it."""
    pytest.importorskip("ray")
    arguments = ("evaluate", finished, "--on", "sand,rigid", "--episodes", 2, "--baseline", "--json")
    code, out, _ = call(capsys, *arguments, "--ray", "local")
    assert code == 0
    assert json.loads(out) == json.loads(call(capsys, *arguments)[1])
