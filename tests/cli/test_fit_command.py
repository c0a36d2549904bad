"""`rftsim fit` as a person uses it: laws and sands from files, what it says of them, and what it refuses."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh
from rftsim_mpm import campaign
from rftsim_mpm.plate import Plate
from test_cli import call

from rftsim import make_sand
from rftsim.fit.generic import reference_grid
from rftsim.fit.plates import Plates
from rftsim.fit.report import predict
from rftsim.law.tables import TABLE_C3
from rftsim.sand.medium import ALPHA_Z_PLATE

XI_N = 0.8e6


@pytest.fixture(scope="module")
def csv(tmp_path_factory):
    """Plates of Table C.3 in a CSV."""
    plates = reference_grid().take(slice(None, None, 5))
    alpha = predict(TABLE_C3, XI_N, 0.4, plates)
    rows = [",".join(map(repr, row)) for row in np.hstack([plates.angles, alpha]).tolist()]
    path = tmp_path_factory.mktemp("plates") / "plates.csv"
    path.write_text("\n".join(["# angles in degrees", "beta,gamma,psi,alpha_x,alpha_y,alpha_z", *rows, ""]))
    return path


@pytest.fixture(scope="module")
def campaign_folder(tmp_path_factory):
    """A campaign as rftsim_mpm writes it, whose thick plates feel the law on all their faces."""
    folder = tmp_path_factory.mktemp("campaign")
    grid = [(b, g, p) for b in (-60, 0, 30, 60, 90) for g in (-60, -20, 20, 60, 90) for p in (0, 40, 80)]
    common = {"dim": 3, "rho": 3000.0, "length": 0.1, "depth": 0.1, "thickness": 0.02}
    plates = [Plate(**common, beta=float(b), gamma=float(g), psi=float(p), mu_surf=0.4) for b, g, p in grid]
    plates += [Plate(**common, mu_int=mu, mu_surf=0.2) for mu in (0.2, 0.3)]
    campaign.begin(folder, [*plates, Plate(**common, mu_int=0.7)])
    for plate in plates:
        one = Plates(np.array([[plate.beta, plate.gamma, plate.psi]]), np.zeros((1, 3)), np.array([0.2]), np.ones(1))
        alpha = predict(TABLE_C3, XI_N * (plate.mu_int / 0.4) ** 2, plate.mu_surf, one)[0]
        result = {"plate": dataclasses.asdict(plate), "depth_m": 0.1, "alpha_N_m3": alpha.tolist()}
        campaign.write(folder, campaign.key(plate), {**result, "sha256": campaign._checksum(result)})
    return folder


def test_map_of_a_csv_is_a_law_and_a_sand(capsys, csv, tmp_path):
    """The file that `fit map` writes goes into --law and --sand; its law is near the one that made the plates."""
    out = tmp_path / "mine.toml"
    given = ("--mu-surf", 0.4, "--rho-c", 3000, "--prior", 0, "-o", out, "--plot", tmp_path, "--json")
    code, text, _ = call(capsys, "fit", "map", csv, *given)
    found = json.loads(text)
    assert code == 0
    assert found["plates"] == 237
    assert found["determined"] == found["coefficients"] == 60
    assert found["error"] <= found["error_held_back"] < 0.12
    assert found["sand"]["xi_n"] == pytest.approx(XI_N, rel=0.05)
    assert (tmp_path / "fit-map.png").read_bytes().startswith(b"\x89PNG")
    assert make_sand(str(out)).rho_c == 3000.0
    sphere = tmp_path / "sphere.stl"
    trimesh.creation.icosphere(subdivisions=2, radius=0.05).export(sphere)
    pose = (sphere, "--position", 0, 0, -0.1, "--velocity", 0, 0, -1, "--sand", out, "--json")
    ours, theirs = (json.loads(call(capsys, "force", *pose, "--law", law)[1]) for law in (f"rft3d:{out}", "rft3d"))
    assert ours["force_N"][2] == pytest.approx(theirs["force_N"][2], rel=0.1)
    assert ours["force_N"] != theirs["force_N"]


def test_map_of_a_campaign(capsys, campaign_folder):
    """The plates of the sand that has most; Table C.3 explains all of its own stress;
    every flat plate gives xi_n beside Table C.1; what is missing is said."""
    code, text, _ = call(capsys, "fit", "map", campaign_folder, "--prior", 1, "--json")
    found = json.loads(text)
    assert code == 0
    assert found["plates"] == 75
    assert found["sand"]["mu_int"] == found["sand"]["mu_surf"] == 0.4
    assert found["error"] < 0.1
    assert found["error_of_the_source"] < 1e-6
    assert [(row["mu_int"], row["mu_surf"]) for row in found["flat"]][:2] == [(0.2, 0.2), (0.3, 0.2)]
    assert "1 of 78 plates" in found["warnings"][0]
    code, out, _ = call(capsys, "fit", "map", campaign_folder, "--prior", 1)
    assert code == 0
    assert "held back" in out
    assert "Sand(rho_c=3000, mu_int=0.4" in out


def test_damaged_results_are_left_out_and_said(capsys, campaign_folder, tmp_path):
    """A result that is not what was written counts as none."""
    victim = sorted((campaign_folder / "results").iterdir())[0]
    text = victim.read_text()
    victim.write_text(text.replace('"alpha_N_m3": [', '"alpha_N_m3": [1'))
    try:
        found = json.loads(call(capsys, "fit", "map", campaign_folder, "--prior", 1, "--json")[1])
    finally:
        victim.write_text(text)
    assert any("damaged" in warning and victim.stem in warning for warning in found["warnings"])


HEAD = "beta,gamma,psi,alpha_x,alpha_y,alpha_z\n"


@pytest.mark.parametrize(
    ("content", "given", "words"),
    [
        (None, (), "cannot read"),
        ("", (), "has no column 'beta'"),
        ("beta,gamma,alpha_x,alpha_y\n1,2,3,4\n", (), "has no column 'alpha_z'"),
        (HEAD, (), "has no rows"),
        (HEAD + "0,90,0,0,0,much\n", (), "line 2, alpha_z: 'much' is no number"),
        (HEAD + "0,90,0,0,0\n", (), "line 2, alpha_z: nothing is no number"),
        (HEAD + "0,90,0,0,0,inf\n", (), "not finite"),
        (HEAD + "100,90,0,0,0,1\n", (), "beta must be within 90 degrees"),
        (HEAD + "0,90,0,0,0,1e6\n", (), "1 plates determine 1 of 60 coefficients"),
        (HEAD + "0,90,0,0,0,0\n", ("--prior", "1"), "feel no force"),
        (HEAD + "0,90,0,0,0,-1e6\n", ("--prior", "1"), "check the signs of alpha"),
        (HEAD + "0,90,0,0,0,1e6\n", ("--prior", "-1"), "zero or more"),
        (HEAD + "0,90,0,0,0,1e6\n", ("-o", "law.txt"), "must end in .toml"),
    ],
)
def test_map_refuses(capsys, tmp_path, content, given, words):
    path = tmp_path / "plates.csv"
    if content is not None:
        path.write_text(content)
    given = given if "--prior" in given or "-o" in given else (*given, "--prior", 0)
    code, out, err = call(capsys, "fit", "map", path, "--mu-surf", 0.4, *given)
    assert code == 2
    assert out == ""
    assert words in " ".join(err.split())


def test_map_refuses_what_is_no_campaign_or_has_no_friction(capsys, tmp_path, csv, campaign_folder):
    for arguments, words in (
        ((tmp_path,), "is no campaign"),
        ((csv,), "pass --mu-surf"),
        ((campaign_folder, "--mu-int", 0.9), "it has rho 3000, mu_int"),
    ):
        code, _, err = call(capsys, "fit", "map", *arguments)
        assert code == 2
        assert words in " ".join(err.split())


# Trials ---------------------------------------------------------------------------------------------------------------


def table(path, names, *columns):
    rows = [",".join(f"{x!r}" for x in row) for row in np.stack(columns, axis=1).tolist()]
    path.write_text("\n".join([names, *rows, ""]))
    return path


def test_plate_gives_xi_n(capsys, tmp_path):
    """F = 0.87574 xi_n A z gives back xi_n, in the table, in the line for `Sand(...)` and in the file."""
    z = np.linspace(0.005, 0.05, 20)
    force = ALPHA_Z_PLATE * 1.2e6 * 0.003 * z + np.random.default_rng(0).normal(scale=0.3, size=20)
    path, out = table(tmp_path / "plate.csv", "depth,force", z, force), tmp_path / "sand.toml"
    given = ("--area", 0.003, "--known", "rho_c=1330,mu_int=0.55", "-o", out)
    code, text, _ = call(capsys, "fit", "plate", path, *given, "--plot", tmp_path)
    assert code == 0
    assert "Sand(rho_c=1330, mu_int=0.55, xi_n=1" in text
    assert make_sand(str(out)).xi_n == pytest.approx(1.2e6, rel=0.01)
    found = json.loads(call(capsys, "fit", "plate", path, *given, "--json")[1])["estimates"]["xi_n"]
    assert found["low"] < 1.2e6 < found["high"]
    assert found["boot_low"] < found["value"] < found["boot_high"]
    assert (tmp_path / "fit-plate.png").read_bytes().startswith(b"\x89PNG")


def test_plate_whose_force_is_not_proportional_to_depth_is_doubted(capsys, tmp_path):
    z = np.linspace(0.005, 0.05, 20)
    path = table(tmp_path / "plate.csv", "depth,force,area", z, 3000 * z - 15 + 0.01 * np.sin(99 * z), 0 * z + 0.003)
    found = json.loads(call(capsys, "fit", "plate", path, "--json")[1])
    assert "not proportional to depth" in found["warnings"][0]


def test_drag_gives_lambda_and_both_strengths(capsys, tmp_path):
    """F = 580 z + 1.1 rho_c L v^2 of [Agarwal] section 4.6 gives lambda 1.1, and the strengths with which each law's
    upright plate meets 580 z: xi_n 0.22945 L and zeta 0.370 L."""
    z, v = (x.ravel() for x in np.meshgrid([0.02, 0.03, 0.04], [0.04, 0.32, 0.64]))
    path = table(tmp_path / "drag.csv", "depth,speed,force", z, v, 580 * z + 1.1 * 900 * 0.016 * v**2)
    given = ("--area", 0.016, "--rho-c", 900)
    found = json.loads(call(capsys, "fit", "drag", path, *given, "--json")[1])
    assert found["estimates"]["lambda_"]["value"] == pytest.approx(1.1, rel=1e-9)
    assert found["estimates"]["K"]["value"] == pytest.approx(580.0, rel=1e-9)
    assert found["sand"]["xi_n"] * 0.22945 * 0.016 == pytest.approx(580.0, rel=1e-4)
    assert found["sand"]["zeta"] * 0.370 * 0.016 == pytest.approx(580.0, rel=1e-4)
    assert "lambda_=1.1" in call(capsys, "fit", "drag", path, *given)[1]


def test_friction_from_forces_along_x_and_z(capsys, tmp_path):
    """A plate tilted by beta with normal force N and friction mu N has mu_surf = mu, however the forces are given."""
    beta, pressure = np.radians(np.array([20.0, 40.0, 60.0, 75.0])), np.array([10.0, 12.0, 9.0, 14.0])
    x = -pressure * np.sin(beta) - 0.35 * pressure * np.cos(beta)
    z = pressure * np.cos(beta) - 0.35 * pressure * np.sin(beta)
    path = table(tmp_path / "tilted.csv", "force_x,force_z,beta", x, z, np.degrees(beta))
    other = table(tmp_path / "ratio.csv", "normal,tangential", pressure, 0.35 * pressure)
    for one in (path, other):
        found = json.loads(call(capsys, "fit", "friction", one, "--json")[1])
        assert found["sand"] == {"mu_surf": pytest.approx(0.35, rel=1e-9)}
    code, _, err = call(capsys, "fit", "friction", path, "-o", tmp_path / "sand.toml")
    assert code == 2
    assert "needs a strength" in err
    assert call(capsys, "fit", "friction", path, "-o", tmp_path / "sand.toml", "--known", "xi_n=1e6")[0] == 0
    assert make_sand(str(tmp_path / "sand.toml")).mu_surf == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("kind", "text", "given", "words"),
    [
        ("plate", "depth,force\n.1,2\n.2,4\n.3,6\n", (), "no column 'area'"),
        ("plate", "depth,force\n.1,2\n", ("--area", 1), "too few"),
        ("plate", "depth,force\n.1,-2\n.2,-4\n.3,-6\n", ("--area", 1), "check its sign"),
        ("plate", "depth,force\n-.1,2\n-.2,4\n-.3,6\n", ("--area", 1), "depth must be positive"),
        ("plate", "depth,force\n.1,2\n.2,4\n.3,6\n", ("--area", 0), "area must be positive"),
        ("plate", "depth,force\n.1,2\n.2,4\n.3,6\n", ("--area", 1, "--known", "colour=1"), "--known takes rho_c"),
        ("plate", "depth,force\n.1,2\n.2,4\n.3,6\n", ("--area", 1, "--known", "rho_c=-1"), "rho_c must be positive"),
        ("drag", "depth,speed,force\n.1,1,1\n.1,1,1\n.1,1,1\n", ("--area", 1, "--rho-c", 900), "two speeds"),
        ("drag", "depth,speed,force\n.1,1,1\n.1,2,1\n.1,3,1\n", ("--area", 1, "--rho-c", 0), "rho_c must be positive"),
        ("friction", "depth\n.1\n", (), "no column 'force_x'"),
    ],
)
def test_trials_refuse(capsys, tmp_path, kind, text, given, words):
    path = tmp_path / "trial.csv"
    path.write_text(text)
    code, out, err = call(capsys, "fit", kind, path, *given)
    assert code == 2
    assert out == ""
    assert words in " ".join(err.split())
