"""`rftsim validate` as a person uses it: verdicts, exit codes, what is remembered, and errors before anything runs."""

import json
import math
from pathlib import Path

import commands
import numpy as np
import pytest

from rftsim.files import Kept
from rftsim.validation import plates
from rftsim.validation.cmu import PLATE_FILE, WHEEL_FILE
from rftsim.validation.study import Row, at_least, at_most, near

TABLES = Path(__file__).parents[2] / "docs" / "tables"


WHEEL_COLUMNS = (
    "slip_ratio", "slip_angle_deg", "travel_speed_mm_s", "rim_speed_mm_s", "sinkage_mm",
    "F_drawbar_N", "F_sidewall_N", "F_load_N",
)  # fmt: skip


def call(capsys, *arguments):
    """Exit code, standard output and standard error of `rftsim validate`."""
    return commands.call(capsys, "validate", *arguments)


@pytest.mark.parametrize(
    ("row", "passed", "error"),
    [
        (near("x", 1.01, 1.0, 0.02, "s"), True, 0.01),
        (near("x", 0.9, 1.0, 0.02, "s"), False, -0.1),
        (at_most("x", 2.0, 1.0, "s"), False, None),
        (at_least("x", 2.0, 1.0, "s"), True, None),
        (at_least("x", math.nan, 1.0, "s"), False, None),
        (Row("x", 2.0, "s"), None, None),
        (Row("x", None, "s", high=1.0), None, None),
    ],
)
def test_verdicts(row, passed, error):
    assert row.passed is passed
    assert row.error == (None if error is None else pytest.approx(error))


def test_what_was_measured_is_not_measured_again(tmp_path):
    path = tmp_path / "kept.json"
    assert Kept(path, b"inputs").get("x", lambda: 1.0) == 1.0
    assert Kept(path, b"inputs").get("x", lambda: 2.0) == 1.0
    assert Kept(path, b"other inputs").get("x", lambda: 3.0) == 3.0


def test_a_study_prints_draws_and_is_remembered(capsys, tmp_path, monkeypatch):
    options = ("plates", "--json", "--plot", tmp_path, "--memory", tmp_path / "memory")
    code, out, _ = call(capsys, *options)
    assert code == 0
    rows = json.loads(out)["plates"]
    assert all(row["passed"] and row["source"] for row in rows)
    assert (tmp_path / "plates.png").read_bytes().startswith(b"\x89PNG")
    monkeypatch.setattr(plates, "surface_force", None)
    assert call(capsys, *options)[1] == out


def test_a_study_that_was_stopped_goes_on(capsys, tmp_path, monkeypatch):
    def stop(angles):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(plates, "oblique", stop)
        code, out, err = call(capsys, "plates", "--json", "--memory", tmp_path)
    assert (code, out, err) == (130, "", "stopped\n")
    monkeypatch.setattr(plates, "drag", stop)
    assert call(capsys, "plates", "--json", "--memory", tmp_path)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("wheels",), "no study 'wheels'; studies are wheel, runner"),
        (("plates", "--data", "no/such/folder"), "no folder no/such/folder"),
        (("plates", "--json", "--markdown"), "exclude one another"),
    ],
)
def test_refusals_before_anything_runs(capsys, tmp_path, arguments, words):
    code, out, err = call(capsys, *arguments, "--memory", tmp_path / "memory")
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert words in err
    assert not (tmp_path / "memory").exists()


def test_help_has_an_example(capsys):
    code, out, _ = call(capsys, "--help")
    assert code == 0
    assert "Example: rftsim validate" in " ".join(out.split())


def test_absent_data_are_said_and_do_not_fail(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = call(capsys, "measured", "--memory", tmp_path / "m", "--plot", tmp_path)
    assert code == 0
    assert out.count("data not here") == 2
    assert "nothing was compared" in out
    assert (tmp_path / "measured.png").is_file()


def test_a_folder_without_data_is_refused(capsys, tmp_path):
    code, out, err = call(capsys, "measured", "--data", tmp_path, "--memory", tmp_path / "m")
    assert (code, out) == (2, "")
    assert f"{tmp_path} has no measured data" in err
    assert list(tmp_path.iterdir()) == []


def test_a_failing_row_is_marked_and_ends_with_1(capsys, tmp_path):
    """Plates a hundred times stiffer than the sand's density and friction make them."""
    depth = np.linspace(0.001, 0.03, 30)
    lines = ["box,trial,plate_diameter_mm,time_s,depth_m,force_N"]
    for size in (60, 100):
        force = 1e8 * depth * math.pi / 4 * (size / 1e3) ** 2
        lines += [f"a,b,{size},0,{z},{f}" for z, f in zip(depth, force, strict=True)]
    (tmp_path / PLATE_FILE).write_text("\n".join(lines))
    options = ("measured", "--data", tmp_path, "--memory", tmp_path / "m")
    code, out, _ = call(capsys, *options)
    assert code == 1
    assert "FAIL measured: plate of 60 mm" in out
    code, out, _ = call(capsys, *options, "--markdown")
    assert code == 1
    assert out.count("**FAIL**") == 2
    assert out.rstrip().endswith("rftsim validate measured --markdown")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (WHEEL_FILE, "slip_ratio\n0.1\n", "has no column 'slip_angle_deg'"),
        (WHEEL_FILE, f"{','.join(WHEEL_COLUMNS)}\n", "has no rows"),
        (PLATE_FILE, "box,trial,plate_diameter_mm,depth_m,force_N\na,b,60,0.01,much\n", "is no number"),
        (PLATE_FILE, "box,trial,plate_diameter_mm,depth_m,force_N\na,b,60,0.01,10\n", "plates of one size"),
    ],
)
def test_damaged_data(capsys, tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    code, _, err = call(capsys, "measured", "--data", tmp_path, "--memory", tmp_path / "m")
    assert code == 2
    assert words in " ".join(err.split())


def test_pages_have_the_table_that_is_printed(capsys, tmp_path):
    """The rows of the studies that take no time; the first cell has the study's name in its first row only."""
    code, out, _ = call(capsys, "plates", "drill", "--markdown", "--memory", tmp_path)
    rows = [line for line in out.splitlines() if line.startswith("| ")][2:]
    assert code == 0
    assert len(rows) > 10
    kept = [line for name in ("plates", "drill") for line in (TABLES / f"validate-{name}.md").read_text().splitlines()]
    assert set(rows) <= set(kept)


@pytest.mark.slow
def test_everything_quick_passes(capsys, tmp_path):
    """Every row that needs no data, in under five minutes on two cores."""
    code, out, _ = call(capsys, "--quick", "--json", "--data", tmp_path, "--memory", tmp_path / "m")
    failed = [row for rows in json.loads(out).values() for row in rows if row["passed"] is False]
    assert failed == []
    assert code == 0
