"""Gymnasium's own MuJoCo environments on sand: their contract is as it was, and the sand carries them."""

import copy
import pickle
import warnings

import gymnasium as gym
import mujoco
import numpy as np
import pytest

pytest.importorskip("imageio")  # which gymnasium's MuJoCo environments need

import rftsim_envs
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AsyncVectorEnv

import rftsim

LEGGED = ("Ant-v5", "Hopper-v5", "Walker2d-v5", "Humanoid-v5", "HalfCheetah-v5")
ON_SAND = "rftsim_envs:rftsim/OnSand-v0"

pytestmark = pytest.mark.filterwarnings("ignore:.*settotalmass.*deprecated")


def own(env_id, **options):
    """Gymnasium's environment, without a word about newer versions of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return gym.make(env_id, **options)


def random_steps(env, n, seed=3):
    env.reset(seed=seed)
    env.action_space.seed(seed)
    return [env.step(env.action_space.sample()) for _ in range(n)]


def check_like_gymnasiums(env_id, **options):
    """Spaces, wrappers, information and rewards of one of gymnasium's environments are its own on sand, too."""
    sandy, rigid = rftsim_envs.on_sand(env_id, **options), own(env_id)
    assert (sandy.observation_space, sandy.action_space) == (rigid.observation_space, rigid.action_space)
    assert sandy.spec.max_episode_steps == rigid.spec.max_episode_steps
    assert str(sandy).count("<") == str(rigid).count("<")
    assert isinstance(sandy.unwrapped, type(rigid.unwrapped))
    assert sandy.unwrapped.dt == rigid.unwrapped.dt
    for one, other in zip(random_steps(sandy, 10), random_steps(rigid, 10), strict=True):
        assert one[0] in sandy.observation_space
        assert np.isfinite(one[0]).all()
        assert one[4].keys() == other[4].keys()
        terms = {name: value for name, value in one[4].items() if name.startswith("reward_")}
        if len(terms) > 1 and "Standup" not in env_id:
            assert one[1] == pytest.approx(sum(terms.values()))
    assert rftsim.instances(sandy.unwrapped.model)[0].bodies


@pytest.mark.parametrize("env_id", [*LEGGED, "Ant-v4"])
def test_the_contract_is_gymnasiums(env_id):
    check_like_gymnasiums(env_id)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*gravity is 0")
def test_the_contract_of_all_is_gymnasiums():
    ids = [name for name, spec in gym.registry.items() if str(spec.entry_point).startswith("gymnasium.envs.mujoco")]
    assert len(ids) >= 20
    for env_id in ids:
        if env_id != "Pusher-v4":  # which runs on MuJoCo 2 alone
            check_like_gymnasiums(env_id)


def test_the_sand_carries_an_ant_that_stands():
    """It comes to rest within three seconds, at steps of 10 ms, and no coordinate of it changes from then on.

    What is left of its speeds is of the size of v_c, at least 1e-5 m/s, below which a triangle's stress falls to zero.
    """
    env = rftsim_envs.on_sand("Ant-v5", reset_noise_scale=0.0)
    env.reset(seed=0)
    model, data = env.unwrapped.model, env.unwrapped.data
    while data.time < 4.0:
        if data.time < 3.0:
            start = data.qpos.copy()
        _, _, terminated, _, info = env.step(np.zeros(8))
        assert not terminated
    weight = model.body_mass.sum() * 9.81
    assert rftsim.wrenches(model, data).force.sum(0)[2] == pytest.approx(weight, rel=0.01)
    assert data.ncon == 0
    assert np.abs(data.qpos - start).max() < 1e-6
    assert np.abs(data.qvel).max() < 3e-5
    assert info["reward_survive"] == 1.0


def test_contact_forces_are_the_sands():
    """They are Ant's observation and cost: bodies in the sand have them, and together they carry the weight."""
    env = rftsim_envs.on_sand("Ant-v5", reset_noise_scale=0.0)
    env.reset(seed=0)
    model, data = env.unwrapped.model, env.unwrapped.data
    for _ in range(30):
        observation, _, _, _, info = env.step(np.zeros(8))
    assert data.ncon == 0
    sand = rftsim.wrenches(model, data).force
    np.testing.assert_allclose(data.cfrc_ext[:, 3:], sand, atol=1e-9)
    assert np.count_nonzero(np.abs(sand).max(axis=1) > 0.1) == 4
    seen = observation[-6 * (model.nbody - 1) :].reshape(-1, 6)
    np.testing.assert_allclose(seen[:, 3:], np.clip(sand[1:], -1.0, 1.0), atol=1e-9)
    assert info["reward_contact"] < 0.0


def test_options_of_the_implicit_force_are_passed_on():
    env = rftsim_envs.on_sand("Hopper-v5", tolerance=1e-4, iterations=40)
    bed = rftsim.instances(env.unwrapped.model)[0].bed
    assert (bed.tolerance, bed.iterations) == (1e-4, 40)
    with pytest.raises(rftsim.SceneError, match="reduction=0 keeps every triangle"):
        rftsim_envs.on_sand("Hopper-v5", tolerance=0.0)


def test_floors_can_stay():
    env = rftsim_envs.on_sand("Hopper-v5", terrain=-1.0, keep_floor=True, reduction=0.0, reset_noise_scale=0.0)
    random_steps(env, 20)
    assert env.unwrapped.data.ncon > 0


def test_pictures_have_the_size_that_is_asked_for():
    env = rftsim_envs.on_sand("Hopper-v5", render_mode="rgb_array", width=800, height=600)
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (600, 800, 3)
    assert picture.std() > 5.0
    env.close()
    listed = rftsim_envs.on_sand("Hopper-v5", render_mode="rgb_array_list")
    random_steps(listed, 2)
    assert [one.shape for one in listed.render()] == [(480, 480, 3)] * 3
    listed.close()


def test_what_was_made_can_be_made_again():
    env = rftsim_envs.on_sand("Hopper-v5", rftsim.make_sand("medium-sand"), "rft3d:c4", frame_skip=8, max_edge=0.1)
    expected = random_steps(env, 5)
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), gym.make(env.spec)]
    others.append(gym.make(ON_SAND, **env.spec.kwargs))
    for other in others:
        assert data_equivalence(random_steps(other, 5), expected)
        assert other.spec.kwargs == env.spec.kwargs
        assert other.spec.max_episode_steps == 1000
        assert str(other) == str(env)
    model = others[0].unwrapped.model
    assert model.nnumeric == env.unwrapped.model.nnumeric
    assert rftsim.instances(model)[0].bed.xi_n == rftsim.make_sand("medium-sand").xi_n


@pytest.mark.parametrize("make", [rftsim_envs.on_sand, lambda env_id, **more: gym.make(ON_SAND, env_id=env_id, **more)])
def test_the_limit_of_time_is_as_gymnasium_has_it(make):
    assert make("Hopper-v5").spec.max_episode_steps == 1000
    env = make("Hopper-v5", max_episode_steps=3, terminate_when_unhealthy=False)
    assert [step[3] for step in random_steps(env, 3)] == [False, False, True]


@pytest.mark.parametrize(
    ("mode", "vector"), [("sync", {}), ("async", {"context": "fork"}), ("async", {"context": "spawn"})]
)
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_one_line_makes_many(mode, vector):
    envs = gym.make_vec(
        ON_SAND, num_envs=2, vectorization_mode=mode, vector_kwargs=vector, env_id="Ant-v5", max_edge=0.1
    )
    try:
        assert isinstance(envs, AsyncVectorEnv) == (mode == "async")
        first, _ = envs.reset(seed=0)
        action = np.full((2, 8), 0.3, np.float32)
        steps = [envs.step(action) for _ in range(3)]
        single = rftsim_envs.on_sand("Ant-v5", max_edge=0.1)
        np.testing.assert_array_equal(single.reset(seed=1)[0], first[1])
        for step in steps:
            np.testing.assert_array_equal(single.step(action[1])[0], step[0][1])
    finally:
        envs.close()


def test_what_cannot_be_is_said_in_a_line():
    with pytest.raises(rftsim.SceneError, match="CartPole-v1 is no MuJoCo environment of gymnasium: CartPoleEnv is no"):
        rftsim_envs.on_sand("CartPole-v1")
    with pytest.raises(gym.error.UnregisteredEnv, match="Ent"):
        rftsim_envs.on_sand("Ent-v5")
    with pytest.raises(TypeError, match="tolernace"):
        rftsim_envs.on_sand("Ant-v5", tolernace=0.01)
    with pytest.raises(rftsim.SandError, match="no sand 'snow'"):
        rftsim_envs.on_sand("Ant-v5", "snow")


def test_models_that_are_made_otherwise_are_refused():
    from gymnasium.envs.mujoco.hopper_v5 import HopperEnv

    class Own(HopperEnv):
        def _initialize_simulation(self):
            return super()._initialize_simulation()

    gym.register("OwnHopper-v0", Own)
    try:
        with pytest.raises(rftsim.SceneError, match="OwnHopper-v0 makes its model in its own way"):
            rftsim_envs.on_sand("OwnHopper-v0")
    finally:
        del gym.registry["OwnHopper-v0"]


@pytest.mark.filterwarnings("ignore:.*Box observation space (min|max)imum value is -?infinity")
def test_gymnasium_finds_nothing_to_complain_of():
    check_env(rftsim_envs.on_sand("Hopper-v5").unwrapped, skip_render_check=True)


@pytest.mark.filterwarnings("ignore:.*We recommend you to use a symmetric and normalized Box action space")
@pytest.mark.parametrize("env_id", LEGGED)
def test_sb3_finds_nothing_to_complain_of(env_id):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(rftsim_envs.on_sand(env_id).unwrapped)


def test_an_explicit_force_leaves_the_integrator():
    integrators = [
        rftsim_envs.on_sand("Hopper-v5", force=force).unwrapped.model.opt.integrator
        for force in ("implicit", "explicit")
    ]
    assert integrators == [mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtIntegrator.mjINT_RK4]
