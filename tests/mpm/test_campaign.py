"""Campaigns: one result for each plate, whatever happens on the way."""

import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import time

import pytest
from rftsim_mpm.campaign import begin, key, manifest, read_jobs, results, run, run_on_ray, status
from rftsim_mpm.cli import main
from rftsim_mpm.errors import MpmError
from rftsim_mpm.plate import Plate
from rftsim_mpm.settings import settings_of

GRID = """
[defaults]
cells = 4
bed = 0.25
depth = 0.005
[[plates]]
mu_int = 0.4
beta = [0.0, 20.0, 30.0]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(GRID)
    return path


def test_lists_are_the_axes_of_a_grid(file):
    plates = read_jobs(file)
    assert [(plate.mu_int, plate.beta) for plate in plates] == [(0.4, 0.0), (0.4, 20.0), (0.4, 30.0)]
    assert all(plate.cells == 4.0 and isinstance(plate.cells, float) for plate in plates)
    assert len({key(plate) for plate in plates}) == 3


def test_what_a_study_learns_later_leaves_its_old_results_valid():
    """A plate with a later setting at its default has the key that plates had before there was that setting."""
    learnt = ("run_up", "absorb", "mu_2", "grain")
    old = {name: value for name, value in dataclasses.asdict(Plate()).items() if name not in learnt}
    assert settings_of(Plate()) == old
    assert settings_of(Plate(run_up=0.5)) == old | {"run_up": 0.5}
    assert len({key(Plate()), key(Plate(run_up=0.5)), key(Plate(absorb=1.0))}) == 3


def test_pushes_are_jobs_too(tmp_path):
    """A sphere pushed along x is pushed back, and its mirror image at y = 0 leaves it one moment: that about y."""
    path = tmp_path / "pushes.toml"
    path.write_text("[[pushes]]\nshape = ['sphere']\ndx = 0.025\nbed = 0.4\ndepth = 0.1\ntravel = 0.01\nspeed = 0.4\n")
    begin(tmp_path / "out", read_jobs(path))
    assert run(tmp_path / "out", 1, lambda name: None) == []
    (found,) = results(tmp_path / "out")
    assert found["push"]["shape"] == "sphere"
    assert found["force"][0] < 0.0
    assert found["force"][1] == found["moment_N_m"][0] == found["moment_N_m"][2] == 0.0


def test_wheels_are_jobs_too(tmp_path):
    """A wheel that has just been let go sinks under its weight, and its slip is that of its speed."""
    path = tmp_path / "wheels.toml"
    path.write_text("[[wheels]]\nrpm = [60.0]\ndx = 0.0055\nduration = 0.03\n")
    begin(tmp_path / "out", read_jobs(path))
    assert run(tmp_path / "out", 1, lambda name: None) == []
    (found,) = results(tmp_path / "out")
    wheel = found["wheel"]
    rim = 2.0 * math.pi * wheel["rpm"] / 60.0 * (wheel["radius"] + wheel["height"])
    assert found["slip"] == pytest.approx(1.0 - found["speed_m_s"] / rim)
    assert found["sinkages_m"][-1] > found["sinkages_m"][0]
    assert len(found["time_s"]) == len(found["speeds_m_s"]) == len(found["sinkages_m"])


@pytest.mark.parametrize(
    ("text", "said"),
    [("plates = 3", "must have"), ("[[plates]]\nmu = 0.4", "no mu"), ("[[plates]]\nmu_int = 'x'", "cannot be 'x'"),
     ("[[plates]]\ndim = 2.5", "cannot be 2.5"), ("[[plates]]\nmu_int = [0.4, -1.0]", "mu_int must be"),
     ("[[pushes]]\nshape = 3", "cannot be 3"), ("[[pushes]]\nbeta = 3", "no beta"),
     ("[[", "not TOML")],
)  # fmt: skip
def test_grids_that_cannot_be(tmp_path, text, said):
    path = tmp_path / "grid.toml"
    path.write_text(text)
    with pytest.raises(MpmError, match=said):
        read_jobs(path)
    assert list(tmp_path.iterdir()) == [path]


def test_killed_and_resumed(file, tmp_path):
    """SIGKILL in the middle, then resume: every plate once, what was finished untouched, no orphan at work."""
    folder = tmp_path / "out"
    program = [sys.executable, "-c", "from rftsim_mpm.cli import main; main()"]
    command = [*program, "campaign", "run", str(file), str(folder), "--processes", "1", "--json"]
    first = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 120.0
    while not list((folder / "results").glob("[!.]*.json")) and time.monotonic() < until:
        time.sleep(0.02)
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    time.sleep(1.0)
    before = {path: path.stat().st_mtime_ns for path in (folder / "results").glob("[!.]*.json")}
    assert 1 <= len(before) < 3
    assert run(folder, 2, lambda name: None) == []
    assert len(status(folder).finished) == 3
    assert {path: path.stat().st_mtime_ns for path in before} == before

    damaged = sorted(before)[0]
    damaged.write_text(damaged.read_text().replace("0", "1", 1))
    assert status(folder).damaged == [damaged.stem]
    again: list[str] = []
    assert run(folder, 1, again.append) == []
    assert again == [damaged.stem]
    assert not status(folder).damaged
    assert len(results(folder)) == 3


def test_verify_finds_what_is_damaged_and_resume_redoes_it(file, tmp_path, capsys):
    """One result is cut short: `verify` names it and exits with 1; `resume` computes this one and no other."""

    def told(*command):
        ended = 0
        try:
            main(["campaign", *command, "--json"])
        except SystemExit as error:
            ended = error.code
        return json.loads(capsys.readouterr().out), ended

    folder = str(tmp_path / "out")
    assert told("run", str(file), folder, "--processes", "1")[0]["computed"] == 3
    assert told("verify", folder)[1] == 0
    kept = {path: path.read_bytes() for path in (tmp_path / "out" / "results").glob("[!.]*.json")}
    damaged = sorted(kept)[1]
    damaged.write_bytes(kept[damaged][:-100])
    found, ended = told("verify", folder)
    assert (found["damaged"], ended) == ([damaged.stem], 1)
    assert told("resume", folder, "--processes", "1")[0]["computed"] == 1
    assert told("verify", folder)[1] == 0
    assert all(path.read_bytes() == text for path, text in kept.items() if path != damaged)


@pytest.mark.slow
def test_on_ray(file, tmp_path):
    """Ray's workers find what processes of our own find, bit for bit."""
    pytest.importorskip("ray")
    found = []
    for name, compute in (("here", lambda folder: run(folder, 1, lambda key: None)),
                          ("ray", lambda folder: run_on_ray(folder, None, lambda key: None))):  # fmt: skip
        begin(tmp_path / name, read_jobs(file))
        assert compute(tmp_path / name) == []
        found.append([result["force"] for result in results(tmp_path / name)])
    assert found[0] == found[1]
    assert len(found[0]) == 3


def test_a_campaign_can_grow(file, tmp_path):
    """Plates are added; those that are known keep their keys, so their results."""
    begin(tmp_path / "out", read_jobs(file))
    before = {key(plate) for plate in manifest(tmp_path / "out")}
    begin(tmp_path / "out", [dataclasses.replace(Plate(), mu_int=0.7)])
    after = {key(plate) for plate in manifest(tmp_path / "out")}
    assert before < after
    assert len(after) == 4


def test_folders_that_are_no_campaign(tmp_path):
    with pytest.raises(MpmError, match="no campaign"):
        status(tmp_path)
    (tmp_path / "manifest.json").write_text(json.dumps({"plates": {"x": {"mu": 1}}}))
    with pytest.raises(MpmError, match="damaged"):
        status(tmp_path)


@pytest.mark.parametrize("text", ["{}", '{"plates": {}}', "[]", "null", '{"plates": [1]}', "[" * 100_000])
def test_a_manifest_without_jobs_is_refused(tmp_path, capsys, text):
    """Nothing is not a campaign that is whole."""
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(SystemExit) as end:
        main(["campaign", "verify", str(tmp_path)])
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert "run the campaign's TOML file again" in err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[plates]]\nbeta = 1" + "0" * 400, "too large for a number"),
        ("plates = [1]", "must have"),
        ("[[plates]]\nbeta = " + "[" * 5000, "nested too deeply"),
        (
            "[[plates]]\n" + "".join(f"{n} = [{', '.join(['0.1'] * 400)}]\n" for n in ("beta", "gamma")),
            "more than 100000",
        ),
    ],
)
def test_files_that_ask_for_too_much(tmp_path, text, said):
    (tmp_path / "grid.toml").write_text(text)
    with pytest.raises(MpmError, match=said):
        read_jobs(tmp_path / "grid.toml")
