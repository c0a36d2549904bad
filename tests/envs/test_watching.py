"""Episodes of a policy as a person watches them: played, recorded, filmed, and while it is trained."""

import json

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from commands import call
from rftsim_envs import watch
from rftsim_envs.env import SandEnv
from rftsim_envs.sb3 import SandVecEnv
from rftsim_envs.training import actors
from rftsim_envs.training.folder import Folder
from short_runs import SHORT, STEPS, TASK
from stable_baselines3 import PPO

import rftsim


def test_a_policy_is_played(finished, capsys, tmp_path):
    arguments = ("play", finished, "--episodes", 2, "--json")
    report = json.loads(call(capsys, *arguments)[1])
    assert report == json.loads(call(capsys, *arguments)[1])
    assert report["actions"] == "policy"
    env = SandEnv(TASK, **SHORT)
    seen, _ = env.reset(seed=0)
    model, total, done = PPO.load(finished / "policy.zip", device="cpu"), 0.0, False
    while not done:
        seen, reward, terminated, truncated, _ = env.step(model.predict(seen, deterministic=True)[0])
        total, done = total + reward, terminated or truncated
    assert report["episodes"][0]["r"] == pytest.approx(total, rel=1e-12)
    code, out, _ = call(capsys, "play", TASK, "--actions", "zero", "--seconds", 0.1, "--set", "ground=rigid")
    assert code == 0
    assert "return" in out
    code, _, err = call(capsys, "play", TASK, "--actions", "policy")
    assert (code, "it has no policy" in " ".join(err.split())) == (2, True)


def test_a_recording_reads_back_the_wrench(finished, tmp_path, capsys):
    pytest.importorskip("rerun")
    path = tmp_path / "played.rrd"
    assert call(capsys, "play", finished, "--record", path)[0] == 0
    force, motion = read(path, "/sand/force"), read(path, "/motion/speed")
    assert len(motion) == STEPS
    env = SandEnv(TASK, **SHORT)
    env.reset(seed=0)
    actor, wheel = actors.trained(Folder(finished))(env.episodes), env.model.body("wheel").id
    seen = env.episodes.observation()
    for k in range(STEPS):
        seen, _, _, _, info = env.step(actor(np.reshape(seen, (1, -1)), 0.0)[0])
        np.testing.assert_array_equal(force[k], rftsim.wrenches(env.model, env.data).force[wheel])
        assert motion[k] == info["speed"]
    assert np.linalg.norm(force, axis=1).max() > 10.0


def read(path, start):
    """The values under an entity, in time's order, (n, ...)."""
    from rerun.chunk import RrdReader

    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path.startswith(start):
            batch = chunk.to_record_batch()
            if "Scalars:scalars" in batch.schema.names:  # else how it is drawn
                found += batch.column("Scalars:scalars").to_pylist()
    values = np.array(found)
    return values[:, 0] if values.shape[1] == 1 else values


def test_a_film_has_a_picture_for_each_thirtieth_of_a_second(tmp_path, capsys):
    av = pytest.importorskip("av")
    assert call(capsys, "play", "Hopper", "--seconds", 0.5, "--video", tmp_path / "film.mp4")[0] == 0
    with av.open(str(tmp_path / "film.mp4")) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(pictures) == 15
    assert pictures[0].shape == (540, 960, 3)
    assert min(picture.std() for picture in pictures) > 5.0


def test_one_of_many_is_recorded_as_one_alone(tmp_path):
    pytest.importorskip("rerun")
    many, one = SandVecEnv(TASK, 3, **SHORT), SandEnv(TASK, **SHORT)
    many.seed(5)
    many.reset()
    one.reset(seed=6)
    action = np.full((3, 1), 0.5, np.float32)
    with (
        watch.Watch(many.episodes, tmp_path / "many.rrd", i=1) as seen,
        watch.Watch(one.episodes, tmp_path / "one.rrd") as other,
    ):
        for _ in range(10):
            many.step(action)
            seen.log(many.outcome.info)
            other.log(one.step(action[1])[4])
    for name in ("/motion/speed", "/reward/power", "/slip/slip", "/power/power"):
        np.testing.assert_array_equal(read(tmp_path / "many.rrd", name), read(tmp_path / "one.rrd", name))
    assert np.ptp(read(tmp_path / "one.rrd", "/motion/speed")) > 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("--seed", -1), "seed zero or more"),
        (("--seconds", "inf"), "seconds positive"),
        (("--seconds", "nan"), "positive"),
    ],
)
def test_episodes_that_cannot_be_played_are_refused(capsys, change, words):
    code, out, err = call(capsys, "play", TASK, *change)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert words in err


def test_a_run_is_watched_while_it_is_trained(tmp_path, capsys):
    """After each update where no time has to pass: an episode of the policy, and at the end that of the final one."""
    pytest.importorskip("rerun")
    arguments = ["train", TASK, "--out", tmp_path, "--set", "duration=0.3", "--envs", 4, "--steps", 256]
    arguments += ["--hyper", "n_steps=32", "batch_size=32", "n_epochs=1", "layers=8"]
    assert call(capsys, *arguments, "--watch", 0)[0] == 0
    assert [path.name for path in sorted((tmp_path / "watch").iterdir())] == ["000000128.rrd", "000000256.rrd"]
    assert len(read(tmp_path / "watch/000000256.rrd", "/motion/speed")) == STEPS
    code, _, err = call(capsys, *arguments, "--watch", -1)
    assert (code, "watch takes seconds, zero or more" in err) == (2, True)
    code, _, err = call(capsys, *arguments, "--watch", 1, "--ray", "local")
    assert (code, "are not watched" in " ".join(err.split())) == (2, True)
