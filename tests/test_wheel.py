"""What is released: the wheel and the source archive, installed and used away from the checkout."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FORCE = """
import mujoco, rftsim
model = rftsim.load('''<mujoco><worldbody><body name="foot" pos="0 0 .02"><freejoint/>
<geom type="box" size=".05 .05 .02" density="2000"/></body></worldbody></mujoco>''', sand="poppy-seeds")
data = mujoco.MjData(model)
mujoco.mj_step(model, data, nstep=500)
weight = 9.81 * model.body("foot").mass[0]
print(rftsim.wrenches(model, data).force[model.body("foot").id][2] / weight, rftsim.__file__)
"""
LARGEST = 4e6
"""Most bytes of the wheel, and of the source archive."""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of both archives, built as `make wheel` builds them."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", folder], cwd=ROOT, check=True)
    return folder


def clean():
    """The environment of a process that knows nothing of the checkout."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}


def run(place, *command):
    """Run a command of an environment, in its folder; what it prints."""
    done = subprocess.run(
        [place / "bin" / command[0], *command[1:]],
        cwd=place, env=clean(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.slow
def test_an_empty_environment(built, tmp_path):
    """The wheel with its commands, and what it needs from pip: a first force, and the command line."""
    venv.create(tmp_path / "new", with_pip=True)
    (wheel,) = built.glob("*.whl")
    place = tmp_path / "new"
    run(place, "python", "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{wheel}[cli]")
    share, path = run(place, "python", "-c", FORCE).split()
    assert float(share) == pytest.approx(1.0, abs=0.01)
    assert Path(path).is_relative_to(place)
    assert "rftsim 0." in run(place, "rftsim", "--version")
    assert "speed" in run(place, "rftsim", "run", "grouser-wheel", "--duration", "0.2")
    assert "Push" in run(place, "rftsim-mpm", "--help")


@pytest.mark.slow
def test_training_from_the_wheel(built, tmp_path):
    """A training step of the wheel's own environments; what they need is lent from here, as torch is large."""
    venv.create(tmp_path / "new", with_pip=True)
    place = tmp_path / "new"
    (wheel,) = built.glob("*.whl")
    run(place, "python", "-m", "pip", "install", "-q", "--no-deps", wheel)
    (packages,) = place.glob("lib/python*/site-packages")
    (packages / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    where = run(place, "python", "-c", "import rftsim_envs, rftsim_models; print(rftsim_envs.__file__)")
    assert Path(where.strip()).is_relative_to(place)
    run(place, "rftsim", "train", "Hopper", "--steps", "2048", "--envs", "8", "--out", "hopper")
    assert (place / "hopper" / "policy.zip").is_file()


@pytest.mark.slow
def test_what_the_archives_hold(built):
    """The source archive has all that the tests and the pages need; both are small."""
    (wheel,), (source,) = built.glob("*.whl"), built.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert [name for name in tracked if not name.startswith(".") and name not in names] == []
    assert wheel.stat().st_size < LARGEST
    assert source.stat().st_size < LARGEST
