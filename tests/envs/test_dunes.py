"""Dunes as the ground of every task: laws of seeds, batches, starts and scans; level ground is as it was."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rftsim_envs import IDS, TASKS, ConfigError, SandEnv, SandVectorEnv
from rftsim_envs.relief import make_dunes

import rftsim
from rftsim.law import layout

DUNES = {"terrain": "dunes", "slope_deg": 0.0}
SCAN = 7


@pytest.fixture(params=TASKS)
def task(request):
    return request.param


def actions(env, n):
    rng = np.random.default_rng(0)
    return rng.uniform(-1.0, 1.0, (n, *env.action_space.shape)).astype(np.float32)


def played(env, n=5, seed=3):
    return [env.reset(seed=seed)[0], *(env.step(action)[0] for action in actions(env, n))]


def terrain_of(env):
    """The dunes of an environment as the model has them, placed as the episode has drawn."""
    (bed,) = rftsim.instances(env.model)
    head = layout.record(bed.relief, layout.TERRAIN)
    made = env.task.dunes
    return rftsim.Terrain(made.heights, made.spacing, (float(head.x), float(head.y)), repeat=True)


@pytest.mark.parametrize("env_id", IDS)
def test_contract(env_id):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space (min|max)imum value is -?infinity.*")
        check_env(gym.make(env_id, scan=SCAN, **DUNES).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("ruts", [False, True])
def test_batch_equals_single(task, ruts):
    """Bit for bit, each simulation at a place of its own, episode after episode, with marks that begin anew."""
    settings = DUNES | {"duration": 0.2, "scan": SCAN, "ruts": ruts, "sand": "preset=poppy-seeds,lambda_=4"}
    many = SandVectorEnv(task, num_envs=2, threads=2, **settings)
    single = SyncVectorEnv([lambda: SandEnv(task, **settings)] * 2, autoreset_mode=AutoresetMode.SAME_STEP, copy=True)
    np.testing.assert_array_equal(many.reset(seed=7)[0], single.reset(seed=7)[0])
    for action in actions(many, 12):
        np.testing.assert_array_equal(many.step(action)[0], single.step(action)[0])
        for name in ("qpos", "qvel"):
            states = [env.unwrapped.physics.field(name)[0] for env in single.envs]
            np.testing.assert_array_equal(many.episodes.physics.field(name), states)
    x = many.episodes.ground.relief.height(np.zeros(2), np.zeros(2))
    assert x[0] != x[1]


def test_seeds_decide_the_place(task):
    env = SandEnv(task, scan=SCAN, **DUNES)
    first, again, other = played(env), played(env), played(env, seed=4)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first[0] - other[0])[-SCAN:].max() > 1e-3


def test_dunes_of_no_height_are_level(task):
    level, flat = SandEnv(task, slope_deg=0.0), SandEnv(task, amplitude=0.0, **DUNES)
    np.testing.assert_array_equal(played(level), played(flat))


def test_all_but_the_relief_is_drawn_as_on_level_ground(task):
    told = []
    for more in ({}, DUNES):
        env = SandEnv(task, **{"strength": (0.5, 2.0), "slope_deg": 0.0} | more)
        _, info = env.reset(seed=5)
        told.append((info["strength"], *env.episodes._command[0]))
    assert told[0] == told[1]


def test_scan_is_the_ground_at_the_stated_places(task):
    """Behind and ahead of the root, in the axes of the heading; in the end of the observation."""
    env = SandEnv(task, scan=SCAN, **DUNES)
    env.reset(seed=1)
    if not env.task.planar:
        turn = np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)])
        env.data.qpos[3:7] = turn
    terrain, length = terrain_of(env), env.task.length
    root, yaw = env.task.root(env.data.qpos[None])[0], 0.0 if env.task.planar else 0.8
    ahead = length * np.linspace(-0.5, 1.5, SCAN)
    expected = []
    for left in (0.0,) if env.task.planar else (0.5 * length, 0.0, -0.5 * length):
        x = root[0] + np.cos(yaw) * ahead - np.sin(yaw) * left
        y = root[1] + np.sin(yaw) * ahead + np.cos(yaw) * left
        expected.extend((terrain.height_at(x, y) - root[2]) / length)
    seen = env.episodes.observation()[0]
    np.testing.assert_allclose(seen[-len(expected) :], expected, atol=1e-6)


def test_scan_of_level_ground_is_level(task):
    env = SandEnv(task, scan=SCAN, slope_deg=0.0)
    env.reset(seed=0)
    seen = env.episodes.observation()[0, -SCAN:]
    np.testing.assert_allclose(seen, -env.task.root(env.data.qpos[None])[0, 2] / env.task.length, rtol=1e-6)


def test_robots_start_as_high_over_dunes_as_over_level_ground(task):
    """The lowest triangle that feels the sand has the height that it has on level ground, to rounding."""
    lowest = []
    for more in ({}, DUNES):
        env = SandEnv(task, **{"slope_deg": 0.0} | more)
        for seed in range(4):
            env.reset(seed=seed)
            bodies = [body for bed in rftsim.instances(env.model) for body in bed.bodies]
            points = np.vstack([rftsim.tractions(env.model, env.data, body).centre for body in bodies])
            ground = rftsim.ground(env.model, env.data)
            lowest.append((points[:, 2] - ground.height_at(points[:, 0], points[:, 1])).min())
    np.testing.assert_allclose(lowest[4:], lowest[:4], atol=1e-12)


@pytest.mark.parametrize(("name", "most"), [("GrouserWheel", 2e-3), ("CLegHexapod", 4e-3), ("Quadruped", 12e-3)])
def test_robots_settle_on_dunes_as_on_level_ground(name, most):
    """Half a second without control takes the root as far down, within a fraction of what it sinks on level ground."""
    sunk = []
    for more in ({}, DUNES):
        env = SandVectorEnv(name, 6, threads=1, **{"slope_deg": 0.0} | more)
        env.reset(seed=0)
        physics = env.episodes.physics
        before = env.task.root(physics.field("qpos"))[:, 2].copy()
        physics.step(round(0.5 / env.config.timestep))
        sunk.append(before - env.task.root(physics.field("qpos"))[:, 2])
    assert np.abs(sunk[1] - sunk[0]).max() < most


def test_planar_dunes_do_not_vary_across():
    for name, kind in TASKS.items():
        dunes = SandEnv(name, **DUNES).task.dunes
        varies = np.abs(dunes.heights - dunes.heights[:1]).max() > 1e-6
        assert varies == (not kind.planar)


@pytest.mark.parametrize("planar", [False, True])
def test_amplitude_and_wavelength_are_what_was_asked(planar):
    """Root mean square of the heights, and twice as high where twice as much is asked for."""
    one, two = make_dunes(0.02, 1.5, planar), make_dunes(0.04, 1.5, planar)
    assert np.sqrt((one.heights**2).mean()) == pytest.approx(0.02)
    np.testing.assert_allclose(two.heights, 2.0 * one.heights, atol=1e-12)
    assert one.spacing[0] == pytest.approx(1.5 / 8)


def test_rover_crosses_dunes():
    """Steered by the goal's bearing for 15 s, no rover tips or digs in, and each gets 3 m over hill and dale."""
    n = 6
    env = SandVectorEnv("Rover", n, threads=1, distance=(30.0, 30.0), sector_deg=0.0, duration=15.0, **DUNES)
    observation, _ = env.reset(seed=0)
    heights = []
    for _ in range(env.config.steps - 1):
        bearing = np.arctan2(observation[:, 1], observation[:, 2])
        observation, _, terminated, _, _ = env.step(np.column_stack([0.9 - bearing, 0.9 + bearing]))
        assert not terminated.any()
        places = env.episodes.physics.field("qpos")[:, :2]
        heights.append(env.episodes.ground.relief.height(*places.T))
    travelled = np.linalg.norm(places, axis=1)
    assert travelled.min() > 3.0
    assert np.median(travelled) > 4.0
    assert np.ptp(heights, axis=0).min() > 2.0 * env.config.amplitude


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"terrain": "hills"}, "'level' or 'dunes'"),
        ({"amplitude": -0.1}, "amplitude must be at least 0 m"),
        ({"wavelength": 0.0}, "wavelength must be positive"),
        ({"scan": 1}, "scan must be 0 or from 2 to 1000 places, not 1"),
        ({"ground": "rigid", "terrain": "dunes"}, "a rigid ground is level and keeps no ruts"),
        ({"ground": "rigid", "ruts": True}, "a rigid ground is level and keeps no ruts"),
        ({"terrain": "dunes", "amplitude": 0.5}, "beyond the sand's angle of repose of .* take an amplitude of"),
        ({"terrain": "dunes", "slope_deg": 30.0}, "slope_deg leans them by 30 more"),
    ],
)
def test_what_cannot_be_is_said(settings, words):
    with pytest.raises(ConfigError, match=words):
        SandEnv("Rover", **settings)
