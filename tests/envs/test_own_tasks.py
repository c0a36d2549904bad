"""Tasks of one's own: a class, or one in a file, wherever a name serves; what is none is refused."""

import json
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from rftsim_envs import ConfigError, SandEnv, SandVectorEnv, tasks

FILE = '''"""A ball that is turned."""

import dataclasses

import mujoco
import neighbour
import numpy as np
from rftsim_envs import Config, Task, Training

XML = """
<mujoco>
  <worldbody><body name="ball"><freejoint name="free"/><geom type="sphere" size="0.1"/></body></worldbody>
  <actuator><motor name="turn" joint="free" gear="0 0 0 0 1 0"/></actuator>
  <keyframe><key qpos="0 0 0.1 1 0 0 0"/></keyframe>
</mujoco>"""


@dataclasses.dataclass(frozen=True, kw_only=True)
class BallConfig(Config):
    torque: float = neighbour.TORQUE


class Ball(Task):
    Settings = BallConfig
    length = 0.2
    naction = 1
    training = Training(steps=512, n_envs=4, n_steps=32, batch_size=32, n_epochs=1, layers=(8,))

    def build(self):
        return mujoco.MjSpec.from_string(XML)

    def start(self, rng, qpos, qvel):
        qvel[0] = rng.uniform(-0.1, 0.1)
        return np.empty(0)

    def controls(self, action, moment):
        return self.config.torque * action

    def observe(self, moment):
        return np.hstack([moment.qvel, moment.action])

    def rewards(self, moment):
        return {"speed": self.speed(moment)}

    def measures(self, moment):
        return {"speed": self.speed(moment)}
'''
SHORT = {"duration": 0.3}


@pytest.fixture
def file(tmp_path, monkeypatch):
    """The path of a task of one's own, which imports its neighbour."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "neighbour.py").write_text("TORQUE = 5.0\n")
    (tmp_path / "my_task.py").write_text(FILE)
    monkeypatch.delitem(sys.modules, "neighbour", raising=False)
    return tmp_path / "my_task.py"


@pytest.mark.parametrize("form", ["text", "class"])
def test_a_task_in_a_file_is_an_environment(file, form):
    """It holds Gymnasium's and SB3's contracts, alone and in a batch, which are equal bit for bit."""
    task = f"{file}:Ball" if form == "text" else tasks.find(f"{file}:Ball")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space (min|max)imum value is -?infinity.*")
        check_env(gym.make("rftsim/Task-v0", task=task, render_mode="rgb_array").unwrapped)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(SandEnv(task, **SHORT))
    many = gym.make_vec("rftsim/Task-v0", 2, vectorization_mode="vector_entry_point", task=task, torque=3.0).unwrapped
    assert isinstance(many, SandVectorEnv)
    one, other = SandEnv(task, torque=3.0), SandEnv(task, torque=3.0)
    seen = [many.reset(seed=1)[0]], [[one.reset(seed=1)[0], other.reset(seed=2)[0]]]
    for k in range(5):
        action = np.full(1, np.sin(k))
        seen[0].append(many.step(np.tile(action, (2, 1)))[0])
        seen[1].append([one.step(action)[0], other.step(action)[0]])
    np.testing.assert_array_equal(seen[0], seen[1])
    assert np.ptp(seen[0]) > 0.0


def test_a_task_in_a_file_is_one_of_dm_controls(file):
    dm = pytest.importorskip("rftsim_envs.dm")
    env, other = dm.load(f"{file}:Ball", random=1), SandEnv(f"{file}:Ball")
    seen = [env.reset().observation["observations"]], [other.reset(seed=1)[0]]
    for k in range(5):
        seen[0].append(env.step(np.full(1, np.sin(k))).observation["observations"])
        seen[1].append(other.step(np.full(1, np.sin(k)))[0])
    np.testing.assert_array_equal(*seen)


def test_a_task_has_one_reference(file, monkeypatch):
    """A name, a module or a file and a class, from which `find` gives the class again in any folder."""
    kind = tasks.find(f"{file}:Ball")
    for form in (kind, f"{file}:Ball", str(file), f"{file.parent}/../{file.parent.name}/my_task.py:Ball"):
        assert tasks.reference(form) == f"{file.resolve()}:Ball"
        assert tasks.find(tasks.reference(form)) is kind
    monkeypatch.chdir(file.parent)
    assert tasks.reference("my_task.py:Ball") == f"{file.resolve()}:Ball"
    for form in ("Hopper", "rftsim/Hopper-v0", "rftsim_envs.hopper:Hopper"):
        assert tasks.reference(form) == "Hopper"
    sys.path.append(str(file.parent))
    assert tasks.reference("my_task:Ball") == "my_task:Ball"
    sys.modules.pop("my_task")


def test_a_task_in_a_file_is_trained_played_and_scored(file, tmp_path, capsys):
    """Without a line of ours; from any folder; and a file that changed since is told of."""
    pytest.importorskip("stable_baselines3")
    from rftsim_envs.training import ppo
    from rftsim_envs.training.folder import Folder, make_plan

    from rftsim.cli import main
    from rftsim.errors import RftsimWarning

    out = tmp_path / "run"
    main(["train", f"{file}:Ball", "--out", str(out), "--set", "duration=0.3", "--json"])
    assert Folder(out).done
    config = json.loads((out / "config.json").read_text())
    assert config["env"] == f"{file.resolve()}:Ball"
    assert config["training"]["steps"] == 512
    assert len(config["versions"]["my_task.py"]) == 12
    main(["play", str(out), "--picture", str(tmp_path / "ball.png"), "--json"])
    main(["evaluate", str(out), "--episodes", "2", "--on", "sand,rigid", "--json"])
    played, scored = (json.loads(text) for text in split(capsys.readouterr().out)[1:])
    assert played["env"] == config["env"]
    assert [one["ground"] for one in scored[str(out)]] == ["sand", "rigid"]
    assert (tmp_path / "ball.png").stat().st_size > 10_000
    plan = make_plan(f"{file}:Ball", SHORT)
    assert not ppo.train(plan, tmp_path / "stopped", stop=lambda: True).done
    file.write_text(FILE + "\n")
    with pytest.warns(RftsimWarning, match=r"versions changed .* my_task.py .* to"):
        ppo.train(plan, tmp_path / "stopped")


def split(text):
    """The JSON objects that were printed one after the other."""
    return [part if part.startswith("{") else "{" + part for part in text.replace("}\n{", "}\n\x00{").split("\x00")]


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        (("", ""), ":Bell", "my_task.py has no 'Bell'; its tasks are Ball"),
        (("", ""), ":BallConfig", "must be a subclass of rftsim_envs.Task"),
        (("import neighbour", "import nobody_has_this"), ":Ball", "cannot import .*ModuleNotFoundError"),
        (("class Ball(Task):", "class Ball(Task:"), ":Ball", "cannot import .*SyntaxError"),
        (("def measures", "def measured"), ":Ball", "Ball is not whole: it needs measures"),
        (("length = 0.2", ""), ":Ball", "Ball has no `length`"),
        (
            ("class Ball", "class Bell(Task): pass\n\n\nclass Ball"),
            "",
            "has 2 tasks: name one of them, .*:Bell or .*:Ball",
        ),
        (("<keyframe>", "<keyframe/><!--"), ":Ball", "the model of Ball has no keyframe"),
    ],
)
def test_what_is_no_task_is_refused(file, change, name, words):
    text = FILE.replace(*change)
    file.write_text(text.replace("</keyframe>", "-->") if "<!--" in text else text)
    with pytest.raises(ConfigError, match=words):
        SandEnv(f"{file}{name}")


@pytest.mark.parametrize("name", ["nothing.py:Ball", "nothing.py"])
def test_a_file_that_is_not_there_is_said(name):
    with pytest.raises(ConfigError, match=r"no file .*nothing\.py"):
        SandEnv(name)


def test_a_module_that_is_not_there_is_said():
    with pytest.raises(ConfigError, match=r"cannot import 'nobody\.has'.* or FILE\.py:CLASS"):
        SandEnv("nobody.has:Ball")
