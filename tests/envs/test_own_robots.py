"""Robots of one's own as tasks: what is read from their files, that contracts hold, and what cannot be is refused."""

import functools
import os
import pickle
import warnings
from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rftsim_envs import ConfigError, SandEnv, SandVectorEnv
from rftsim_envs.robot import Choice, read_robot, support

ROBOTS = Path(os.environ.get("MENAGERIE_ROOT", Path(__file__).parents[3] / "shared" / "robots"))
ANT = Path(gym.__file__).parent / "envs/mujoco/assets/ant.xml"
PLACES = {"go1": ROBOTS / "unitree_go1/scene.xml", "anymal": ROBOTS / "anybotics_anymal_c/scene.xml", "ant": ANT}
VARIED = {"strength": (0.7, 1.5), "friction": (0.8, 1.0), "slope_deg": 5.0, "history": 2, "observe_feet": True}
LEG = """
      <body name="{name}" pos="{x} {y} 0">
        <joint name="hip_{name}" axis="0 1 0" range="-60 60" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.15" size=".015" mass=".3"/>
        <body name="shank_{name}" pos="0 0 -.15">
          <joint name="knee_{name}" axis="0 1 0" range="-120 0" damping="1"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02" mass=".2"/>
        </body>
      </body>"""
LEGS = {"fl": (0.15, 0.1), "fr": (0.15, -0.1), "rl": (-0.15, 0.1), "rr": (-0.15, -0.1)}
CLIMBER = f"""
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>
    <geom name="wall" type="box" size=".1 3 1" pos="1 0 0"/>
    <body name="ball" pos="0 2 0"><freejoint/><geom type="sphere" size=".1"/></body>
    <body name="trunk" pos="0 0 .4">
      <freejoint/>
      <geom type="box" size=".2 .08 .04" mass="4"/>
      {"".join(LEG.format(name=name, x=x, y=y) for name, (x, y) in LEGS.items())}
    </body>
  </worldbody>
  <actuator>
    {"".join(f'<position name="h{n}" joint="hip_{n}" kp="60" ctrlrange="-1 1"/>' for n in LEGS)}
    {"".join(f'<motor joint="knee_{n}" ctrlrange="-4 8" ctrllimited="true"/>' for n in LEGS)}
  </actuator>
</mujoco>"""


@pytest.fixture(scope="module")
def climber(tmp_path_factory):
    """The path of a robot with hips on servos and knees on motors, beside a wall and a ball, above a deep floor."""
    path = tmp_path_factory.mktemp("robots") / "climber.xml"
    path.write_text(CLIMBER)
    return str(path)


@pytest.fixture(params=["climber", *PLACES])
def model(request, climber):
    path = PLACES.get(request.param, Path(climber))
    if not path.is_file():
        pytest.skip("no robots: set MENAGERIE_ROOT")
    return str(path)


def actions(env, n):
    rng = np.random.default_rng(0)
    return rng.uniform(-1.0, 1.0, (n, *env.action_space.shape)).astype(np.float32)


def test_contracts(model):
    """Gymnasium's and SB3's, of the id with a robot's file."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space (min|max)imum value is -?infinity.*")
        check_env(gym.make("rftsim/Locomotion-v0", model=model).unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make("rftsim/Locomotion-v0", model=model, terrain="dunes", scan=4).unwrapped)


def test_batch_equals_single(model):
    """Bit for bit, on ground of its own, with a past and feet in what is seen, over the ends of episodes."""
    settings = VARIED | {"model": model, "duration": 0.24}
    many = SandVectorEnv("Locomotion", num_envs=2, threads=2, **settings)
    make = functools.partial(SandEnv, "Locomotion", **settings)
    single = SyncVectorEnv([make] * 2, autoreset_mode=AutoresetMode.SAME_STEP, copy=True)
    np.testing.assert_array_equal(many.reset(seed=7)[0], single.reset(seed=7)[0])
    ended = 0
    for action in actions(many, 8):
        out, expected = many.step(action), single.step(action)
        np.testing.assert_array_equal(out[0], expected[0])
        np.testing.assert_allclose(out[1], expected[1], rtol=1e-12, atol=1e-15)
        ended += np.count_nonzero(out[2] | out[3])
        states = [env.unwrapped.physics.field("qpos")[0] for env in single.envs]
        np.testing.assert_array_equal(many.episodes.physics.field("qpos"), states)
    assert ended >= 2


def test_a_seed_decides_everything(model):
    env = SandEnv("Locomotion", model=model, **VARIED)
    runs = [
        [one.reset(seed=3)[0], *(one.step(action)[0] for action in actions(env, 5))]
        for one in (env, env, pickle.loads(pickle.dumps(env)))
    ]
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])
    assert np.abs(env.reset(seed=4)[0] - runs[0][0]).max() > 1e-3


def test_a_robot_that_does_nothing_stands(model):
    """For a second, its base upright and hardly lower than its feet sank, which are the soles' depth."""
    env = SandEnv("Locomotion", model=model, pose="knee_*=-0.001" if "climber" in model else "")
    env.reset(seed=0)
    for _ in range(25):
        *_, terminated, _, info = env.step(neutral(env))
        assert not terminated
    assert info["tilt"] < 0.1
    assert 0.0 < info["sinkage"] < 0.3 * env.task.robot.height
    assert abs(info["speed"]) < 0.05


@pytest.mark.parametrize("bits", ['contype="0" conaffinity="4"', 'contype="2" conaffinity="0"'])
def test_a_rigid_floor_carries_whatever_collides(tmp_path, bits):
    path = tmp_path / "climber.xml"
    path.write_text(CLIMBER.replace("<worldbody>", f"<default><geom {bits}/></default><worldbody>"))
    env = SandEnv("Locomotion", model=str(path), ground="rigid")
    env.reset(seed=0)
    for _ in range(25):
        *_, info = env.step(neutral(env))
    assert info["sinkage"] < 0.01
    assert env.data.ncon > 0


def neutral(env):
    """The action whose controls are those of the pose."""
    task = env.task
    return (task._held[task._actuators] - task._middle) / task._reach


def test_what_is_read_from_a_file(climber):
    robot = read_robot(climber, Choice())
    model = robot.spec.compile()
    assert robot.base == "trunk"
    assert robot.feet == tuple(f"shank_{name}" for name in LEGS)
    assert robot.joints == tuple(f"{joint}_{name}" for name in LEGS for joint in ("hip", "knee"))
    assert robot.driven == tuple(f"h{name}" for name in LEGS) + tuple(f"knee_{name}" for name in LEGS)
    assert model.nbody == 1 + 1 + 8  # neither ball nor wall nor floor
    assert model.ngeom == 9
    assert robot.height == pytest.approx(0.32)
    assert robot.length == pytest.approx(0.4)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for foot, (x, y) in zip(robot.feet, LEGS.values(), strict=True):
        np.testing.assert_allclose(data.sensor(f"{foot}_sole").data, [x, y, 0.0], atol=1e-12)


def test_go1_and_its_keyframe():
    if not PLACES["go1"].is_file():
        pytest.skip("no robots: set MENAGERIE_ROOT")
    robot = read_robot(PLACES["go1"], Choice())
    assert robot.base == "trunk"
    assert robot.feet == ("FR_calf", "FL_calf", "RR_calf", "RL_calf")
    (key,) = robot.spec.keys
    np.testing.assert_allclose(np.reshape(list(key.qpos)[7:], (4, 3)), [[0.0, 0.9, -1.8]] * 4)
    np.testing.assert_allclose(np.reshape(list(key.ctrl), (4, 3)), [[0.0, 0.9, -1.8]] * 4)


def test_what_is_named_counts(climber):
    """Joints and feet by pattern and in the order of naming; a pose; hips that are not driven hold it."""
    settings = {"model": climber, "joints": "knee_f*,hip_fl", "feet": "shank_f*", "pose": "hip_*=0.3,knee_*=-0.6"}
    env = SandEnv("Locomotion", reach="0.2", **settings)
    task = env.task
    assert task.joints == ("knee_fl", "knee_fr", "hip_fl")
    assert task.driven == ("knee_fl", "knee_fr", "hfl")
    assert task.robot.feet == ("shank_fl", "shank_fr")
    env.reset(seed=0)
    env.step([1.0, -1.0, 1.0])
    np.testing.assert_allclose(env.data.ctrl, [0.5, 0.3, 0.3, 0.3, 8.0, -4.0, 0.0, 0.0])


def test_the_past_is_in_the_observation(climber):
    """The latest at the end, those before as they were seen, and at an episode's start the first one throughout."""
    one, many = (SandEnv("Locomotion", model=climber, history=k) for k in (1, 3))
    seen, past = [one.reset(seed=1)[0]] * 3, many.reset(seed=1)[0]
    np.testing.assert_array_equal(np.reshape(past, (3, -1)), seen)
    for action in actions(one, 4):
        seen.append(one.step(action)[0])
        np.testing.assert_array_equal(np.reshape(many.step(action)[0], (3, -1)), seen[-3:])


def test_weights_weigh(climber):
    """Each term is as large as its weight says; survival is paid per second."""
    told = []
    for factor in (1.0, 2.0):
        weights = {"velocity": 1.0, "yaw": 0.5, "survival": 0.5, "energy": 0.2, "haste": 0.02}
        weights |= {"tilt": 2.0, "crouch": 3.0}
        env = SandEnv("Locomotion", model=climber, **{name: factor * value for name, value in weights.items()})
        env.reset(seed=0)
        info = env.step(actions(env, 1)[0])[4]
        told.append(np.array([value for name, value in info.items() if name.startswith("reward/")]))
    assert info["reward/survival"] == pytest.approx(1.0 * env.config.period)
    np.testing.assert_allclose(told[1], 2.0 * told[0])
    assert (told[0] != 0.0).all()


def test_the_farthest_point_of_every_geom_is_on_it_and_farthest():
    """A turned geom's support, against distances of MuJoCo's own to a plane's stand-in: a large thin box below."""
    shapes = {
        "sphere": "size='.1'",
        "capsule": "size='.05 .2'",
        "cylinder": "size='.1 .2'",
        "box": "size='.1 .2 .3'",
        "ellipsoid": "size='.1 .2 .3'",
    }
    for kind, size in shapes.items():
        xml = f"""<mujoco><worldbody><geom type='box' size='9 9 .5' pos='0 0 -3.5'/>
        <body><freejoint/><geom type='{kind}' {size} euler='31 57 12'/></body></worldbody></mujoco>"""
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        distance = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, np.zeros(6))
        assert support(model, data, 1, np.array([0.0, 0.0, -1.0]))[2] == pytest.approx(distance - 3.0, abs=1e-4)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"model": ""}, "needs a robot: model takes the path"),
        ({"model": "nothing.xml"}, "no model file .*nothing.xml"),
        ({"base": "shank_fl"}, "base 'shank_fl' has no free joint; bodies with one are ball, trunk"),
        ({"joints": "ankle"}, "no joint 'ankle'; the robot has hip_fl, knee_fl"),
        ({"feet": "toe"}, "no colliding body 'toe'; the robot has trunk, fl"),
        ({"keyframe": "home"}, "no keyframe 'home'; the model has none"),
        ({"pose": "hip_fl"}, "pose takes JOINT=POSITION, as hip_fl=0.5, not 'hip_fl'"),
        ({"pose": "elbow=1"}, "no joint 'elbow'; the robot has hip_fl"),
        ({"reach": "0.1,0.2"}, "reach has 2 numbers, and actions 8"),
        ({"reach": "-1"}, "reach must be positive"),
        ({"reduction": 1}, "reduction must be at least 0 and below 1"),
        ({"history": 0}, "history must be from 1 to 100"),
    ],
)
def test_settings_that_cannot_be_are_refused(climber, settings, words):
    with pytest.raises(ConfigError, match=words) as error:
        SandEnv("Locomotion", **{"model": climber} | settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("<freejoint/>", ""), "has no body with a free joint"),
        (('<body name="trunk" pos="0 0 .4">', '<body name="trunk" euler="90 0 0">'), "z axis of trunk leans by 90 deg"),
        ((' ctrlrange="-4 8" ctrllimited="true"', ""), "knee_fl, .*: neither servos of position nor with a ctrlrange"),
        (("<mujoco>", "<mujoco"), "climber.xml is no model of MuJoCo's"),
        (("<actuator>", "<sensor/><!--"), "the robot has no actuators: give its joints some"),
    ],
)
def test_robots_that_cannot_walk_are_refused(tmp_path, change, words):
    path = tmp_path / "climber.xml"
    text = CLIMBER.replace(*change)
    path.write_text(text.replace("</actuator>", "-->") if "<!--" in text else text)
    with pytest.raises(ConfigError, match=words) as error:
        SandEnv("Locomotion", model=str(path))
    assert "\n" not in str(error.value)


def test_a_joint_that_nothing_drives_is_not_driven(tmp_path):
    path = tmp_path / "climber.xml"
    path.write_text(CLIMBER.replace('<motor joint="knee_fl" ctrlrange="-4 8" ctrllimited="true"/>', ""))
    with pytest.raises(ConfigError, match="no actuator drives knee_fl; joints with one are hip_fl"):
        SandEnv("Locomotion", model=str(path), joints="knee_*")
