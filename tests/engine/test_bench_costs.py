"""The studies of cost: what they measure is right, whatever the machine's speed."""

import copy
import json
import math

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim.bench import environment, others, pareto, paths, quadruped, tolerances
from rftsim.bench.cases import OWN, draw_controls
from rftsim.bench.environment_picture import plot_environment
from rftsim.bench.pareto import Compared, Tried
from rftsim.bench.pareto_picture import plot_pareto
from rftsim.cli.costs import compare_speeds


def tried(cost, error, h=1e-3):
    return Tried("runner", "drft2d", "shipped", 400, 0.0, "implicit", h, error, cost * h)


def test_the_front_is_what_nothing_cheaper_comes_near():
    """Of four, one is dearer and no better, and one is hardly better."""
    best, good, dear, close = tried(4.0, 0.1), tried(1.0, 0.4), tried(2.0, 0.5), tried(1.1, 0.39)
    assert pareto.front([dear, best, close, good]) == [good, best]


@pytest.fixture(scope="module")
def runner():
    """The runner with its own triangles, at two time steps."""
    return Compared(*pareto._compare("runner", "drft2d", ("shipped",), (1e-3, 5e-3)))


def test_a_shorter_step_is_nearer_to_the_reference(runner, tmp_path):
    """The path converges with the step: a fifth of it errs by less than half."""
    error = {(one.force, one.h): one.error for one in runner.tried}
    assert 0.0 < error["implicit", 1e-3] < 0.5 * error["implicit", 5e-3] < 0.005
    assert all(math.isfinite(value) for value in error.values())
    assert pareto.laws_apart([Compared(runner.tried, np.array(runner.path))]) == {("runner", "drft2d"): 0.0}
    plot_pareto([Compared(runner.tried, np.array(runner.path))], tmp_path / "pareto.png")
    assert (tmp_path / "pareto.png").stat().st_size > 10_000


def test_a_finer_tolerance_costs_evaluations(tmp_path, capsys):
    """Every subject has a row for every tolerance; a finer one evaluates the force as often or more."""
    compare_speeds(("tolerance",), quick=True, memory=tmp_path, plot=tmp_path, json=True)
    printed = json.loads(capsys.readouterr().out)
    rows = [tolerances.Solved(**row) for row in printed["tolerance"]]
    ways = [(name, 5e-3, tolerance) for name in tolerances.SOLVED for tolerance in tolerances.QUICK]
    assert [(row.subject, row.h, row.tolerance) for row in rows] == ways
    assert all(0.0 < row.error < 0.2 and row.seconds > 0.0 for row in rows)
    for name in tolerances.SOLVED:
        evaluations = [row.evaluations for row in rows if row.subject == name]
        assert evaluations == sorted(evaluations, reverse=True)
        assert evaluations[-1] >= 1.0
    assert printed["advice"]["common"] in tolerances.QUICK
    assert (tmp_path / "tolerance.png").stat().st_size > 10_000
    again = pareto.Study(tmp_path / "pareto.json", quick=True)
    assert pareto.run_tolerances(again, tolerances.SOLVED, lambda _: None) == rows


def solved(subject, tolerance, seconds, error):
    return tolerances.Solved(subject, "rft3d", 5e-3, tolerance, seconds, 1.0, 0.0, 0, error)


def test_the_cheapest_tolerance_that_errs_little_is_recommended():
    """Each subject has its own, all together the cheapest that serves each; one that is lost has none."""
    coarse = [solved("a", 1e-1, 1.0, 0.3), solved("b", 1e-1, 1.0, 0.1)]
    rows = [solved("a", 1e-4, 4.0, 0.1), solved("a", 1e-2, 2.0, 0.14), solved("b", 1e-4, 2.0, 0.1)]
    rows += [solved("b", 1e-2, 1.5, 0.1), *coarse]
    assert tolerances.advise(rows) == (5e-3, 1e-4, {"a": 1e-2, "b": 1e-1}, 1e-2)
    assert tolerances.advise([solved("a", 1e-4, 4.0, math.inf), *coarse[:1]]) is None


def test_parts_of_pareto_are_chosen_by_name(tmp_path):
    """A part that is not there is said, before anything is measured."""
    with pytest.raises(rftsim.RftsimError, match="no part 'wheel'; --cases takes laws, tolerance"):
        compare_speeds(("wheel",), quick=True, memory=tmp_path, plot=None, json=True)


def test_the_step_with_sand_over_the_one_without(tmp_path):
    """Each evaluation of the force costs time; the batch's simulations have sand of their own and lose no step."""
    pytest.importorskip("mujoco.batch")
    none, explicit, implicit, training = environment._time(OWN["runner", "drft2d"], 3, lambda _: None)
    assert none.ratio == 1.0
    assert 1.0 < explicit.ratio < implicit.ratio
    assert implicit.over_explicit > 1.0
    assert explicit.evaluations == 1.0
    assert implicit.evaluations >= 1.0
    assert 1.0 <= training.evaluations <= implicit.evaluations
    for one in (explicit, implicit, training):
        assert all(0.0 < share < 1.0 for _, share in one.batch.values())
    alone = [one._replace(subject="alone", batch={}) for one in (none, explicit, implicit, training)]
    plot_environment([none, explicit, implicit, training, *alone], tmp_path / "environment.png")
    assert (tmp_path / "environment.png").stat().st_size > 10_000


def test_the_quadruped_trots():
    """It goes ahead on its feet, its torso above the sand, and nearly every equation is solved."""
    begun = OWN["quadruped", "rft3d"].prepare().begun["implicit"]
    data = copy.copy(begun)
    for span in OWN["quadruped", "rft3d"].move(data, 200):
        data.ctrl[:] = span.ctrl
        mujoco.mj_step(data.model, data, nstep=span.steps)
    assert data.qpos[0] > begun.qpos[0] + 0.1
    assert data.qpos[2] > 0.2
    assert rftsim.work(data.model, data).unsolved <= 1


def test_the_quadruped_is_followed_as_it_is_timed():
    """A path of it takes the controls that the study of the environment takes, whatever the time step."""
    begun = quadruped.trotting()
    spans = OWN["quadruped", "rft3d"].move(begun, 60)
    for k in range(30):
        held = quadruped.QUADRUPED.move(begun.model, k * paths.SAMPLE)
        assert np.allclose(held, spans[k // 2].ctrl, atol=1e-9)


def test_spheres_lie_in_the_sand():
    """Ten spheres stay where they are, apart from each other, at the depth of one."""
    models, begun = others.spheres()[1].prepare()
    data = copy.copy(begun["implicit"])
    mujoco.mj_step(models["implicit"], data, nstep=20)
    assert np.allclose(data.qpos, begun["implicit"].qpos, atol=1e-5)
    assert (data.qpos.reshape(10, 7)[:, 2] < 0.05).all()
    assert data.ncon == 0


def test_cases_are_chosen_by_name(monkeypatch, tmp_path):
    """By name, all, or the quick ones; robots that are not there are said."""
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    chosen, missing = environment.choose(["wheel", "spheres-100"], quick=True)
    assert [(case.name, case.law) for case in chosen] == [
        ("wheel", "drft2d"),
        ("wheel", "rft2d"),
        ("spheres-100", "rft3d"),
    ]
    assert missing == []
    everything, missing = environment.choose([], quick=False)
    assert {"quadruped", "spheres-400"} <= {case.name for case in everything}
    assert "go1 (unitree_go1/scene.xml)" in missing
    with pytest.raises(rftsim.RftsimError, match="no case 'go1'"):
        environment.choose(["go1"], quick=False)


def test_controls_are_the_same_on_every_ground():
    """They are drawn anew every ten steps, from the range of each, or from -1 to 1 where it has none."""
    servos = '<actuator><motor joint="a" ctrlrange="0 1"/><motor joint="b"/></actuator>'
    bodies = "".join(f'<body><joint name="{name}"/><geom size=".1"/></body>' for name in "ab")
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody>{servos}</mujoco>"))
    first, again = draw_controls(data, 25), draw_controls(data, 25)
    assert [span.steps for span in first] == [10, 10, 5]
    assert all(np.array_equal(one.ctrl, other.ctrl) for one, other in zip(first, again, strict=True))
    assert all(0.0 <= span.ctrl[0] <= 0.2 and abs(span.ctrl[1]) <= 0.4 for span in first)
