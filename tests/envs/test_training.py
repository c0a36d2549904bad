"""Training as a person uses it: what is written, how it goes on, what it refuses; play, evaluate, and recordings."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from rftsim_envs import tasks, watch
from rftsim_envs.env import SandEnv
from rftsim_envs.recipe import Training, TrainingError
from rftsim_envs.sb3 import SandVecEnv
from rftsim_envs.training import actors, evaluate, folder, network, ppo
from rftsim_envs.training.folder import Folder, make_plan
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

import rftsim
from rftsim.cli import evaluate as results
from rftsim.cli import main
from rftsim.cli.train import interruptible

TASK = "FourFlapRunner"
SHORT = {"duration": 0.3}
STEPS = tasks.make(TASK, SHORT).config.steps
TINY = {"steps": 500, "n_envs": 4, "n_steps": 32, "batch_size": 32, "n_epochs": 2, "layers": (8,)}


def call(capsys, *arguments):
    """Exit code, standard output and standard error of one command."""
    code = 0
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as end:
        code = end.code
    return code, *capsys.readouterr()


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a finished run."""
    path = tmp_path_factory.mktemp("run")
    assert ppo.train(make_plan(TASK, SHORT, TINY), path) == (500, 0, True)
    return path


def parameters(path):
    return PPO.load(path, device="cpu").get_parameters()["policy"]


def equal(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one)


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


def test_what_is_not_installed_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    code, _, err = call(capsys, "play", TASK, "--video", tmp_path / "film.mp4")
    assert (code, "pip install 'rftsim[video]'" in " ".join(err.split())) == (2, True)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setitem(sys.modules, "ray", None)
    code, _, err = call(capsys, "train", TASK, "--out", tmp_path / "run", "--ray", "local")
    assert (code, "pip install 'rftsim[ray]'" in " ".join(err.split())) == (2, True)


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


def test_a_policy_is_scored_on_grounds(finished, tmp_path, capsys):
    arguments = ("evaluate", finished, "--on", "sand,rigid", "--episodes", 2, "--baseline", "--json")
    report = json.loads(call(capsys, *arguments, "--plot", tmp_path / "scores.png")[1])
    assert [(one["ground"], one["actor"]) for one in report[str(finished)]] == [
        (ground, actor) for ground in ("sand", "rigid") for actor in ("policy", "random", "open loop")
    ]
    assert (tmp_path / "scores.png").stat().st_size > 10_000
    played = json.loads(call(capsys, "play", finished, "--seed", 10_001, "--json")[1])["episodes"][0]
    scored = report[str(finished)][0]["episodes"][1]
    assert scored["r"] == pytest.approx(played["r"], rel=1e-6)  # actions of a batch differ in their last bits
    for one in report[str(finished)]:
        assert one["ended_early"] == 0.0
        assert one["which"].endswith("rad/s") == (one["actor"] == "open loop")


def test_the_share_that_arrives_is_told_where_any_does():
    one = {"r": 1.0, "early": 0.0, "reached": 1.0}
    for episodes, told in (
        ([one, one | {"reached": 0.0}], ["arrived [%]", "50"]),
        ([one | {"reached": 0.0}], ["early [%]", "0"]),
    ):
        head, row = results._grid([evaluate.Score("sand", evaluate.POLICY, episodes)], False)
        assert [head[-1], row[-1]] == told


def test_several_runs_make_a_table_of_transfer(finished, tmp_path, capsys):
    ppo.train(make_plan(TASK, SHORT | {"ground": "rigid"}, TINY), tmp_path / "rigid" / "seed-0")
    code, out, _ = call(capsys, "evaluate", finished, tmp_path / "rigid", "--episodes", 1, "--markdown")
    head, _, *rows = (line for line in out.splitlines() if line.startswith("|"))
    assert code == 0
    assert head == "| return | on sand | on rigid |"
    assert ["trained on sand" in rows[0], "trained on rigid" in rows[1]] == [True, True]
    assert f"    rftsim evaluate {finished} {tmp_path / 'rigid'} --episodes 1 --markdown" in out
    code, _, err = call(capsys, "evaluate", finished, "--on", "mud")
    assert (code, "grounds are as trained, sand" in " ".join(err.split())) == (2, True)
    code, _, err = call(capsys, "evaluate", tmp_path / "nothing")
    assert (code, "holds no training run" in " ".join(err.split())) == (2, True)


def test_a_sand_that_a_law_cannot_have_is_left_out(finished, tmp_path, capsys):
    """medium-sand has no density: of two runs the one whose law needs it has a dash there, and alone it is refused."""
    ppo.train(make_plan(TASK, SHORT | {"law": "rft2d"}, TINY), tmp_path)
    given = ("--on", "sand,medium-sand", "--episodes", 2, "--markdown")
    code, out, _ = call(capsys, "evaluate", finished, tmp_path, *given)
    first, second = (row.split("|")[2:4] for row in out.splitlines()[2:4])
    assert code == 0
    assert ([cell.strip() == "-" for cell in first], [cell.strip() == "-" for cell in second]) == (
        [False, True],
        [False, False],
    )
    code, _, err = call(capsys, "evaluate", finished, *given)
    assert (code, "has no density" in " ".join(err.split())) == (2, True)


def test_the_grid_has_each_ground_once():
    found = evaluate.grid(make_plan(TASK))
    assert "as trained" in found
    assert "poppy-seeds" not in found  # that is what the runner is trained on
    assert "medium-sand" not in found  # it has no density
    assert "rigid" in found


@pytest.mark.parametrize("name", tasks.TASKS)
def test_drives_that_see_nothing_are_actions(name):
    task = tasks.make(name, {})
    env = SandEnv(name)
    for drive in task.open_loops().values():
        for time_ in (0.0, 1.23):
            action = drive(time_)
            assert action.shape == (env.task.naction,)
            assert np.abs(action).max() <= 1.0


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


def test_a_policy_with_a_past_is_trained_and_scored(tmp_path, capsys):
    plan = make_plan(TASK, SHORT | {"history": 3, "observe_ground": True}, TINY)
    ppo.train(plan, tmp_path)
    code, out, _ = call(capsys, "evaluate", tmp_path, "--episodes", 2, "--on", "sand,dunes", "--json")
    assert (code, len(json.loads(out)[str(tmp_path)])) == (0, 2)


@pytest.mark.slow
def test_scores_on_ray_are_those_of_here(finished, capsys):
    """`evaluate --ray` gives, ground by ground, the numbers of the same command without it."""
    pytest.importorskip("ray")
    arguments = ("evaluate", finished, "--on", "sand,rigid", "--episodes", 2, "--baseline", "--json")
    code, out, _ = call(capsys, *arguments, "--ray", "local")
    assert code == 0
    assert json.loads(out) == json.loads(call(capsys, *arguments)[1])


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
