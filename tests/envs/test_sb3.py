"""Simulations side by side for stable-baselines3: step by step its own batch of single ones, and faster."""

import time

import gymnasium as gym
import numpy as np
import pytest
from short_runs import SHORT, STEPS, TASK

pytest.importorskip("stable_baselines3")

from rftsim_envs.env import SandEnv
from rftsim_envs.sb3 import SandVecEnv
from rftsim_envs.training import ppo
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv


def test_side_by_side_is_one_by_one():
    def episodes(env):
        env.seed(3)
        actions = np.random.default_rng(0).uniform(-1.5, 1.5, (2 * STEPS + 5, 3, 1)).astype(np.float32)
        return [env.reset(), *(env.step(action.clip(-1, 1)) for action in actions)]

    one = DummyVecEnv([lambda: gym.make(f"rftsim/{TASK}-v0", max_episode_steps=None, **SHORT)] * 3)
    first, *steps = episodes(one)
    other_first, *other_steps = episodes(SandVecEnv(TASK, 3, **SHORT))
    np.testing.assert_array_equal(first, other_first)
    ended = 0
    for (seen, reward, done, infos), other in zip(steps, other_steps, strict=True):
        for mine, theirs in zip((seen, reward, done), other[:3], strict=True):
            np.testing.assert_array_equal(mine, theirs)
        for info, told in zip(infos, other[3], strict=True):
            assert ("terminal_observation" in info) == ("terminal_observation" in told)
            if "terminal_observation" in told:
                ended += 1
                np.testing.assert_array_equal(info["terminal_observation"], told["terminal_observation"])
                assert told["TimeLimit.truncated"] is info["TimeLimit.truncated"] is True
                assert told["episode"]["l"] == STEPS
    assert ended == 6
    rewards = np.sum([step[1] for step in steps[:STEPS]], axis=0)
    np.testing.assert_allclose([info["episode"]["r"] for info in other_steps[STEPS - 1][3]], rewards, rtol=1e-6)


@pytest.mark.slow
def test_throughput(capsys):
    """PPO on 64 simulations in a batch against 8 environments in a DummyVecEnv: three times is the aim."""
    rates = {}
    with ppo.torch_threads(ppo.THREADS):
        for name, env, n_steps in (
            ("batch", SandVecEnv("CLegHexapod", 64), 64),
            ("single", DummyVecEnv([lambda: SandEnv("CLegHexapod")] * 8), 512),
        ):
            model = PPO("MlpPolicy", env, n_steps=n_steps, batch_size=256, n_epochs=10, seed=0, device="cpu",
                        policy_kwargs={"net_arch": [128, 128], "log_std_init": -2.3})  # fmt: skip
            started = time.perf_counter()
            model.learn(8192)
            rates[name] = 8192 / (time.perf_counter() - started)
    with capsys.disabled():
        print({name: round(rate) for name, rate in rates.items()}, f"ratio {rates['batch'] / rates['single']:.2f}")
    assert rates["batch"] > 2.0 * rates["single"]
