"""The example of docs/mjlab.md: Unitree's Go1 on sand in mjlab's velocity task, on Warp's CPU device."""

import mjlab_sand
import mujoco
import mujoco_warp
import pytest
import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.scripts import train
from mjlab.tasks.registry import load_env_cfg, load_rl_cfg

from rftsim.model.readout import instances

TASK = "Rftsim-Velocity-Sand-Unitree-Go1"
WORLDS = 4
STEPS = 50
"""Steps of the environment, of 20 ms, in which the robot comes to rest."""
FRICTION = 0.4
G = 9.81
mjlab_sand.register()
torch.set_num_threads(1)


def make_cfg():
    """The task with few worlds, and nobody who pushes the robot."""
    cfg = load_env_cfg(TASK)
    cfg.scene.num_envs, cfg.seed = WORLDS, 0
    del cfg.events["push_robot"]
    return cfg


def run(env, steps, swing=0.0, forwards=0):
    """The robot's positions after steps of random actions, (WORLDS, nq)."""
    draws = torch.Generator().manual_seed(1)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(swing * torch.randn(WORLDS, env.action_manager.total_action_dim, generator=draws))
        for _ in range(forwards):
            mujoco_warp.forward(env.sim.wp_model, env.sim.wp_data)
    return env.sim.data.qpos.clone()


@pytest.fixture(scope="module")
def env():
    return ManagerBasedRlEnv(make_cfg(), device="cpu")


@pytest.fixture(scope="module")
def laid(env):
    """The event that laid the sand of the environment."""
    return env.event_manager.get_term_cfg("sand").func


def test_sand_alone_carries_the_robot(env):
    """At rest the sand's vertical force is the weight."""
    run(env, STEPS)
    data = env.scene["feet_ground_contact"].data
    weight = G * env.sim.mj_model.body_mass.sum()
    assert (data.found == 1.0).all()
    assert data.force[..., 2].sum(dim=1).numpy() == pytest.approx(weight, rel=0.02)
    assert env.scene["robot"].data.root_link_pos_w[:, 2].min() > 0.15
    assert env.scene["robot"].data.root_link_vel_w.abs().max() < 0.01


def stand_on_cpu(env, laid, strength, start, steps):
    """Height of the trunk [m] after environment steps of MuJoCo with the engine plugin, in sand of a strength."""
    model, _ = mjlab_sand.with_sand(env.scene.spec, "medium-sand", "rft3d")
    env.cfg.sim.mujoco.apply(model)
    (bed,) = instances(model)
    bed.bed.xi_n, bed.bed.mu_surf = strength * laid.medium.xi_n, FRICTION
    data = mujoco.MjData(model)
    data.qpos, data.ctrl = start
    mujoco.mj_step(model, data, nstep=steps * env.cfg.decimation)
    return data.qpos[2]


def test_worlds_sink_by_their_own_sand(env, laid):
    """Each world's robot comes to stand where the engine plugin lets it in the same sand, within 5 mm."""
    env.reset(seed=0)
    strength = torch.tensor([0.25, 0.5, 0.75, 1.0])
    laid.xi_n[:] = laid.medium.xi_n * strength
    laid.mu_surf[:] = FRICTION
    start = env.sim.data.qpos.numpy().copy()
    for _ in range(STEPS):
        env.step(torch.zeros(WORLDS, env.action_manager.total_action_dim))
    height, ctrl = env.sim.data.qpos.numpy()[:, 2], env.sim.data.ctrl.numpy()
    for world in range(WORLDS):
        there = stand_on_cpu(env, laid, float(strength[world]), (start[world], ctrl[world]), STEPS)
        assert height[world] == pytest.approx(there, abs=0.005)


def test_each_reset_draws_another_sand_within_bounds(env, laid):
    env.reset(seed=0)
    before = laid.xi_n.clone(), laid.mu_surf.clone()
    assert len(before[0].unique()) == len(before[1].unique()) == WORLDS
    env.reset(env_ids=torch.tensor([2]))
    for now, then in zip((laid.xi_n, laid.mu_surf), before, strict=True):
        assert ((now != then) == torch.tensor([False, False, True, False])).all()
    assert ((laid.xi_n >= 0.5 * laid.medium.xi_n) & (laid.xi_n <= 2.0 * laid.medium.xi_n)).all()


def test_runs_of_mjlab_are_bit_identical(env):
    """Also that of another environment made anew."""
    first = run(env, 20, swing=0.5)
    assert torch.equal(first, run(env, 20, swing=0.5))
    assert torch.equal(first, run(ManagerBasedRlEnv(make_cfg(), device="cpu"), 20, swing=0.5))


def test_forward_between_steps_is_no_step(env):
    """The positions do not depend on how often forward is called: mjlab calls it once an environment step."""
    assert torch.equal(run(env, 20, swing=0.5), run(env, 20, swing=0.5, forwards=2))


def test_mjlab_trains_on_sand(tmp_path):
    """A policy comes out of mjlab's own command."""
    agent = load_rl_cfg(TASK)
    agent.logger, agent.max_iterations = "tensorboard", 1
    agent.actor.hidden_dims = agent.critic.hidden_dims = (16,)
    train.run_train(TASK, train.TrainConfig(make_cfg(), agent, gpu_ids=None), tmp_path / "run")
    assert list(tmp_path.glob("run/model_*.pt"))
