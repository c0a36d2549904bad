"""Every registered environment: Gymnasium's and SB3's contracts, seeds, copies, batches, bad actions, tables."""

import dataclasses
import pickle
import re
import warnings

import gymnasium as gym
import numpy as np
import pytest
import rftsim_envs
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rftsim_envs import IDS, TASKS, ConfigError, SandEnv, SandVectorEnv
from rftsim_envs.task import Config

from rftsim import instances
from rftsim.bench import environment

VARIED = {"strength": (0.7, 1.5), "friction": (0.8, 1.0), "slope_deg": 5.0}


@pytest.fixture(params=TASKS)
def task(request):
    return request.param


def actions(env, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, (n, *env.action_space.shape)).astype(np.float32)


@pytest.mark.parametrize("env_id", IDS)
def test_contract(env_id):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space (min|max)imum value is -?infinity.*")
        check_env(gym.make(env_id, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("env_id", IDS)
def test_contract_of_sb3(env_id):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(env_id).unwrapped)


@pytest.mark.parametrize("ground", ["sand", "rigid"])
def test_batch_equals_single(task, ground):
    """States and observations bit for bit, each simulation on ground of its own; and what is summed from them.

    (NumPy may add the terms of one row and of many in another order.)
    """
    settings = VARIED | {"ground": ground, "duration": 0.24, "observe_ground": True}
    many = SandVectorEnv(task, num_envs=3, threads=2, **settings)
    single = SyncVectorEnv([lambda: SandEnv(task, **settings)] * 3, autoreset_mode=AutoresetMode.SAME_STEP, copy=True)
    for one, other in zip(many.reset(seed=7), single.reset(seed=7), strict=True):
        assert_same(one, other)
    ended = 0
    for action in actions(many, 16):
        out, expected = many.step(action), single.step(action)
        ended += np.count_nonzero(out[2] | out[3])
        for one, other in zip(out, expected, strict=True):
            assert_same(one, other)
        for name in ("qpos", "qvel"):
            states = [env.unwrapped.physics.field(name)[0] for env in single.envs]
            np.testing.assert_array_equal(many.episodes.physics.field(name), states)
    assert ended >= 3


def assert_same(one, other):
    if not isinstance(one, dict):
        np.testing.assert_allclose(one, other, rtol=0.0 if one.dtype == np.float32 else 1e-12, atol=1e-15)
        return
    assert one.keys() == other.keys()
    for key in one:
        if key == "final_obs":
            for a, b in zip(one[key], other[key], strict=True):
                np.testing.assert_array_equal(a, b)
        else:
            assert_same(one[key], other[key])


def test_seeds_and_copies(task):
    """A seed decides everything; a pickled environment is the same environment."""
    env = SandEnv(task, **VARIED)
    copy, runs = pickle.loads(pickle.dumps(env)), []
    for one in (env, env, copy):
        first, info = one.reset(seed=3)
        runs.append([first, *(one.step(action)[0] for action in actions(env, 5))])
        assert 0.7 <= info["strength"] <= 1.5
        assert 0.0 <= info["slope_deg"] <= 5.0
    for other in runs[1:]:
        np.testing.assert_array_equal(runs[0], other)


def test_actions_are_clipped_or_refused(task):
    env, other = SandEnv(task), SandEnv(task)
    env.reset(seed=0), other.reset(seed=0)
    ones = np.ones(env.action_space.shape)
    np.testing.assert_array_equal(env.step(5.0 * ones)[0], other.step(ones)[0])
    for bad in (np.nan * ones, np.zeros(ones.size + 1)):
        with pytest.raises(ValueError, match="finite and of shape"):
            env.step(bad)


def test_divergence_ends_the_episode(task):
    """Where MuJoCo gives up, the episode ends without reward and says so; the next one is sound."""
    env = SandEnv(task)
    env.reset(seed=0)
    env.data.qvel[-1] = 1e12
    _, reward, terminated, _, info = env.step(np.zeros(env.action_space.shape))
    assert (reward, terminated, info["diverged"]) == (0.0, True, True)
    env.reset()
    *_, info = env.step(np.zeros(env.action_space.shape))
    assert not info["diverged"]


def test_tables_and_terms(task):
    """The observation's table adds up but for what is asked for, and the reward is the sum of the terms in info."""
    rows = re.findall(r"^\s*\|([^|\n]+)\|\s*(\d+)\s*\|[^|\n]+\|", TASKS[task].__doc__, re.MULTILINE)
    sizes = [size for name, size in rows if ", if " not in name]
    env, seeing = SandEnv(task), SandEnv(task, observe_ground=True)
    assert sum(map(int, sizes)) == env.observation_space.shape[0] == seeing.observation_space.shape[0] - 4
    env.reset(seed=0)
    _, reward, _, _, info = env.step(actions(env, 1)[0])
    assert reward == pytest.approx(sum(term for name, term in info.items() if name.startswith("reward/")))
    assert {"speed", "power", "cost_of_transport", "froude", "depth_ratio", "in_range"} <= info.keys()


def test_every_field_is_documented(task):
    """Config classes say what their own fields mean."""
    for kind in TASKS[task].Settings.__mro__[:-1]:
        own = [name for name in kind.__annotations__ if dataclasses.fields(kind)]
        base = [f.name for parent in kind.__mro__[1:-1] for f in dataclasses.fields(parent)]
        assert all(f"{name}:" in kind.__doc__ for name in own if name not in base)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"gravel": 1}, "no setting 'gravel'; it has ground"),
        ({"ground": "ice"}, "'sand' or 'rigid'"),
        ({"strength": (2, 1)}, "low to high"),
        ({"period": 0.013}, "multiple of timestep"),
        ({"slope_deg": 60}, "below 45"),
        ({"sand": "fudge"}, "no sand 'fudge'"),
        ({"duration": "long"}, "finite number"),
        ({"tolerance": 0}, "tolerance is that of the implicit force, 1e-06 to 0.1, not 0.0"),
        ({"tolerance": 0.2}, "not 0.2"),
        ({"iterations": 61}, "iterations must be a whole number from 1 to 60, not 61"),
        ({"iterations": 2.5}, "iterations must be a whole number, not 2.5"),
    ],
)
def test_wrong_settings(settings, words):
    with pytest.raises((ConfigError, ValueError), match=words):
        gym.make(IDS[0], **settings)


def test_the_solution_of_the_implicit_force(task):
    """Settings, as numbers or as text, reach the bed."""
    for settings, expected in ({}, (3e-2, 40)), ({"tolerance": "1e-4", "iterations": "40"}, (1e-4, 40)):
        (one,) = instances(SandEnv(task, **settings).unwrapped.model)
        assert (one.bed.tolerance, one.bed.iterations) == expected


def test_unknown_task():
    with pytest.raises(ConfigError, match="tasks are"):
        SandEnv("Unicycle")


def test_vector_entry_point():
    envs = gym.make_vec(IDS[0], num_envs=4, vectorization_mode="vector_entry_point", strength=(0.5, 2.0))
    assert isinstance(envs.unwrapped, SandVectorEnv)
    _, info = envs.reset(seed=0)
    assert len(set(info["strength"])) == 4


def test_picture_shows_the_sand(task):
    """The sand's colour is in the picture, below the robot."""
    env = SandEnv(task, render_mode="rgb_array", width=160, height=120)
    env.reset(seed=0)
    picture = env.render().astype(int)
    env.close()
    red, green, blue = np.moveaxis(picture[90:], -1, 0)
    assert np.mean((red > green) & (green > blue)) > 0.3


@pytest.mark.slow
def test_a_thousand_random_episodes():
    """Of 2 s: none diverges, none is reset behind one's back: time only grows within an episode."""
    for task in TASKS:
        envs = SandVectorEnv(task, num_envs=32, duration=2.0, **VARIED)
        envs.reset(seed=0)
        rng, ended = np.random.default_rng(0), 0
        clock = envs.episodes.physics.field("time").copy()
        while ended < 1000 // len(TASKS) + 1:
            observation, reward, terminated, truncated, info = envs.step(
                rng.uniform(-1.0, 1.0, envs.action_space.shape)
            )
            done = terminated | truncated
            ended += np.count_nonzero(done)
            now = envs.episodes.physics.field("time")
            assert np.isfinite(observation).all()
            assert np.isfinite(reward).all()
            for told in (info, info.get("final_info", {})):
                assert not np.any(told.get("diverged", False))
            assert (done | (now > clock)).all()
            clock = now.copy()


def test_ids():
    assert tuple(f"rftsim/{name}-v0" for name in TASKS) == rftsim_envs.IDS


def test_environments_train_with_the_tolerance_that_is_timed():
    """What `rftsim bench environment` calls training is what an environment does unless told otherwise."""
    assert Config().tolerance == environment.TRAINING
