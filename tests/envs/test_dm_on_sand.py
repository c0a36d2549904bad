"""dm_control's own suite on sand: its specifications, starts and rewards, and what the sand carries."""

import copy
import pickle
import threading

import numpy as np
import pytest

pytest.importorskip("dm_control")

from dm_control import suite
from dm_control.suite import walker
from rftsim_envs import dm
from rftsim_envs.dm import suite_on_sand
from rftsim_envs.sandy_floor import Recipe

import rftsim

COARSE = {"max_edge": 0.2}
"""Options that make bodies of few triangles."""

pytestmark = pytest.mark.filterwarnings("ignore:.*(DISPLAY|settotalmass)")


def steps(env, n):
    spec, random = env.action_spec(), np.random.RandomState(0)
    low, high = np.maximum(spec.minimum, -1.0), np.minimum(spec.maximum, 1.0)
    return [env.reset(), *(env.step(random.uniform(low, high)) for _ in range(n))]


def check_like_the_suites(domain, task, **options):
    """Specifications and starts are the suite's own, and a step gives a finite reward and observation."""
    sandy = dm.on_sand(domain, task, task_kwargs={"random": 1}, **options)
    rigid = suite.load(domain, task, {"random": 1})
    assert sandy.observation_spec() == rigid.observation_spec()
    assert sandy.action_spec() == rigid.action_spec()
    assert type(sandy.task) is type(rigid.task)
    assert isinstance(sandy.physics, type(rigid.physics))
    starts = []
    for env in (sandy, rigid):
        env.reset()
        starts.append(env.physics.data.qpos.copy())
    if domain != "cheetah":  # which has settled on its ground
        np.testing.assert_array_equal(*starts)
    for step in steps(sandy, 3)[1:]:
        assert 0.0 <= step.reward <= 1.0
        for name, spec in sandy.observation_spec().items():
            spec.validate(step.observation[name])
            assert np.isfinite(step.observation[name]).all()
    assert rftsim.instances(sandy.physics.model.ptr)[0].bodies
    return sandy


@pytest.mark.parametrize(
    ("domain", "task"), [("quadruped", "run"), ("walker", "walk"), ("hopper", "hop"), ("cheetah", "run")]
)
def test_the_contract_is_the_suites(domain, task):
    check_like_the_suites(domain, task, **COARSE)


@pytest.mark.slow
@pytest.mark.parametrize(("domain", "task"), suite.ALL_TASKS)
def test_the_contract_of_all_is_the_suites(domain, task):
    check_like_the_suites(domain, task)


def test_the_sand_alone_carries_a_walker():
    """And so it does in copies and pickles, while an episode is prepared on a solid floor."""
    env = dm.on_sand("walker", "walk", task_kwargs={"random": 1}, **COARSE)
    env.reset()
    for _ in range(100):
        env.step(np.zeros(6))
    physics = env.physics
    model, data = physics.model.ptr, physics.data.ptr
    weight = model.body_mass.sum() * 9.81
    assert data.ncon == 0
    assert rftsim.wrenches(model, data).force[:, 2].sum() == pytest.approx(weight, rel=0.01)
    for again in (type(physics).copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))):
        other = again(physics)
        assert other.torso_height() == physics.torso_height()
        for one in (other, physics):
            one.step(3)
        np.testing.assert_array_equal(other.data.qpos, physics.data.qpos)
        with other.reset_context():
            other.data.qpos[:] = 0.0
            other.data.qpos[0] = -0.2  # the slide along z
            other.after_reset()
            assert other.data.ncon > 0
            other.step()
            assert other.data.ncon == 0
        assert other.data.ncon == 0


def test_height_fields_are_sand_as_each_episode_makes_them():
    """The sand's surface goes through the height field's points, and alone carries the quadruped on it."""
    env = dm.on_sand("quadruped", "escape", task_kwargs={"random": 1}, **COARSE)
    model, data = env.physics.model.ptr, env.physics.data.ptr
    field, geom = model.hfield("terrain"), model.geom("terrain")
    seen = []
    for _ in range(2):
        first = env.reset()
        heights = field.size[2] * field.data.reshape(201, 201) + geom.pos[2]
        along = np.linspace(-30.0, 30.0, 201)
        ground = rftsim.ground(model, data)
        np.testing.assert_allclose(ground.height_at(*np.meshgrid(along, along)), heights, atol=1e-6)
        seen.append((heights, first.observation["rangefinder"]))
    assert np.abs(seen[0][0] - seen[1][0]).max() > 0.1
    assert (seen[0][1] < 1.0).any()
    for _ in range(100):
        env.step(np.zeros(12))
    assert data.ncon == 0
    weight = model.body_mass.sum() * 9.81
    assert rftsim.wrenches(model, data).force[:, 2].sum() == pytest.approx(weight, rel=0.02)


def test_only_what_is_asked_for_has_sand():
    """Neither what is loaded later, nor what another thread loads meanwhile."""
    meanwhile = []
    with suite_on_sand._sandy(walker.Physics, Recipe("poppy-seeds", "rft3d", COARSE)):
        thread = threading.Thread(target=lambda: meanwhile.append(suite.load("walker", "walk")))
        thread.start()
        thread.join()
    for env in (*meanwhile, suite.load("walker", "walk")):
        assert type(env.physics) is walker.Physics
        assert env.physics.model.nplugin == 0


def test_options_of_the_implicit_force_are_passed_on():
    env = dm.on_sand("walker", "walk", tolerance=1e-4, iterations=40, **COARSE)
    bed = rftsim.instances(env.physics.model.ptr)[0].bed
    assert (bed.tolerance, bed.iterations) == (1e-4, 40)


def test_what_cannot_be_is_said_in_a_line():
    with pytest.raises(ValueError, match="no domain 'cat'; domains are acrobot"):
        dm.on_sand("cat", "walk")
    with pytest.raises(ValueError, match="'fly' does not exist"):
        dm.on_sand("walker", "fly")
    with pytest.raises(rftsim.SandError, match="no sand 'snow'"):
        dm.on_sand("walker", "walk", "snow")


def test_pictures_and_sensors_can_be_had():
    env = dm.on_sand("walker", "walk", sensors=True, visualize_reward=True, **COARSE)
    env.reset()
    assert env.physics.render(60, 80, camera_id="side").std() > 5.0
    assert env.physics.named.data.sensordata["left_foot_sand"].shape == (6,)
