"""Tasks in worlds of mujoco_warp, on Warp's CPU device, against the same tasks on MuJoCo's batch."""

from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from rftsim_envs import SandVectorEnv
from rftsim_envs.physics import Array
from rftsim_envs.recipe import Training, TrainingError
from rftsim_envs.task import ConfigError

from rftsim.errors import SceneError

N = 3
BATCH, WARP = "batch", "warp"
TASK = "rftsim/CLegHexapod-v0"
STEPS = 25


def _made(physics: str, **settings: object) -> gymnasium.vector.VectorEnv:
    given = {"strength": (0.5, 2.0), "friction": (0.7, 1.3), "slope_deg": 8.0} | settings
    return gymnasium.make_vec(TASK, N, vectorization_mode="vector_entry_point", physics=physics, **given)


def _steady(k: int) -> Array:
    """Actions that begin softly, the same in all simulations."""
    return np.full((N, 6), 0.3 * min(1.0, (k + 1) / 10))


def test_a_task_goes_on_warp_as_on_the_batch() -> None:
    """On three sands and slopes: observations at the start to 1e-6, returns of 0.5 s to 5 % of the largest."""
    returns, seen, grounds = {}, {}, {}
    for physics in (BATCH, WARP):
        envs = _made(physics)
        seen[physics], grounds[physics] = envs.reset(seed=3)
        returns[physics] = sum(envs.step(_steady(k))[1] for k in range(STEPS))
        speed = envs.episodes.physics.field("qvel")
    np.testing.assert_allclose(seen[WARP], seen[BATCH], atol=1e-6)
    for name in ("strength", "friction", "slope_deg"):
        np.testing.assert_array_equal(grounds[WARP][name], grounds[BATCH][name])
        assert np.ptp(grounds[WARP][name]) > 0.1
    np.testing.assert_allclose(returns[WARP], returns[BATCH], rtol=0.0, atol=0.05 * np.abs(returns[BATCH]).max())
    assert speed.dtype == np.float64
    assert np.ptp(speed[:, 0]) > 1e-2


def test_an_episode_that_begins_anew_leaves_the_others_alone() -> None:
    """World 0 goes the same way, bit for bit, whether others are restarted beside it or not; and one starts alike."""
    envs = _made(WARP)
    physics = envs.episodes.physics
    ways = []
    for restarts in (False, True):
        first, _ = envs.reset(seed=3)
        for k in range(STEPS):
            seen, *_ = envs.step(_steady(k))
            if restarts and k == 3:
                envs.episodes.restart([2], [gymnasium.utils.seeding.np_random(5)[0]])
                np.testing.assert_array_equal(envs.episodes.observation()[2], first[2])
        ways.append((physics.field("qpos")[0].copy(), seen[0].copy()))
    for once, again in zip(*ways, strict=True):
        np.testing.assert_array_equal(once, again)


def test_an_episode_knows_nothing_of_the_one_before() -> None:
    """With the same seed all simulations go the same way again, bit for bit, whatever they did before."""
    envs, ways = _made(WARP), []
    for _ in range(2):
        envs.reset(seed=3)
        ways.append([envs.step(_steady(k))[0] for k in range(STEPS)])
    np.testing.assert_array_equal(*ways)


def test_episodes_end_and_begin_within_a_step() -> None:
    """After the last step of 0.1 s each simulation is at its start again, on another ground, and its end is told."""
    envs = _made(WARP, duration=0.1)
    _, before = envs.reset(seed=0)
    clock = envs.episodes.physics.field("time")
    for k in range(5):
        seen, _, terminated, truncated, info = envs.step(_steady(k))
    assert truncated.all()
    assert not terminated.any()
    np.testing.assert_array_equal(clock, 0.0)
    assert (info["strength"] != before["strength"]).all()
    assert (np.abs(np.stack(info["final_obs"]) - seen).max(axis=1) > 1e-3).all()


def test_a_state_that_is_not_finite_ends_its_episode() -> None:
    """Not a number in one world: that episode ends, its observation is finite, and the others do not know."""
    envs = _made(WARP)
    envs.reset(seed=0)
    physics = envs.episodes.physics

    def spoil() -> None:
        physics.field("qvel")[1, 0] = np.nan

    physics.restart([1], spoil)
    assert physics.failed().tolist() == [False, True, False]
    _, reward, terminated, _, info = envs.step(_steady(0))
    assert terminated.tolist() == [False, True, False]
    assert np.isfinite(reward).all()
    assert np.isfinite(np.stack(info["final_obs"][1:2])).all()
    assert info["final_info"]["diverged"].tolist() == [False, True, False]
    assert not physics.failed().any()


def test_a_rigid_floor_and_a_look_at_it() -> None:
    """The floor carries the hexapod, whose snapshot is MuJoCo's own data of the same state."""
    envs = _made(WARP, ground="rigid")
    envs.reset(seed=0)
    for _ in range(STEPS):
        envs.step(np.zeros((N, 6)))
    physics = envs.episodes.physics
    data = physics.snapshot(1)
    np.testing.assert_array_equal(data.qpos, physics.field("qpos")[1])
    np.testing.assert_array_equal(physics.shown.opt.gravity, physics.setting("opt.gravity")[1])
    assert data.time == pytest.approx(STEPS * 0.02)
    assert data.ncon > 0


def test_a_policy_is_trained_on_warp(tmp_path: Path) -> None:
    """PPO's two updates on Warp leave a folder that says so."""
    ppo = pytest.importorskip("rftsim_envs.training.ppo", reason="PPO is of the extra train", exc_type=ImportError)
    make_plan = pytest.importorskip("rftsim_envs.training.folder").make_plan
    changes = {"steps": 48, "n_envs": N, "n_steps": 8, "batch_size": 12, "n_epochs": 1, "physics": WARP}
    plan = make_plan(TASK, {}, changes)
    assert ppo.train(plan, tmp_path) == (48, 0, True)
    assert '"physics": "warp"' in (tmp_path / "config.json").read_text()


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: SandVectorEnv("CLegHexapod", 2, physics="abacus"), ConfigError, "batch, warp"),
        (lambda: SandVectorEnv("CLegHexapod", 2, physics=WARP, terrain="dunes"), SceneError, "plane without ruts"),
        (lambda: SandVectorEnv("CLegHexapod", 0, physics=WARP), ValueError, "at least 1"),
        (lambda: Training(physics="abacus"), TrainingError, "'batch' or 'warp'"),
    ],
)
def test_what_warp_does_not_know_is_refused(make: Callable[[], object], error: type[Exception], said: str) -> None:
    """What cannot be had is refused in one line that names what can."""
    with pytest.raises(error, match=said):
        make()
