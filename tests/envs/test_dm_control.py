"""dm_control: the suite's contract over every task, what the tasks speak of, and the arena for composer."""

import copy
import pickle

import mujoco
import numpy as np
import pytest

pytest.importorskip("dm_control")

from dm_control import composer, mjcf
from dm_control.entities.props.primitive import Primitive
from dm_control.locomotion.tasks.go_to_target import GoToTarget
from dm_control.locomotion.walkers.ant import Ant
from dm_control.rl.control import PhysicsError
from rftsim_envs import dm
from rftsim_models.wheels import GROUSER_WHEEL

import rftsim
from rftsim.run.run import run
from rftsim.run.scenes import stage

tasks = pytest.mark.parametrize(("domain", "task"), dm.ALL_TASKS)


def episode(env, actions):
    """Observations and rewards of an episode, as one array per step."""
    steps = [env.reset(), *(env.step(action) for action in actions)]
    return np.array([[*np.concatenate(list(step.observation.values())), step.reward or 0.0] for step in steps])


def some_actions(env, n=50):
    spec = env.action_spec()
    return np.random.RandomState(0).uniform(spec.minimum, spec.maximum, (n, *spec.shape))


@tasks
def test_the_contract_of_a_task(domain, task):
    env = dm.load(domain, task, {"random": 1})
    env.action_spec().validate(some_actions(env)[0])
    step = env.reset()
    assert step.first()
    for action in some_actions(env):
        step = env.step(action)
        assert 0.0 <= step.reward <= 1.0
        assert step.discount == 1.0
        for name, spec in env.observation_spec().items():
            spec.validate(step.observation[name])
            assert np.isfinite(step.observation[name]).all()


@tasks
@pytest.mark.parametrize("random_sand", [False, True])
def test_a_seed_gives_one_episode(domain, task, random_sand):
    first, again, other = (dm.load(domain, task, {"random": seed, "random_sand": random_sand}) for seed in (1, 1, 2))
    actions = some_actions(first, 10)
    for _ in range(2):
        seen = episode(first, actions)
        np.testing.assert_array_equal(seen, episode(again, actions))
    assert np.abs(seen - episode(other, actions)).max() > 0.01


@tasks
def test_observations_are_the_physical_quantities(domain, task):
    env = dm.load(domain, task, {"random": 1})
    seen = [env.step(action) for action in some_actions(env)][-1].observation
    p, wheel = env.physics, env.physics.model.name2id("wheel", "body")
    sand = rftsim.wrenches(p.model.ptr, p.data.ptr)
    np.testing.assert_array_equal(seen["sand_force"], sand.force[wheel])
    assert np.linalg.norm(sand.force[wheel]) > 1.0
    x, z, angle = p.data.qvel
    np.testing.assert_array_equal(seen["velocity"], [x, z, angle])
    np.testing.assert_allclose(seen["phase"], [np.cos(p.data.qpos[2]), np.sin(p.data.qpos[2])])
    assert seen["sinkage"] == p.radius() - p.data.xpos[wheel, 2] > 0.0
    assert seen["slip"] == pytest.approx(1 - x / (p.radius() * angle) if x < p.radius() * angle else p.slip())
    assert p.sand_power() == sand.power.sum() < 0.0


def test_slip_has_its_sign_and_stays_in_bounds():
    p = dm.load("grouser_wheel", "follow").physics
    for speed, rim, slip in ((1, 1, 0), (1, 2, 0.5), (2, 1, -0.5), (-1, -2, 0.5), (0, 1, 1), (1, 0, -1), (0, 0, 0)):
        p.data.qvel[:] = speed, 0.0, rim / p.radius()
        assert p.slip() == pytest.approx(slip, abs=1e-12)
    p.data.qvel[:] = -1.0, 0.0, 2.0 / p.radius()
    assert p.slip() == 1.0


@pytest.mark.parametrize(
    ("domain", "scene"), [("grouser_wheel", "grouser-wheel"), ("four_flap_runner", "four-flap-runner")]
)
def test_a_steady_rate_slips_as_in_the_scene(domain, scene):
    (name,) = (task for group, task in dm.ALL_TASKS if group == domain)
    env = dm.load(domain, name, {"random": 1})
    env.reset()
    rate = 2 * np.pi
    for _ in range(200):
        env.step([rate])
    start = float(env.physics.named.data.qpos["x"][0])
    for _ in range(100):
        env.step([rate])
    slip = 1 - (env.physics.named.data.qpos["x"][0] - start) / (2.0 * env.physics.radius() * rate)
    there = run(stage(scene, settings={"rpm": "60"}, timestep=env.physics.timestep(), duration=5.0)).steady.slip
    assert slip == pytest.approx(there, abs=0.01 * (1 - there))


def test_rewards_are_the_gymnasium_tasks_within_0_and_1():
    """By hand, of speed v, command c, rim R w, power P of drive and push, and weight m g, as the tables say."""
    rewards = {"follow": [], "run": []}
    for domain, task in dm.ALL_TASKS:
        env = dm.load(domain, task, {"random": 1, "random_sand": True})
        env.reset()
        for action in some_actions(env, 20):
            reward = env.step(action).reward
            p = env.physics
            weight = float(p.model.body_mass.sum()) * 9.8 if task == "run" else GROUSER_WHEEL.vertical_mass * 9.8
            power = max(p.power(), 0.0) + max(p.data.ctrl[1] * p.speed(), 0.0)
            unit = np.sqrt(9.8 * 2 * p.radius())
            expected = p.speed() / unit - (power / (weight * unit)) ** 2
            if task == "follow":
                slip = (p.radius() * p.rate() - p.speed()) / 0.5
                near = np.exp(-abs(p.speed() - env.task.commanded_speed) / 0.15)
                expected = near - 0.1 * slip**2 - 0.2 * power / (weight * 0.5)
            assert reward == pytest.approx(min(max(expected, 0.0), 1.0), rel=1e-6, abs=1e-9)
            rewards[task].append(reward)
    assert min(np.ptp(found) for found in rewards.values()) > 0.1


def test_drive_and_push_pay_for_the_sand():
    """At a steady rate nothing is stored: drive + push + sand = 0 in the mean."""
    env = dm.load("grouser_wheel", "follow", {"random": 1})
    env.reset()
    for _ in range(100):
        env.step([2 * np.pi])
    p, powers = env.physics, []
    for _ in range(1000):  # a turn
        p.step()
        powers.append((p.power(), GROUSER_WHEEL.forward_force * p.speed(), p.sand_power()))
    drive, push, sand = np.mean(powers, axis=0)
    assert drive + push == pytest.approx(-sand, rel=0.02)


@pytest.mark.parametrize("legacy_step", [True, False])
def test_a_control_step_is_mujocos(legacy_step):
    env = dm.load("four_flap_runner", "run", {"random": 1}, {"legacy_step": legacy_step})
    env.reset()
    model, data = env.physics.model.ptr, copy.copy(env.physics.data.ptr)
    for action in some_actions(env, 10):
        env.step(action)
        data.ctrl[0] = action[0]
        mujoco.mj_step(model, data, 20)
        np.testing.assert_array_equal(env.physics.data.qvel, data.qvel)


def test_copies_pickles_and_reloads_go_on_alike():
    env = dm.load("grouser_wheel", "follow", {"random": 1})
    episode(env, some_actions(env))
    physics = [env.physics, env.physics.copy(), pickle.loads(pickle.dumps(env.physics))]
    for one in physics:
        one.step(20)
        np.testing.assert_array_equal(one.sand_force(), physics[0].sand_force())
    assert physics[0].sand_force()[2] > 1.0
    physics[1]._reload_from_model(physics[0].model)
    assert physics[1].time() == 0.0
    physics[1].step(200)
    assert physics[1].sand_force()[2] > 1.0


def test_random_sand_is_drawn_within_its_range():
    from rftsim_envs.dm.wheel import STRENGTH

    env = dm.load("grouser_wheel", "follow", {"random": 1, "random_sand": True})
    (bed,) = rftsim.instances(env.physics.model.ptr)
    own, drawn = rftsim.make_sand("poppy-seeds"), []
    for _ in range(20):
        env.reset()
        drawn.append(bed.bed.xi_n / own.xi_n)
    assert STRENGTH[0] <= min(drawn) < 0.8 < 1.3 < max(drawn) <= STRENGTH[1]


@pytest.mark.parametrize("broken", ["action", "state"])
def test_what_diverges_is_said(broken):
    env = dm.load("four_flap_runner", "run", {"random": 1})
    env.reset()
    if broken == "state":
        env.physics.data.qvel[0] = 1e12
    with pytest.raises(PhysicsError):
        env.step([np.nan if broken == "action" else 1.0])
    assert env.reset().first()


def test_what_does_not_exist_is_answered_with_what_does():
    with pytest.raises(ValueError, match="four_flap_runner, grouser_wheel"):
        dm.load("grouser", "follow")
    with pytest.raises(ValueError, match="tasks are follow"):
        dm.load("grouser_wheel", "run")


def test_the_reward_shows_in_the_wheels_colour():
    env = dm.load("grouser_wheel", "follow", {"random": 1}, visualize_reward=True)
    env.reset()
    pictures = [env.physics.render(60, 80, camera_id="side").astype(float)]
    env.physics.named.data.qvel["x"] = env.task.commanded_speed
    env.task.after_step(env.physics)
    pictures.append(env.physics.render(60, 80, camera_id="side").astype(float))
    assert pictures[0].std() > 10.0
    assert np.abs(pictures[1] - pictures[0]).max() > 20.0


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
