"""The command line as a person uses it: results, errors, and what is left on the disk."""

import itertools
import json

import mujoco
import numpy as np
import pytest
import trimesh
from commands import call

from rftsim import instances
from rftsim.errors import RftsimError
from rftsim.run import scenes

SAND = "rho_c=3000,mu_int=0.4,mu_surf=0.4,xi_n=0.92e6"


@pytest.fixture
def sphere(tmp_path):
    path = tmp_path / "sphere.stl"
    trimesh.creation.icosphere(subdivisions=2, radius=0.05).export(path)
    return str(path)


def test_force_reports_what_it_promises(capsys, sphere):
    code, out, _ = call(
        capsys, "force", sphere, "--sand", SAND, "--position", 0, 0, -0.1, "--velocity", 0, 0, -1, "--json"
    )
    report = json.loads(out)
    assert code == 0
    assert set(report) >= {"force_N", "moment_Nm", "triangles", "active", "area_m2", "power_W", "sand", "warnings"}
    assert report["force_N"][2] > 0.0
    assert report["power_W"] == pytest.approx(-report["force_N"][2])
    assert report["triangles"] == 320
    assert report["sand"]["xi_n"] == 0.92e6


def test_force_scales_with_length_cubed(capsys, sphere):
    """F ~ xi_n L^3 at fixed depth over size: quasi-static RFT has no other length."""
    forces = []
    for scale in (1.0, 0.5):
        arguments = ("--position", 0, 0, -0.1 * scale, "--velocity", 1, 0, 0, "--scale", scale, "--json")
        forces.append(json.loads(call(capsys, "force", sphere, "--sand", SAND, *arguments)[1])["force_N"])
    np.testing.assert_allclose(forces[1], np.array(forces[0]) / 8, rtol=1e-9, atol=1e-9 * np.abs(forces[0]).max())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("--sand", "quicksand"), "presets are poppy-seeds"),
        (("--sand", "rho_c=-1"), "must be positive"),
        (("--sand", "colour=3"), "it has g"),
        (("--sand", "mu_int"), "no sand"),
        (("--sand", "missing.toml"), "cannot read"),
        (("--law", "rft4d"), "laws are rft2d"),
        (("--scale", "-1"), "scale must be positive"),
        (("--law", "rft2d", "--plane", "0", "0", "1"), "horizontal"),
    ],
)
def test_force_refuses(capsys, sphere, change, words):
    code, out, err = call(capsys, "force", sphere, "--velocity", 0, 0, -1, *change)
    assert code == 2
    assert out == ""
    assert words in err


def _mesh(tmp_path, name, make):
    path = tmp_path / name
    make(path)
    return path


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("missing.stl", lambda path: None, "no mesh file"),
        ("empty.stl", lambda path: path.write_bytes(b""), "empty.stl"),
        ("nan.obj", lambda path: path.write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "not finite"),
        ("open.ply", lambda path: _open_box().export(path), "is open at face"),
        ("noise.stl", lambda path: path.write_bytes(bytes(range(256)) * 4), "noise.stl"),
    ],
)
def test_force_refuses_what_bounds_no_body(capsys, tmp_path, name, make, words):
    code, out, err = call(capsys, "force", _mesh(tmp_path, name, make), "--velocity", 0, 0, -1)
    assert code == 2
    assert out == ""
    assert words in err


def _open_box():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.update_faces(np.arange(12) < 11)
    return box


def test_millimetres_are_warned_about_once(capsys, tmp_path):
    path = _mesh(tmp_path, "mm.stl", lambda path: trimesh.creation.box((100, 100, 100)).export(path))
    code, out, _ = call(capsys, "force", path, "--velocity", 0, 0, -1, "--json")
    assert code == 0
    assert [warning for warning in json.loads(out)["warnings"] if "scale 0.001" in warning] != []
    assert len(json.loads(out)["warnings"]) == 1


def test_inverted_mesh_is_turned(capsys, tmp_path, sphere):
    mesh = trimesh.load_mesh(sphere)
    mesh.invert()
    path = _mesh(tmp_path, "inverted.stl", mesh.export)
    arguments = ("--position", 0, 0, -0.1, "--velocity", 0.1, 0, -1, "--json")
    turned = json.loads(call(capsys, "force", path, *arguments)[1])
    right = json.loads(call(capsys, "force", sphere, *arguments)[1])
    np.testing.assert_allclose(turned["force_N"], right["force_N"], atol=1e-9)
    assert "turned 320 of 320 faces" in turned["warnings"][0]


def test_run_reports_the_steady_state(capsys, tmp_path):
    plot = tmp_path / "wheel.png"
    code, out, _ = call(capsys, "run", "grouser-wheel", "--set", "rpm=30", "--duration", 0.2, "--json", "--plot", plot)
    report = json.loads(out)
    assert code == 0
    assert {"speed_m_s", "sinkage_m", "slip", "realtime_factor", "warnings"} <= set(report)
    assert report["slip"] == pytest.approx(1 - report["speed_m_s"] / (0.106 * report["rate_rad_s"]))
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [plot]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("grouser-wheel", "--set", "rpm=fast"), "rpm must be a number"),
        (("grouser-wheel", "--set", "colour=1"), "it has rpm"),
        (("grouser-wheel", "--set", "rpm"), "key=value"),
        (("grouser-wheel", "--set", "felt_height=2"), "between 0 and 1"),
        (("no-such-scene",), "scenes are grouser-wheel"),
        (("grouser-wheel", "--timestep", "-1"), "timestep must be positive"),
        (("grouser-wheel", "--plot", "no/such/folder.png"), "no folder"),
        (("grouser-wheel", "--plot", "picture.txt"), "must end in .png"),
        (("intruder", "--set", "motion=fly"), "motions are drop, drag, drill"),
    ],
)
def test_run_refuses(capsys, arguments, words):
    code, out, err = call(capsys, "run", *arguments)
    assert code == 2
    assert out == ""
    assert words in err


def test_settings_in_one_flag_or_several(capsys):
    """`--set a=1 b=2` and `--set a=1 --set b=2` mean the same."""
    together = call(capsys, "inspect", "grouser-wheel", "--set", "rpm=10", "felt_height=0.5", "--json")
    apart = call(capsys, "inspect", "grouser-wheel", "--set", "rpm=10", "--set", "felt_height=0.5", "--json")
    assert together[0] == 0
    assert together[1] == apart[1]


FLOOR = """
<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="ball" pos="0 0 0.1"><freejoint/><geom size="0.05" density="3000"/></body></worldbody></mujoco>
"""


def test_own_model_with_a_floor(capsys, tmp_path):
    path = tmp_path / "own.xml"
    path.write_text(FLOOR)
    warned = json.loads(call(capsys, "inspect", path, "--json", "--keep-floor")[1])
    assert len(warned["warnings"]) == 1
    assert "second time" in warned["warnings"][0]
    quiet = json.loads(call(capsys, "inspect", path, "--json")[1])
    assert quiet["warnings"] == []
    assert "in the place of geom" in quiet["choices"][0]
    assert quiet["bodies"]["ball"]["triangles"] == quiet["triangles"] > 0
    code, out, _ = call(capsys, "run", path, "--duration", 0.3, "--json")
    assert code == 0
    assert json.loads(out)["sinkage_m"] > 0.0
    assert json.loads(out)["slip"] is None


def test_a_reduction(capsys, tmp_path):
    """`inspect` says what `run --reduction` models, with the errors, and which law serves."""
    path = tmp_path / "own.xml"
    path.write_text(FLOOR.replace('size="0.05" density', 'type="ellipsoid" size=".05 .04 .03" density'))
    told = json.loads(call(capsys, "inspect", path, "--json", "--reduction", 0.1)[1])
    ball = told["bodies"]["ball"]
    assert 0 < ball["needed"] == told["elements"] < ball["triangles"] == told["triangles"]
    assert 0.0 < ball["error"] <= 0.1
    assert 0.0 < ball["error_held_back"] <= 0.2
    assert f"{ball['needed']} elements keep its wrench within" in ball["why"]
    assert [one["law"] for one in told["advice"]] == ["rft3d", "rft3d"]
    told = json.loads(call(capsys, "inspect", path, "--json", "--reduction", 0.1, "--speed", 2)[1])
    assert told["advice"][1]["law"] == "drft3d"
    assert "--law drft3d, not rft3d" in call(capsys, "inspect", path, "--speed", 2)[1]
    runs = [
        json.loads(call(capsys, "run", path, "--duration", 0.3, "--json", *more)[1])
        for more in ((), ("--reduction", 0.1))
    ]
    assert runs[1]["sinkage_m"] == pytest.approx(runs[0]["sinkage_m"], rel=0.1)
    code, out, err = call(capsys, "run", path, "--reduction", 1)
    assert (code, out) == (2, "")
    assert "reduction must be zero, or below 1" in err


def test_the_solution_of_the_implicit_force(capsys, tmp_path, monkeypatch):
    """`--tolerance` and `--iterations` reach the bed in every command that takes a scene."""
    path, beds = tmp_path / "own.xml", []
    path.write_text(FLOOR)

    def staged(scene, **options):
        beds.append(instances(scenes.stage(scene, **options).model)[0].bed)
        raise RftsimError("seen")

    asked = "--tolerance", 1e-4, "--iterations", 30
    told = json.loads(call(capsys, "inspect", path, "--json", *asked)[1])
    assert (told["tolerance"], told["iterations"]) == (1e-4, 30)
    assert "solved to 0.0001 of a body's velocity, in 30 iterations" in call(capsys, "inspect", path, *asked)[1]
    monkeypatch.setattr("rftsim.cli.scene.stage", staged)
    for scene, command in itertools.product((path, "intruder"), ("run", "drop", "view", "inspect")):
        for more, expected in ((), (3e-3, 40)), (asked, (1e-4, 30)):
            assert "seen" in call(capsys, command, scene, *more)[2]
            assert (beds[-1].tolerance, beds[-1].iterations) == expected


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--tolerance", 0), "reduction=0 keeps every triangle"),
        (("--tolerance", 0.5), "tolerance is that of the implicit force, 1e-06 to 0.1, not 0.5"),
        (("--iterations", 0), "iterations must be a whole number from 1 to 60, not 0"),
        (("--iterations", 2.5), "2.5"),
    ],
)
def test_solutions_that_cannot_be(capsys, arguments, words):
    code, out, err = call(capsys, "run", "intruder", *arguments)
    assert (code, out) == (2, "")
    assert words in err


def test_bad_xml_is_an_error_not_a_trace(capsys, tmp_path):
    path = tmp_path / "bad.xml"
    path.write_text("<mujoco><worldbody><body/></worldbod></mujoco>")
    code, out, err = call(capsys, "run", path)
    assert code == 2
    assert out == ""
    assert "error:" in err


@pytest.mark.parametrize("command", ["force", "run", "inspect", "demo", "drop", "view"])
def test_help_has_an_example(capsys, command):
    code, out, _ = call(capsys, command, "--help")
    assert code == 0
    assert f"rftsim {command}" in " ".join(out.split())
    assert "Example:" in out


def test_versions():
    """The struct layout that the plugin relies on was verified for this MuJoCo."""
    assert tuple(map(int, mujoco.__version__.split(".")[:2])) >= (3, 17)
