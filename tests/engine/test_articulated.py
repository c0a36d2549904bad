"""Articulated scenes drawn from a seed: the same seed gives the same scene, and sand loses none that stands without."""

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim.bench import hard_cases, solver
from rftsim.bench.articulated import articulated, state_of
from rftsim.bench.effort import Effort, Meter
from rftsim.bench.trials import is_lost
from rftsim.cli.solver import fate
from rftsim.solver.steps import BUDGET, DERIVATIVE

H = 5e-3
SEEDS = range(12)


def same(one, other):
    """Whether two compiled models are equal in all that is drawn."""
    names = (
        "body_pos",
        "body_mass",
        "geom_size",
        "jnt_axis",
        "dof_damping",
        "actuator_gainprm",
        "eq_data",
        "numeric_data",
    )
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_a_seed_is_a_scene():
    """Drawn twice it is the same, with sand and without; another seed gives another one."""
    first = articulated(3)
    articulated.cache_clear()
    again = articulated(3)
    assert same(first.bare(H), again.bare(H))
    assert same(first.sandy(H), again.sandy(H))
    assert np.array_equal(first.velocity, again.velocity)
    assert first.sand == again.sand
    assert first.bare(H).nbody != articulated(4).bare(H).nbody


def test_scenes_differ():
    """A hundred seeds have every kind of joint and geom, loops, tendons, both laws and slopes."""
    scenes = [articulated(seed) for seed in range(100)]
    models = [scene.spec.copy().compile() for scene in scenes]
    assert {kind for model in models for kind in model.jnt_type.tolist()} == set(range(4))
    assert {kind for model in models for kind in model.geom_type.tolist()} >= {2, 3, 4, 5, 6}
    assert {scene.law for scene in scenes} == {"rft3d", "drft3d"}
    assert {model.opt.integrator for model in models} == {0, 2, 3}
    for name in ("neq", "ntendon", "nu"):
        assert 0 < sum(getattr(model, name) > 0 for model in models) < 100
    assert any(scene.terrain.normal[2] < 1.0 for scene in scenes)
    assert min(model.body_mass[1:].min() for model in models) >= 0.01


@pytest.mark.parametrize("seed", SEEDS)
def test_sand_loses_no_scene(seed):
    """What MuJoCo steps without sand it steps with it, and nothing is left that is no number."""
    scene = articulated(seed)
    model = scene.sandy(H)
    data = scene.start(model)
    for _ in range(round(1.0 / H)):
        scene.move(data)
        mujoco.mj_step(model, data)
    assert scene.lost(H, 1.0) or not is_lost(data)
    assert np.isfinite(data.qpos).all()
    assert np.isfinite(rftsim.wrenches(model, data).force).all()


def test_few_equations_are_left_unsolved():
    """Of 40 scenes drawn at random, at 5 ms: at most one equation in 100 steps, and 3 evaluations a step."""
    unsolved = evaluations = 0
    for seed in range(40):
        scene = articulated(seed)
        model = scene.sandy(H)
        data = scene.start(model)
        for _ in range(100):
            scene.move(data)
            mujoco.mj_step(model, data)
        spent = rftsim.work(model, data)
        unsolved, evaluations = unsolved + spent.unsolved, evaluations + spent.evaluations
    assert unsolved <= 40
    assert evaluations <= 3.0 * 40 * 100


def test_where_a_scene_falls_apart_without_sand():
    """What MuJoCo loses without sand it loses from its first state; what it does not, from none of two."""
    h, kinds = 2e-2, set()
    for seed in range(12):
        scene = articulated(seed)
        model = scene.bare(h)
        data = scene.start(model)
        states = [state_of(model, data)]
        scene.move(data)
        mujoco.mj_step(model, data)
        states.append(state_of(model, data))
        is_lost_bare = scene.lost(h, 1.0)
        kinds.add(is_lost_bare)
        assert (scene.lost_from(h, states[:1], 1.0) == (0.0, 1.0)) == is_lost_bare
        if not is_lost_bare:
            assert scene.lost_from(h, states, 1.0 - h) is None
    assert kinds == {True, False}


def test_a_solution_that_is_none_does_no_work():
    """In this scene some steps' solutions come to none: their force is let go, and not only shrunk."""
    scene = articulated(252)
    model = scene.sandy(1e-2)
    data, meter, let_go, unsolved = scene.start(model), Meter(), 0, 0
    for _ in range(60):
        scene.move(data)
        meter.advance(model, data)
        before, unsolved = unsolved, rftsim.work(model, data).unsolved
        let_go += unsolved > before and not rftsim.wrenches(model, data).force.any()
    assert let_go > 0
    assert meter.effort().gain < 1e-6


def test_light_feet_are_not_let_go():
    """On legs of 10 g links, steps that are not solved still have a force of the sand, and one that throws nothing.

    What was linear there was a solution of 1e8 to 1e27 times the velocity, for rows hold against any force: it was let
    go, or MuJoCo lost the simulation.
    """
    trial = hard_cases.legs(H, "implicit")
    model, data, let_go, peak = trial.model, trial.data, 0, 0.0
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    for seed in (147, 349, 769, 790, 806, 818):
        mujoco.mj_resetData(model, data)
        move, unsolved = hard_cases.start_at_random(trial, seed), 0
        for _ in range(round(1.0 / H)):
            move(data)
            mujoco.mj_step(model, data)
            before, unsolved = unsolved, rftsim.work(model, data).unsolved
            let_go += unsolved > before and not rftsim.wrenches(model, data).force.any()
            peak = max(peak, data.energy[1])
        assert not is_lost(data)
    assert let_go <= 2  # 9 before
    assert peak < 15.0  # J; they move with up to 11 J


def test_the_meter_counts_what_work_counts():
    """Step by step, the meter adds up to the totals; its sand has done work against the motion."""
    scene, meter = articulated(3), Meter()
    model = scene.sandy(H)
    data = scene.start(model)
    meter.advance(model, data, nstep=40)
    effort, spent = meter.effort(), rftsim.work(model, data)
    assert (effort.steps, effort.evaluations, effort.derivatives) == (40, spent.evaluations, spent.derivatives)
    worth = effort.evaluations + DERIVATIVE * effort.derivatives
    assert worth / 40 <= effort.worst <= worth + 1.0 + DERIVATIVE  # the totals are cut to whole numbers
    assert effort.gain < 1e-3
    assert not effort.lost


def test_the_meter_stops_where_a_simulation_is_lost():
    """A velocity that is no number ends it; the step is not counted."""
    scene, meter = articulated(3), Meter()
    model = scene.sandy(H)
    data = scene.start(model)
    meter.advance(model, data, nstep=3)
    data.qvel[0] = np.nan
    meter.advance(model, data, nstep=3)
    assert (meter.effort().steps, meter.effort().lost) == (3, True)


def test_the_study_is_remembered(tmp_path):
    """A second run measures nothing; the worst are listed once each; what is lost bare does not count as lost."""
    names, calls = ("a", "b"), []

    def measure(name, h):
        calls.append(name)
        return Effort(10, 20, 5, 7 if name == "a" else 9, 1, 0.1, 0.2, name == "b", name == "b")

    for _ in range(2):
        played = solver.Study(tmp_path / "solver.json").play(
            solver.Group("made up", names, measure), (1e-3, 5e-3), lambda _: None
        )
    assert len(calls) == 4
    first, second = solver.summarise(played)
    assert (first.h, second.h, first.evaluations, first.worst, first.unsolved) == (1e-3, 5e-3, 2.0, 9, 0.1)
    assert (first.lost, first.lost_bare) == (0, 1)
    assert solver.lost(played) == []
    assert [one.member for one in solver.hardest(played, lambda effort: effort.worst)] == ["b", "a"]


def test_the_study_tells_where_a_scene_is_lost_bare(tmp_path):
    """What a scene that is lost on sand alone had come to is remembered, and told in the line of what is lost."""
    effort = Effort(10, 20, 5, 7, 1, 0.1, 0.2, True, False, (0.25, 0.5))
    group = solver.Group("made up", ("a",), lambda name, h: effort)
    for _ in range(2):
        played = solver.Study(tmp_path / "solver.json").play(group, (1e-2,), lambda _: None)
        (one,) = solver.lost(played)
        assert tuple(one.effort.bare_from) == (0.25, 0.5)
    assert fate(one) == "a at 10 ms (without sand as well from 0.25 s on, with 0.5 of the kinetic energy of its start)"


def test_hard_scenes_are_solved():
    """Of four scenes that are hard to solve, less than a tenth of the steps stay unsolved.

    Three quarters do where secants are not followed with extrapolation, and what was found late in a step not kept.
    """
    group = solver.scenes(solver.SCENES)
    played = [solver.Played(group.name, seed, H, group.measure(seed, H)) for seed in ("62", "175", "198", "242")]
    (summary,) = solver.summarise(played)
    assert summary.unsolved < 0.1
    assert summary.worst <= 60


@pytest.mark.parametrize("h", [5e-3, 1e-2])
def test_no_step_costs_more_than_its_budget(h):
    """Of scenes with steps whose parts are not solved, none costs more than 60 evaluations' worth; one comes near."""
    group = solver.scenes(solver.SCENES)
    played = [solver.Played(group.name, seed, h, group.measure(seed, h)) for seed in ("13", "80", "147", "252")]
    (summary,) = solver.summarise(played)
    assert summary.unsolved > 0.0
    assert 50.0 < summary.worst <= BUDGET + 1e-9  # shares of an evaluation add up, rounded


@pytest.mark.slow
def test_random_scenes_are_cheap():
    """Of 300 scenes, sand loses none, and no step of any takes long."""
    group = solver.scenes(solver.SCENES)
    played = [solver.Played(group.name, seed, H, group.measure(seed, H)) for seed in group.members]
    (summary,) = solver.summarise(played)
    assert [one.member for one in solver.lost(played)] == []
    assert summary.worst <= 60, solver.hardest(played, lambda effort: effort.worst)
    assert summary.evaluations <= 3.0
    assert summary.unsolved <= 1e-4
