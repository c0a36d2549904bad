"""A sweep of seeds and settings ends with one table and one picture over its runs."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from matplotlib import image
from rftsim_envs.training.curves import read_curves
from rftsim_envs.training.folder import read_progress
from test_training import call

SWEEP = ("FourFlapRunner", "--set", "duration=0.3", "--steps", 300, "--threads", 1, "--seeds", "0,1")
SWEEP += ("--hyper", "n_envs=4", "n_steps=32", "batch_size=32", "n_epochs=1", "layers=8")
SWEEP += ("--vary", "strength=1,1", "strength=0.5,2")


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The folder of a sweep of two settings and two seeds."""
    return tmp_path_factory.mktemp("sweep")


def test_a_sweep_ends_with_a_table_and_a_picture(swept, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    code, out, err = call(capsys, "train", *SWEEP, "--out", swept)
    assert (code, err) == (0, "")
    for setting in ("strength=1,1", "strength=0.5,2"):
        ends = [float(read_progress(swept / setting / f"seed-{k}" / "progress.csv")[-1]["return"]) for k in (0, 1)]
        (line,) = (line for line in out.splitlines() if line.startswith(f"│ {setting}"))
        cells = [cell.strip() for cell in line.strip("│").split("│")]
        assert cells[1:3] == ["2", "300"]
        assert cells[4:] == [f"{one:.3g}" for one in (np.mean(ends), min(ends), max(ends))]
    picture = image.imread(swept / "returns.png")
    assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 30
    (swept / "returns.png").unlink()
    assert "is finished" in call(capsys, "train", *SWEEP, "--out", swept)[1], "nothing is trained again"
    assert (swept / "returns.png").is_file()


def test_curves_reach_as_far_as_all_seeds_are_trained(swept):
    """A run that was stopped has fewer updates, and one that has not begun has none."""
    names = ["strength=1,1/seed-0", "strength=1,1/seed-1", "strength=1,1/seed-2", "strength=9,9/seed-0"]
    path = swept / names[1] / "progress.csv"
    rows = path.read_text().splitlines(keepends=True)
    path.write_text("".join(rows[:-1]))
    (curve,) = read_curves(swept, names)
    assert curve.name == "strength=1,1"
    assert curve.returns.shape == (2, len(rows) - 2)
    assert curve.steps.tolist() == [float(row.split(",")[1]) for row in rows[1:-1]]
