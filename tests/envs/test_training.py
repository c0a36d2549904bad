"""Training as a person uses it: what is written, how it goes on, what it refuses."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from commands import call
from short_runs import SHORT, STEPS, TASK, TINY

pytest.importorskip("stable_baselines3")

from rftsim_envs.env import SandEnv
from rftsim_envs.recipe import Training, TrainingError
from rftsim_envs.training import actors, folder, network, ppo
from rftsim_envs.training.folder import Folder, make_plan
from stable_baselines3 import PPO

from rftsim.cli.train import interruptible


def parameters(path):
    return PPO.load(path, device="cpu").get_parameters()["policy"]


def equal(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one)


def test_a_run_says_what_was_asked_and_how_it_went(finished):
    config = json.loads((finished / "config.json").read_text())
    assert config["env"] == f"rftsim/{TASK}-v0"
    assert config["done"] is True
    assert config["settings"]["duration"] == 0.3
    assert config["training"]["layers"] == [8]
    assert set(config["versions"]) == {"rftsim", "mujoco", "stable-baselines3", "torch", "numpy"}
    rows = folder.read_progress(finished / "progress.csv")
    assert [int(row["update"]) for row in rows] == [1, 2, 3, 4]
    assert int(rows[-1]["steps"]) == 500
    assert float(rows[-1]["length"]) == STEPS
    assert float(rows[-1]["return"]) == pytest.approx(
        float(rows[-1]["reward/speed"]) + float(rows[-1]["reward/power"]), rel=1e-4
    )
    assert PPO.load(finished / "policy.zip", device="cpu").num_timesteps == 500


def test_a_seed_gives_one_policy(finished, tmp_path):
    ppo.train(make_plan(TASK, SHORT, TINY), tmp_path / "again", threads=1)
    ppo.train(make_plan(TASK, SHORT, TINY, seed=1), tmp_path / "other")
    assert equal(parameters(finished / "policy.zip"), parameters(tmp_path / "again" / "policy.zip"))
    assert not equal(parameters(finished / "policy.zip"), parameters(tmp_path / "other" / "policy.zip"))


def test_a_run_starts_with_the_policy_of_another(finished, tmp_path):
    """The network is that one until the first update, which learns nothing at a rate that is all but zero."""
    still = TINY | {"steps": 124, "learning_rate": 1e-30, "start": str(finished)}
    ppo.train(make_plan(TASK, SHORT | {"strength": (0.5, 2.0)}, still), tmp_path / "next")
    before, after = parameters(finished / "policy.zip"), parameters(tmp_path / "next" / "policy.zip")
    assert all(np.allclose(before[name], after[name], rtol=0.0, atol=1e-12) for name in before)
    for start, words in ((tmp_path / "none", "has no policy yet"), (finished, "cannot take over the policy")):
        with pytest.raises(TrainingError, match=words):
            ppo.train(make_plan(TASK, SHORT, TINY | {"layers": (9,), "start": str(start)}), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_each_seed_starts_with_the_policy_of_its_own_seed(finished, tmp_path):
    """Where several runs lie in the folder to start from, each takes over the run that has its seed."""
    (tmp_path / "before").mkdir()
    (tmp_path / "before" / "seed-0").symlink_to(finished)
    ppo.train(make_plan(TASK, SHORT, TINY, seed=1), tmp_path / "before" / "seed-1")
    still = TINY | {"steps": 124, "learning_rate": 1e-30, "start": str(tmp_path / "before")}
    for seed in (0, 1):
        ppo.train(make_plan(TASK, SHORT, still, seed=seed), tmp_path / f"next-{seed}")
        before = parameters(tmp_path / "before" / f"seed-{seed}" / "policy.zip")
        after = parameters(tmp_path / f"next-{seed}" / "policy.zip")
        assert all(np.allclose(before[name], after[name], rtol=0.0, atol=1e-12) for name in before)
    with pytest.raises(TrainingError, match="has no policy yet"):
        ppo.train(make_plan(TASK, SHORT, still, seed=2), tmp_path / "next-2")


def test_noise_falls_to_what_was_asked(tmp_path):
    """The deviation is at most what the training's course allows."""
    quiet = {**TINY, "log_std_init": -0.4, "log_std_last": -2.0}
    ppo.train(make_plan(TASK, SHORT, quiet), tmp_path / "quiet", threads=1)
    found = parameters(tmp_path / "quiet" / "policy.zip")["log_std"]
    last_ceiling = -0.4 * 0.25 - 2.0 * 0.75  # that of the last of four updates, which it may leave by what it learns
    assert np.allclose(found, last_ceiling, atol=0.1)


def test_a_stopped_run_goes_on_from_its_last_update(tmp_path):
    plan, calls = make_plan(TASK, SHORT, TINY), []

    def stop():
        calls.append(1)
        return len(calls) == 40  # in the second of four updates

    assert ppo.train(plan, tmp_path, stop=stop) == (124, 0, False)
    kept = PPO.load(tmp_path / "checkpoint.zip", device="cpu").get_parameters()
    assert kept["policy.optimizer"]["state"][0]["step"] == 2 * 4  # epochs, batches
    assert ppo.train(plan, tmp_path) == (500, 124, True)
    assert [int(row["steps"]) for row in folder.read_progress(tmp_path / "progress.csv")] == [124, 248, 372, 500]


KILLED = f"""
import sys
from rftsim_envs.training import ppo
from rftsim_envs.training.folder import make_plan
ppo.EVERY_STEPS = 200
plan = make_plan({TASK!r}, {SHORT!r}, {TINY | {"steps": 2000}!r})
ppo.train(plan, sys.argv[1], report=lambda row: print(row["steps"], flush=True))
"""


def test_a_killed_run_goes_on_from_its_checkpoint_and_ends_with_the_steps_asked_for(tmp_path):
    with subprocess.Popen([sys.executable, "-c", KILLED, tmp_path], stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if int(line) > 800:
                process.kill()
    rows = folder.read_progress(tmp_path / "progress.csv")
    assert not Folder(tmp_path).done
    trained = ppo.train(make_plan(TASK, SHORT, TINY | {"steps": 2000}), tmp_path)
    assert trained.steps == 2000
    assert trained.done
    assert 0 <= int(rows[-1]["steps"]) - trained.began <= 400  # a checkpoint's distance, and the update in hand
    again = folder.read_progress(tmp_path / "progress.csv")
    assert [int(row["update"]) for row in again] == list(range(1, len(again) + 1))
    assert int(again[-1]["steps"]) == 2000
    assert PPO.load(tmp_path / "policy.zip", device="cpu").num_timesteps == 2000


def test_the_command_resumes_refuses_and_says_that_it_is_finished(finished, capsys):
    arguments = ["train", TASK, "--out", finished, "--set", "duration=0.3", "--envs", 4, "--steps", 500]
    hyper = ["--hyper", "n_steps=32", "batch_size=32", "n_epochs=2", "layers=8"]
    code, out, _ = call(capsys, *arguments, *hyper)
    assert (code, "is finished: 500 steps" in out) == (0, True)
    code, _, err = call(capsys, *arguments, *hyper, "--seed", 3)
    assert code == 2
    assert "seed is 0 there and 3 here" in err
    code, _, err = call(capsys, *arguments, *hyper, "--set", "strength=0.5,2", "--hyper", "gamma=0.9")
    assert code == 2
    assert "settings.strength is [1.0, 1.0] there and [0.5, 2.0] here" in err
    assert "training.gamma is 0.99 there and 0.9 here" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["Frog"], "no task 'Frog'; tasks are"),
        ([TASK, "--set", "colour=3"], "has no setting 'colour'"),
        ([TASK, "--hyper", "speed=3"], "it has steps, n_envs"),
        ([TASK, "--hyper", "gamma=2"], "gamma must be"),
        ([TASK, "--steps", "0"], "steps must be positive"),
        ([TASK, "--seeds", "a"], "whole numbers"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(arguments, words, tmp_path, capsys):
    code, _, err = call(capsys, "train", *arguments, "--out", tmp_path / "new")
    assert code == 2
    assert words in " ".join(err.split())
    assert not (tmp_path / "new").exists()


def test_a_folder_that_cannot_be_written_is_refused_before_training(tmp_path, capsys):
    places = ["/sys/rftsim"]
    (tmp_path / "file").write_text("")
    places.append(tmp_path / "file")
    if os.geteuid():
        (tmp_path / "mine").mkdir(mode=0o500)
        places.append(tmp_path / "mine")
    for place in places:
        code, _, err = call(capsys, "train", TASK, "--out", place)
        assert code == 2
        assert f"cannot write to {place}" in " ".join(err.split())


def test_a_full_disk_leaves_the_last_checkpoint_whole(tmp_path, capsys, monkeypatch):
    plan = make_plan(TASK, SHORT, TINY)
    monkeypatch.setattr(ppo, "EVERY_STEPS", 1)
    written = []

    def fsync(handle):
        written.append(handle)
        if len(written) > 5:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr(os, "fsync", fsync)
        with pytest.raises(TrainingError, match=r"No space left on device.*at 248 steps is whole"):
            ppo.train(plan, tmp_path)
        assert {path.name for path in tmp_path.iterdir()} == {".lock", "config.json", "progress.csv", "checkpoint.zip"}
        full.setattr(os, "fsync", lambda handle: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left")))
        with pytest.raises(TrainingError, match="No space left"):
            ppo.train(plan, tmp_path / "new")
    assert ppo.train(plan, tmp_path) == (500, 248, True)


@pytest.fixture
def interruptions():
    """Ctrl-C as Python has it: a job in the background is begun without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptions")
def test_ctrl_c_saves_and_says_how_to_go_on(tmp_path, capsys):
    arguments = ["train", TASK, "--out", tmp_path, "--set", "duration=0.3", "--envs", 4, "--hyper", "n_steps=32"]

    def interrupt():
        while not (tmp_path / "progress.csv").is_file():
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    code, out, _ = call(capsys, *arguments)
    thread.join()
    kept = folder.read_progress(tmp_path / "progress.csv")
    assert code == 130
    assert f"stopped at {kept[-1]['steps']} steps, saved in" in out
    assert "the same command goes on from there" in out
    with interruptible() as stop:
        assert not stop()
        signal.raise_signal(signal.SIGINT)
        assert stop()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_two_processes_do_not_train_in_one_folder(tmp_path):
    plan = make_plan(TASK, SHORT, TINY)
    with (
        Folder(tmp_path).opened(plan),
        pytest.raises(TrainingError, match="another process"),
        Folder(tmp_path).opened(plan),
    ):
        pass


@pytest.mark.parametrize(("steps", "n_envs", "n_steps"), [(1, 1, 1), (1000, 64, 128), (100_000, 64, 128), (64, 64, 1)])
def test_updates_make_the_steps_asked_for(steps, n_envs, n_steps):
    updates = Training(steps=steps, n_envs=n_envs, n_steps=n_steps).updates()
    assert 0 <= sum(updates) * n_envs - steps < n_envs
    assert max(updates) <= n_steps
    assert max(updates) - min(updates) <= 1


def test_what_is_not_installed_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    code, _, err = call(capsys, "play", TASK, "--video", tmp_path / "film.mp4")
    assert (code, "pip install 'rftsim[video]'" in " ".join(err.split())) == (2, True)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setitem(sys.modules, "ray", None)
    code, _, err = call(capsys, "train", TASK, "--out", tmp_path / "run", "--ray", "local")
    assert (code, "pip install 'rftsim[ray]'" in " ".join(err.split())) == (2, True)


@pytest.mark.slow
def test_on_ray_each_run_ends_once_though_a_worker_dies(tmp_path, capsys):
    pytest.importorskip("ray")
    arguments = ["train", TASK, "--out", tmp_path, "--set", "duration=0.3", "--envs", 4, "--steps", 4000]
    arguments += ["--hyper", "n_steps=32", "batch_size=32", "--seeds", "0,1,2,3,4,5,6,7", "--ray", "local", "--json"]
    killed = []

    def kill():
        victim = Folder(tmp_path / "seed-1")
        while not (victim.progress.is_file() and len(victim.progress.read_text().splitlines()) > 3):
            time.sleep(0.05)
        killed.append(int((victim.path / ".lock").read_text()))
        os.kill(killed[0], signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    code, out, _ = call(capsys, *arguments)
    killer.join(1.0)
    assert code == 0
    assert killed[0] != os.getpid()
    report = json.loads(out)
    assert list(report) == [str(tmp_path / f"seed-{k}") for k in range(8)]
    assert all(one["steps"] == 4000 and one["done"] for one in report.values())
    for k in range(8):
        rows = folder.read_progress(tmp_path / f"seed-{k}" / "progress.csv")
        assert [int(row["update"]) for row in rows] == list(range(1, 33))
        assert int((tmp_path / f"seed-{k}" / ".lock").read_text()) != killed[0] or k != 1
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/policy.zip")}
    assert call(capsys, *arguments)[0] == 0
    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/policy.zip")}


@pytest.mark.parametrize(
    "change",
    [
        ("--seed", "99999999999999999999"),
        ("--threads", "-3"),
        ("--envs", "1000000000"),
        ("--hyper", "log_std_init=1e308"),
    ],
)
def test_a_refused_run_leaves_nothing(tmp_path, capsys, change):
    code, out, err = call(capsys, "train", TASK, "--out", tmp_path / "run", *change)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_normalised_observations_are_kept_in_the_policy(tmp_path):
    """Mean and spread of all that was collected; a stopped run goes on with them, and its policy plays with them."""
    plan, calls = make_plan(TASK, SHORT, TINY | {"normalise": True}), []
    seen = []

    def stop():
        calls.append(1)
        return len(calls) == 80

    learn = network.Normalising.learn
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network.Normalising, "learn", lambda eye, told: (seen.append(told.copy()), learn(eye, told)))
        assert ppo.train(plan, tmp_path, stop=stop) == (248, 0, False)
        assert ppo.train(plan, tmp_path) == (500, 248, True)
    kept, seen = parameters(tmp_path / "policy.zip"), [one.astype(float) for one in seen]
    np.testing.assert_allclose(kept["features_extractor.mean"], np.mean(np.vstack(seen), axis=0), atol=1e-12)
    np.testing.assert_allclose(kept["features_extractor.variance"], np.var(np.vstack(seen), axis=0), atol=1e-12)
    assert kept["features_extractor.count"] == 500
    env = SandEnv(TASK, **SHORT)
    observation, _ = env.reset(seed=0)
    action = PPO.load(tmp_path / "policy.zip", device="cpu").predict(observation, deterministic=True)[0]
    np.testing.assert_array_equal(actors.trained(Folder(tmp_path))(env.episodes)(observation[None], 0.0)[0], action)
