"""Wheel, rover and quadruped as tasks: at rest without action, and what their rewards ask for, a controller can do."""

import mujoco
import numpy as np
import pytest
from rftsim_envs import ConfigError, SandEnv, SandVectorEnv
from rftsim_envs.four_flap_runner import ROLL, RUNNER, SWAY
from rftsim_envs.grouser_wheel import GROUSER_WHEEL, RADIUS, slip, tracking
from rftsim_envs.quadruped import Quadruped
from rftsim_envs.rover import BURIED, Rover, digging, progress
from rftsim_envs.rover import RADIUS as ROVER_RADIUS
from rftsim_envs.walking import closeness
from rftsim_models.rover import build_rover

from rftsim import add_sand, wrenches
from rftsim.run.run import run as simulate
from rftsim.run.scenes import stage

GROUNDS = ("sand", "rigid")


def run(env, policy, steps, seed=0):
    """Return of each simulation's first episode within so many steps, and what `info` told at its end."""
    observation, _ = env.reset(seed=seed)
    total, last, running = np.zeros(env.num_envs), [{}] * env.num_envs, np.ones(env.num_envs, dtype=bool)
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        total += np.where(running, reward, 0.0)
        ended = terminated | truncated
        for i in np.flatnonzero(running):
            source = info["final_info"] if ended[i] else info
            last[i] = {
                name: values[i] for name, values in source.items() if not name.startswith("_") and name[:5] != "final"
            }
        running &= ~ended
        if not running.any():
            break
    return total, {name: np.array([one[name] for one in last]) for name in last[0] if all(name in one for one in last)}


def still(env):
    return lambda _: np.zeros(env.action_space.shape)


@pytest.mark.parametrize("ground", GROUNDS)
def test_quadruped_that_stands_as_asked_gets_all_but_nothing_less(ground):
    """1 + 1/2 per second, less what settling costs."""
    zero = {"forward": (0, 0), "sideways": (0, 0), "turning": (0, 0)}
    env = SandVectorEnv("Quadruped", 2, ground=ground, duration=2.0, **zero)
    total, info = run(env, still(env), 50)
    np.testing.assert_allclose(total, 1.5 * 2.0, rtol=0.02)
    assert (info["error"] < 1e-3).all()
    assert (info["tilt"] < 0.02).all()


def test_quadruped_is_worth_less_the_faster_it_is_asked_to_walk_and_does_not():
    totals = []
    for speed in (0.0, 0.2, 0.5):
        env = SandVectorEnv("Quadruped", 1, ground="rigid", duration=0.5, forward=(speed, speed))
        totals.append(run(env, still(env), 25)[0][0])
    assert totals[0] > totals[1] > totals[2]


def test_quadruped_on_its_back_has_failed():
    env = SandEnv("Quadruped")
    env.reset(seed=0)
    env.data.qpos[2:7] = 0.5, 0.0, 1.0, 0.0, 0.0
    assert env.step(np.zeros(12))[2]


@pytest.mark.parametrize("ground", GROUNDS)
def test_rover_steered_by_the_goals_bearing_arrives(ground):
    env = SandVectorEnv("Rover", 2, ground=ground, slope_deg=0.0, distance=(0.7, 0.8), sector_deg=30.0)

    def steer(observation):
        bearing = np.arctan2(observation[:, 1], observation[:, 2])
        return np.column_stack([0.7 - 1.2 * bearing, 0.7 + 1.2 * bearing])

    total, info = run(env, steer, 120)
    assert info["reached"].all()
    assert (total > env.config.arrival).all()


@pytest.mark.parametrize(("ground", "slope"), [("sand", 10.0), ("rigid", 10.0)])
def test_rover_stays_where_it_is(ground, slope):
    env = SandVectorEnv("Rover", 2, ground=ground, slope_deg=slope, duration=1.0)
    total, info = run(env, still(env), 20)
    np.testing.assert_allclose(total, 0.0, atol=0.05)
    assert (info["sinkage"] < 0.4 * ROVER_RADIUS).all()


def test_rover_that_only_spins_its_wheels_digs_in():
    """In loose poppy seeds opposite rates bury the wheels: failed, and worth less than nothing."""
    env = SandVectorEnv("Rover", 1, sand="poppy-seeds", slope_deg=0.0, guard=0.0)
    total, info = run(env, lambda _: np.array([[1.0, -1.0]]), 40)
    assert total[0] < 0.0
    assert info["sinkage"][0] > (1.0 - BURIED) * ROVER_RADIUS


def pull(sand, slip, speed=0.1):
    """Force with which the rover pulls at what holds it to a speed, its wheels at a slip, over its weight [-]."""
    spec = build_rover()
    spec.option.timestep = 0.005
    add_sand(spec, sand, "rft3d", bodies=Rover.felt, max_edge=Rover.edge, tolerance=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = speed / (1.0 - slip) / ROVER_RADIUS
    holds, seconds = [], 3.0
    while data.time < seconds:
        data.xfrc_applied[1, 0] = 3000.0 * (speed - data.qvel[0])
        mujoco.mj_step(model, data)
        holds.append(data.xfrc_applied[1, 0])
    return -np.mean(holds[len(holds) // 2 :]) / (9.81 * model.body_mass.sum())


@pytest.mark.parametrize(("sand", "crosses"), [("medium-sand", True), ("poppy-seeds", False), ("glass-beads", False)])
def test_no_slip_lets_the_rover_cross_loose_sand(sand, crosses):
    """Its wheels sink by half their radius there, and hold it up by more than they thrust, whatever their rate."""
    assert (max(pull(sand, slip) for slip in (0.1, 0.2, 0.3, 0.5)) > 0.0) == crosses


def test_a_rover_that_digs_in_pays_for_it():
    """The price once, in the step in which it fails, where a rover that stands still pays nothing."""
    env = SandEnv("Rover", sand="poppy-seeds", slope_deg=0.0, failure=7.0, guard=0.0)
    env.reset(seed=0)
    ended, paid = False, []
    while not ended:
        _, _, ended, _, info = env.step(np.array([1.0, 1.0]))
        paid.append(info["reward/failure"])
    assert paid[-1] == pytest.approx(-7.0)
    assert not any(paid[:-1])


@pytest.mark.parametrize("action", [(1.0, 1.0), (1.0, -1.0), (-1.0, 0.3)])
def test_a_guarded_rover_does_not_bury_itself(action):
    """On poppy seeds and on sand weaker still the drives let go before a wheel is dug in, whatever is asked."""
    env = SandVectorEnv("Rover", 2, sand="poppy-seeds", strength=(0.8, 1.0), slope_deg=0.0, duration=4.0)
    total, info = run(env, lambda _: np.tile(action, (2, 1)), 80)
    assert (info["sinkage"] < (1.0 - BURIED) * ROVER_RADIUS).all()
    assert (info["sinkage"] > 0.6 * ROVER_RADIUS).all(), "they have sunk as far as the guard lets them"
    assert (total > -2.0).all()


def test_rovers_passing_speed():
    """Turning on the spot, the left wheels pass backwards at yaw rate times half the track."""
    env = SandEnv("Rover")
    env.reset(seed=0)
    env.data.qvel[5] = 1.0
    task = env.task
    assert isinstance(task, Rover)
    passing = task._passing(env.episodes._moment(env.episodes._qpos, np.zeros(1)))[0]
    np.testing.assert_allclose(passing, [-0.21] * 3 + [0.21] * 3)


@pytest.mark.parametrize("ground", GROUNDS)
def test_wheel_follows_by_proportional_torque(ground):
    env = SandVectorEnv("GrouserWheel", 2, ground=ground, speed=(0.3, 0.3), duration=3.0)
    feed = 0.3 if ground == "sand" else -0.05
    followed, info = run(env, lambda o: feed + 1.5 * o[:, 1:2] - 0.1 * o[:, 5:6], 150)
    assert (np.abs(info["speed"] - 0.3) < 0.03).all()
    rested, _ = run(env, still(env), 150)
    assert (followed > rested + 0.5).all()


def test_wheel_rests_on_sand():
    env = SandVectorEnv("GrouserWheel", 1)
    _, info = run(env, still(env), 100)
    assert abs(info["speed"][0]) < 1e-3


def test_wheel_slips_more_against_a_drawbar():
    """The load is the last term of the observation, over the wheel's weight."""
    slips = []
    for load in (0.0, 10.0):
        env = SandVectorEnv("GrouserWheel", 1, speed=(0.4, 0.4), drawbar=(load, load), observe_drawbar=True)
        expected = load / (GROUSER_WHEEL.vertical_mass * GROUSER_WHEEL.gravity)
        assert env.reset(seed=0)[0][0, -1] == pytest.approx(expected)
        slips.append(run(env, lambda o: 0.3 + 1.5 * o[:, 1:2] - 0.1 * o[:, 5:6], 100)[1]["slip"][0])
    assert 0.0 < slips[0] < 0.3 < slips[1]


def test_pure_rewards():
    """Of speeds, distances and slip: by hand."""
    np.testing.assert_allclose(tracking(np.array([0.3, 0.15]), np.array([0.3, 0.3]), 0.15), [1.0, np.exp(-1)])
    np.testing.assert_allclose(slip(np.array([0.2, 0.1, 0.0]), np.array([0.1, 0.2, 0.0])), [0.5, -0.5, 0.0])
    np.testing.assert_allclose(progress(np.zeros((1, 2)), np.array([[0.3, 0.4]]), np.array([[3.0, 4.0]])), [0.5])
    np.testing.assert_allclose(digging(np.full((2, 6), -0.1), np.array([0.0, 0.05])), [0.1, 0.05])
    np.testing.assert_allclose(closeness(np.array([[0.15, 0.2], [0.0, 0.0]]), 0.25), [np.exp(-1), 1.0])


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("GrouserWheel", {"speed": (0.5, 0.1)}, "speed must be a range"),
        ("GrouserWheel", {"drawbar": (-1, 1)}, "drawbar must be a range"),
        ("GrouserWheel", {"spread": 0}, "spread must be positive"),
        ("Quadruped", {"forward": (1, 0)}, "forward must be a range"),
        ("Quadruped", {"turning_spread": 0}, "turning_spread must be positive"),
        ("Rover", {"distance": (0.1, 1)}, "distance must be a range above"),
        ("Rover", {"sector_deg": 200}, "sector_deg must be between"),
    ],
)
def test_settings_that_cannot_be(name, settings, words):
    with pytest.raises(ConfigError, match=words):
        SandEnv(name, **settings)


def test_quadruped_speed_is_in_its_own_heading():
    env = SandEnv("Quadruped")
    env.reset(seed=0)
    qpos = env.episodes._qpos.copy()
    qpos[0, 3:7] = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)
    later = qpos.copy()
    later[0, 1] += 0.5 * env.config.period
    moment = env.episodes._moment(qpos, np.zeros(1))._replace(qpos=later)
    assert isinstance(env.task, Quadruped)
    assert env.task.speed(moment)[0] == pytest.approx(0.5)


def test_wheel_start_is_at_rest_on_its_lugs():
    env = SandEnv("GrouserWheel")
    env.reset(seed=0)
    assert env.data.body("wheel").xpos[2] == pytest.approx(RADIUS)
    np.testing.assert_array_equal(env.data.qvel, 0.0)


def test_runner_at_a_steady_rate_slips_as_in_its_scene():
    """Of a turn's way, by the angle that was turned: the scene has its rate to the digit and every triangle."""
    env = SandEnv("FourFlapRunner", duration=10.0)
    env.reset(seed=1)
    places = []
    for k in range(300):
        env.step([(2.0 * np.pi - ROLL) / SWAY])
        if k in (199, 299):
            places.append(env.data.qpos.copy())
    (start, _, first), (end, _, last) = places
    slip = 1.0 - (end - start) / (RUNNER.outer_radius * (last - first))
    scene = {"law": env.config.law, "sand": env.config.sand, "settings": {"rpm": "60"}}
    there = simulate(stage("four-flap-runner", timestep=2e-3, duration=5.0, **scene)).steady.slip
    assert slip == pytest.approx(there, abs=0.02 * (1.0 - there))


def test_drive_and_push_pay_for_the_sand():
    """Of a wheel that rolls steadily nothing is stored: drive + push + sand = 0 in the mean."""
    env = SandEnv("GrouserWheel", speed=(0.3, 0.3), duration=10.0)
    seen, _ = env.reset(seed=0)
    powers = []
    for k in range(400):
        seen, *_ = env.step([0.3 + 1.5 * seen[1] - 0.1 * seen[5]])
        if k >= 150:
            paid = float(env.data.actuator_force @ env.data.actuator_velocity)
            powers.append((paid, wrenches(env.model, env.data).power.sum()))
    paid, sand = np.mean(powers, axis=0)
    assert paid > 0.3
    assert paid == pytest.approx(-sand, rel=0.03)
