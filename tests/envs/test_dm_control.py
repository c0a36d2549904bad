"""dm_control: every task as its environment, equal to Gymnasium's, and the arena for composer."""

import copy
import pickle
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest
import rftsim_envs

pytest.importorskip("dm_control")

from dm_control import composer, mjcf
from dm_control.entities.props.primitive import Primitive
from dm_control.locomotion.tasks.go_to_target import GoToTarget
from dm_control.locomotion.walkers.ant import Ant
from rftsim_envs import TASKS, SandEnv, dm

import rftsim

NAMES = (*TASKS, "Locomotion")
ANT = Path(gymnasium.__file__).parent / "envs/mujoco/assets/ant.xml"
tasks = pytest.mark.parametrize("name", NAMES)


def settings_of(name):
    return {"model": str(ANT)} if name == "Locomotion" else {}


def some_actions(env, n=50):
    spec = env.action_spec()
    return np.random.RandomState(0).uniform(spec.minimum, spec.maximum, (n, *spec.shape))


def episode(env, actions):
    """Observations and rewards of an episode, as one array per step."""
    steps = [env.reset(), *(env.step(action) for action in actions)]
    return np.array([[*step.observation["observations"], step.reward or 0.0] for step in steps])


@tasks
def test_the_contract_of_a_task(name):
    env = dm.load(name, random=1, **settings_of(name))
    env.action_spec().validate(some_actions(env)[0])
    step = env.reset()
    assert step.first()
    for action in some_actions(env):
        step = env.step(action)
        assert step.first() or np.isfinite(step.reward)
        for key, spec in env.observation_spec().items():
            spec.validate(step.observation[key])
            assert np.isfinite(step.observation[key]).all()


@tasks
def test_it_is_the_task_of_gymnasium(name):
    """Bit for bit, on ground that is drawn, from the same seed; and ends where that ends, with its discount."""
    settings = settings_of(name) | {"strength": (0.7, 1.5), "terrain": "dunes", "slope_deg": 0.0, "duration": 0.4}
    env, other = dm.load(name, random=3, **settings), SandEnv(name, **settings)
    step = env.reset()
    np.testing.assert_array_equal(step.observation["observations"], other.reset(seed=3)[0])
    ended = 0
    for action in some_actions(env, 45):
        step, (seen, reward, terminated, truncated, info) = env.step(action), other.step(action)
        np.testing.assert_array_equal(step.observation["observations"], seen)
        assert step.reward == reward
        assert step.last() == (terminated or truncated)
        assert step.discount == (0.0 if terminated else 1.0)
        assert {key: values[0] for key, values in env.task.outcome.info.items()} == info
        if step.last():
            ended += 1
            np.testing.assert_array_equal(env.reset().observation["observations"], other.reset()[0])
    assert ended >= 1


@tasks
def test_a_seed_gives_one_episode(name):
    settings = settings_of(name)
    first, again, other = (dm.load(name, random=seed, strength=(0.5, 2.0), **settings) for seed in (1, 1, 2))
    actions = some_actions(first, 10)
    for _ in range(2):
        seen = episode(first, actions)
        np.testing.assert_array_equal(seen, episode(again, actions))
    assert np.abs(seen - episode(other, actions)).max() > 1e-3


def test_a_generator_of_dm_controls_seeds():
    seen = [
        episode(dm.load("Rover", random=np.random.RandomState(seed)), np.zeros((3, 2))).tolist() for seed in (5, 5, 6)
    ]
    assert seen[0] == seen[1] != seen[2]


@pytest.mark.parametrize("legacy_step", [True, False])
def test_a_control_step_is_mujocos(legacy_step):
    """And what is drawn is where the step has led, not where its last time step began."""
    env = dm.load("FourFlapRunner", random=1, environment_kwargs={"legacy_step": legacy_step})
    env.reset()
    model, data = env.physics.model.ptr, copy.copy(env.physics.data.ptr)
    for action in some_actions(env, 10):
        env.step(action)
        data.ctrl[0] = 7.0 + 8.0 * action[0]
        mujoco.mj_step(model, data, 4)
        np.testing.assert_array_equal(env.physics.data.qvel, data.qvel)
        place = env.physics.data.xpos.copy()
        mujoco.mj_kinematics(model, data)
        np.testing.assert_array_equal(place, data.xpos)


def test_copies_pickles_and_reloads_go_on_alike():
    env = dm.load("GrouserWheel", random=1)
    episode(env, some_actions(env))
    wheel = env.physics.model.name2id("wheel", "body")
    physics = [env.physics, env.physics.copy(), pickle.loads(pickle.dumps(env.physics))]
    for one in physics:
        one.step(20)
        np.testing.assert_array_equal(one.data.qvel, physics[0].data.qvel)
    force = rftsim.wrenches(physics[1].model.ptr, physics[1].data.ptr).force[wheel]
    assert force[2] > 1.0
    physics[1]._reload_from_model(physics[0].model)
    assert physics[1].time() == 0.0
    physics[1].step(200)
    assert rftsim.wrenches(physics[1].model.ptr, physics[1].data.ptr).force[wheel, 2] > 1.0


def test_a_simulation_that_diverges_ends_its_episode():
    env = dm.load("FourFlapRunner", random=1)
    env.reset()
    env.physics.data.qvel[0] = 1e12
    step = env.step([1.0])
    assert (step.last(), step.reward, step.discount) == (True, 0.0, 0.0)
    assert env.reset().first()
    assert env.step([1.0]).discount == 1.0
    with pytest.raises(ValueError, match="finite and of shape"):
        env.step([np.nan])


def test_what_does_not_exist_is_answered_with_what_does():
    with pytest.raises(rftsim_envs.ConfigError, match="tasks are GrouserWheel"):
        dm.load("grouser")
    with pytest.raises(rftsim_envs.ConfigError, match="no setting 'random_sand'"):
        dm.load("GrouserWheel", random_sand=True)


def test_it_is_drawn():
    env = dm.load("GrouserWheel", random=1)
    env.reset()
    assert env.physics.render(60, 80, camera_id="follow").std() > 5.0


def test_the_arenas_sand_is_add_sands():
    arenas = dm.SandArena(sand="poppy-seeds", tolerance=1e-4, iterations=40), composer.Arena()
    for arena in arenas:
        ball = mjcf.RootElement(model="ball")
        ball.worldbody.add("geom", type="sphere", size=[0.05], mass=1.0)
        arena.add_free_entity(composer.ModelWrapperEntity(ball)).pos = [0.0, 0.0, 0.05]
    spec = mujoco.MjSpec.from_string(arenas[1].mjcf_model.to_xml_string())
    rftsim.add_sand(spec, "poppy-seeds", tolerance=1e-4, iterations=40)
    one, other = mjcf.Physics.from_mjcf_model(arenas[0].mjcf_model).model.ptr, spec.compile()
    np.testing.assert_array_equal(one.numeric_data, other.numeric_data)
    states = []
    for model in (one, other):
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 50)
        force = rftsim.wrenches(model, data).force[-1]
        states.append([*data.qpos, *force])
    np.testing.assert_array_equal(*states)
    assert np.linalg.norm(states[0][-3:]) > 1.0


def test_sand_carries_a_ball_at_rest():
    arena = dm.SandArena(sand="poppy-seeds")
    ball = Primitive(geom_type="sphere", size=[0.05], mass=1.0)  # has sensors that name its geom
    arena.add_free_entity(ball).pos = [0.0, 0.0, 0.05]
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    physics.step(1000)
    model, data = physics.model.ptr, physics.data.ptr
    assert np.abs(data.qvel).max() < 1e-6
    assert physics.data.ncon == 0
    np.testing.assert_allclose(rftsim.wrenches(model, data).force.sum(0), [0.0, 0.0, 9.81], atol=1e-3 * 9.81)


def test_a_walker_has_its_task_on_sand():
    walker, arena = Ant(), dm.SandArena(size=(2.0, 2.0))
    env = composer.Environment(GoToTarget(walker, arena), time_limit=0.5, random_state=1)
    sizes = set()
    for _ in range(3):
        step = env.reset()
        model, data = env.physics.model.ptr, copy.copy(env.physics.data.ptr)
        sizes.add((model.nplugin, model.nnumeric, model.nsensor, model.nsensordata))
        for action in some_actions(env, 10):
            step = env.step(action)
            data.ctrl[:] = env.physics.data.ctrl
            mujoco.mj_step(model, data, 5)
            np.testing.assert_allclose(env.physics.data.qpos, data.qpos, atol=1e-9)
        while not step.last():
            step = env.step(np.zeros(8))
        sand = rftsim.wrenches(model, env.physics.data.ptr).force
        assert sand[:, 2].sum() > 10.0
    assert len(sizes) == 1
    assert [len(bed.bodies) for bed in rftsim.instances(model)] == [13]
    assert env.physics.render(60, 80).std() > 5.0


def test_named_bodies_alone_feel_the_arenas_sand():
    arena = dm.SandArena(bodies="walker/torso", law="rft3d:c4", force="explicit", geoms="all", max_edge=0.2)
    arena.add_free_entity(Ant())
    model = mjcf.Physics.from_mjcf_model(arena.mjcf_model).model.ptr
    (bed,) = rftsim.instances(model)
    assert [model.body(body).name for body in bed.bodies] == ["walker/torso"]
    arena = dm.SandArena(bodies="walker/tail")
    arena.add_free_entity(Ant())
    with pytest.raises(rftsim.SceneError, match="no body 'walker/tail'"):
        arena.mjcf_model.to_xml_string()
