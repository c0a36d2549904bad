"""The commands as a newcomer runs them: every study quickly, and errors of one line before anything is written."""

import json

import numpy as np
import pytest
import rerun.chunk as rerun_chunk
import trimesh
from rftsim_mpm.cli import main
from rftsim_mpm.fields import free_surface

STUDIES = [
    ["plate", "--quick"],
    ["plate", "--quick", "--dim", "3", "--depth", "0.005", "--bed", "0.3", "--speed", "0.5"],
    ["case", "4", "--quick", "--depth", "0.01", "--bed", "0.2", "0.1"],
    ["slope", "--quick", "--depth", "0.005", "--buried", "0.1"],
    ["wheel", "--quick", "--duration", "0.02"],
    [
        "wheel",
        "--quick",
        "--duration",
        "0.11",
        "--rpm",
        "120",
        "--prescribed-slip",
        "0",
        "--prescribed-sinkage",
        "0.02",
    ],
    ["footprint", "--quick", "--bed", "0.3", "--speed", "0.4", "--rest", "0.05"],
    ["blade", "--quick", "--travel", "0.04", "--bed", "0.7", "--speed", "0.2"],
    ["rut", "--quick", "--rpm", "120", "--radius", "0.03", "--grousers", "8", "--height", "0.006"],
    ["collapse", "--quick", "--aspects", "0.5", "1.0", "--cells", "6"],
]


@pytest.mark.parametrize("command", STUDIES, ids=lambda command: " ".join(command[:2]))
def test_a_study_prints_json_draws_and_records(command, tmp_path, capsys):
    plot, recording = tmp_path / "x.png", tmp_path / "x.rrd"
    main([*command, "--json", "--plot", str(plot), "--record", str(recording)])
    report = json.loads(capsys.readouterr().out)
    assert all(np.isfinite(value) for value in report.values() if isinstance(value, float))
    assert plot.stat().st_size > 10_000
    entities = {chunk.entity_path for chunk in rerun_chunk.RrdReader(recording).stream()}
    assert "/world/sand" in entities
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.png", "x.rrd"]


def test_the_same_for_people(capsys):
    main(["plate", "--quick", "--depth", "0.005"])
    out = capsys.readouterr().out
    assert "noise of 0.5 ms averages" in out
    assert "M particle-updates/s" in out


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["plate", "--mu-int", "-1"], "mu_int must be positive"),
        (["plate", "--plot", "absent/x.png"], "no folder absent"),
        (["plate", "--plot", "x.bmp"], "must end in .png"),
        (["plate", "--record", "x.mp4"], "must end in .rrd"),
        (["slope", "--slope", "30"], "does not stand at 30 degrees"),
        (["drag", "--depths", "0.02"], "two depths"),
        (["wheel", "--grousers", "500"], "do not fit"),
        (["wheel", "--dx", "0.02"], "too thin"),
        (["wheel", "--prescribed-sinkage", "0.03"], "prescribed_slip is missing"),
        (["footprint", "--cells", "2"], "cells must be in"),
        (["blade", "--thickness", "0.001"], "too thin"),
        (["rut", "--rest", "-1"], "rest must be positive"),
        (["collapse", "--aspects", "-1"], "aspects must be positive"),
        (["campaign", "status", "absent"], "no campaign"),
        (["campaign", "run", "absent.toml", "out"], "cannot read absent.toml"),
        (["bench", "--processes", "0"], "processes"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_errors_are_one_line_and_leave_nothing(command, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err
    assert not list(tmp_path.iterdir())


def test_free_surface_leaves_out_what_flies():
    """The top of each column, not the grain above it in the air."""
    place = np.array([[x, z] for x in (0.005, 0.015) for z in (0.0025, 0.0075, 0.0125)] + [[0.005, 0.2]])
    found = free_surface(place, np.full(len(place), 0.005), 0.01)
    np.testing.assert_allclose(found, [[0.005, 0.015], [0.015, 0.015]])


@pytest.mark.parametrize(
    ("name", "content", "arguments", "words"),
    [
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", (), "nan.obj"),
        ("half.stl", "solid x\nfacet", (), "half.stl"),
        ("empty.obj", "", (), "empty.obj"),
        ("packed.stl", "\x1f\x8b", (), "unpack it first"),
        ("cell.obj", None, ("--dx", "1e-5"), "particles: take larger cells"),
        ("slow.obj", None, ("--speed", "1e-9"), "time steps"),
        ("fast.obj", None, ("--speed", "100"), "go slower"),
    ],
)
def test_solids_that_cannot_be_pushed(name, content, arguments, words, tmp_path, capsys):
    path = tmp_path / name
    if content is None:
        trimesh.creation.box((0.05, 0.05, 0.05)).export(path)
    else:
        path.write_bytes(content.encode("latin-1"))
    with pytest.raises(SystemExit) as end:
        main(["push", "--shape", str(path), *arguments])
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert words in err
