"""The machine code: made from these sources, at once there, the same as compiled here, and in need of no cache."""

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rftsim
from rftsim.engine import layout
from rftsim.law import layout as laws
from rftsim.machine import build, link, sources
from rftsim.machine.targets import AVX2, AVX512, TARGETS

PACKAGE = Path(rftsim.__file__).parent
MODELS = Path(__file__).parents[2] / "models"
PARTS = {"law": laws.GIVEN, "solver": laws.GIVEN, "engine": layout.GIVEN}

FIRST_FORCE = """
import json, sys, time
import mujoco
import rftsim
from rftsim_models import wheels

spec = wheels.build_wheel(wheels.GROUSER_WHEEL, 30.0)
rftsim.add_sand(spec, reduction=0.0)  # every triangle, as ever here: no search for fewer elements in the time
model = spec.compile()
data = mujoco.MjData(model)
data.qpos[model.joint("z").qposadr] = -0.02
while data.time < 0.02:
    mujoco.mj_step(model, data)
seconds = time.process_time()
heavy = {"numba", "scipy", "trimesh", "networkx", "matplotlib"} & set(sys.modules)
wrench = rftsim.wrenches(model, data).force[model.body("wheel").id]
numbers = [*data.qpos, *data.qvel, *wrench]
print(json.dumps({"seconds": seconds, "heavy": sorted(heavy), "numbers": numbers, "from": rftsim.__file__}))
"""


BARE = """
import time
import mujoco

mujoco.MjModel.from_xml_string("<mujoco/>")
print(time.process_time())
"""


def bare_start():
    """Seconds of the processor that a fresh process takes for MuJoCo and an empty model, without sand."""
    found = subprocess.run([sys.executable, "-c", BARE], capture_output=True, text=True, check=True)
    return float(found.stdout)


def first_force(folder, **environment):
    """What a fresh process prints that takes rftsim from a folder."""
    path = os.pathsep.join([str(folder), str(MODELS)])
    variables = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    found = subprocess.run(
        [sys.executable, "-c", FIRST_FORCE],
        cwd=folder,
        env={**variables, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout)


@pytest.fixture
def fresh(tmp_path):
    """A folder with a copy of the package in which nothing is cached."""
    shutil.copytree(PACKAGE, tmp_path / "fresh" / "rftsim", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "fresh"


@pytest.mark.parametrize(("part", "target"), [(part, target) for part in PARTS for target in TARGETS[part]])
def test_what_ships_was_made_from_these_sources(part, target):
    """Its key is that of the sources, and of MuJoCo's constants."""
    key = link.key_of(part, PARTS[part])
    shipped = link.shipped_file(part, target).read_bytes()
    assert shipped.startswith(key), "compiled code was edited: `make native` makes its machine code anew"
    assert len(shipped) < 300_000


def test_every_source_of_machine_code_counts():
    """The key has each module that imports numba, and whatever of rftsim such a module imports."""
    files = {path.relative_to(PACKAGE).as_posix() for path in sources.FILES}
    for path in PACKAGE.rglob("*.py"):
        name, text = path.relative_to(PACKAGE).as_posix(), path.read_text()
        if "\nfrom numba import" not in text:
            continue
        assert name in files, f"{name} imports numba and is not among sources.FILES"
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rftsim"):
                parts = (node.module or "").split(".")[1:]
                for alias in node.names:
                    inner = "/".join([*parts, alias.name]) + ".py"
                    found = inner if (PACKAGE / inner).exists() else "/".join(parts) + ".py"
                    assert found in files, f"{name} imports {found}, which is not among sources.FILES"


@pytest.mark.skipif(not link.runs(AVX512), reason="this processor has no wide vectors")
def test_wide_vectors_move_the_wheel_as_narrow_ones_do(fresh):
    """Without what ships for AVX-512 that for AVX2 is taken, and gives the same numbers but for rounding."""
    (fresh / "rftsim" / link.shipped_file("law", AVX512).relative_to(PACKAGE)).unlink()
    narrow, wide = first_force(fresh), first_force(PACKAGE.parent)
    assert "numba" not in narrow["heavy"]
    np.testing.assert_allclose(narrow["numbers"], wide["numbers"], rtol=1e-9, atol=1e-12)


@pytest.mark.skipif(not link.runs(AVX2), reason="what ships is for another processor")
def test_first_force_compiles_nothing(fresh):
    """A first force costs at most 5 starts of MuJoCo, with Python's own cache or without; and it keeps no cache.

    Bare starts of MuJoCo before and after are the measure, so that a slow machine is no failure.
    """
    (fresh / "cache").mkdir()
    before = bare_start()
    first = first_force(fresh, NUMBA_CACHE_DIR=str(fresh / "cache"))
    again = first_force(fresh, NUMBA_CACHE_DIR=str(fresh / "cache"))
    assert first["from"].startswith(str(fresh))
    assert first["heavy"] == []
    bare = max(before, bare_start())
    assert first["seconds"] < 5.0 * bare
    assert again["seconds"] < 5.0 * bare
    assert not list((fresh / "cache").iterdir())


def test_force_needs_no_home_and_no_folder_to_write_to(fresh):
    """The same numbers where neither the home nor the package can be written to."""
    for path in (*fresh.rglob("*"), fresh):
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        found = first_force(fresh, HOME="/nonexistent", PYTHONDONTWRITEBYTECODE="1")
    finally:
        for path in (fresh, *fresh.rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)
    assert found["numbers"] == first_force(PACKAGE.parent)["numbers"]


@pytest.fixture
def compiler(monkeypatch):
    """What ships does not fit, and compiling is counted instead of done."""
    made = []

    def compile_part(part):
        made.append(part)
        return b"machine code of " + part.encode()

    monkeypatch.setattr(link, "runs", lambda target: False)
    monkeypatch.setattr(build, "build", compile_part)
    return made


def test_what_was_compiled_is_kept_where_numba_keeps_its_cache(compiler, tmp_path, monkeypatch, caplog):
    """Once for NUMBA_CACHE_DIR, and anew where the file is not whole or was made from something else."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for _ in range(2):
        assert link.object_file("law", "") == b"machine code of law"
    assert compiler == ["law"]
    assert len(caplog.records) == 1
    (kept,) = (tmp_path / link.KEPT).iterdir()
    kept.write_bytes(kept.read_bytes()[:-5])
    link.object_file("law", "")
    link.object_file("law", "other constants")
    link.object_file("law", "")
    assert compiler == ["law"] * 3


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system knows no owners")
@pytest.mark.parametrize("what", ["folder", "file", "link", "owner"])
def test_code_that_others_can_write_is_not_run(compiler, tmp_path, monkeypatch, caplog, what):
    """A folder or file that a group or others can write, a link, or another's is passed over in one line."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    link.object_file("law", "")
    folder = tmp_path / link.KEPT
    (kept,) = folder.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700
    if what == "link":
        folder.rename(tmp_path / "elsewhere")
        folder.symlink_to(tmp_path / "elsewhere")
    elif what == "owner":
        own = os.getuid()
        monkeypatch.setattr(os, "getuid", lambda: own + 1 if own else 1)
        if not own:
            os.chown(kept, 2, -1)
    else:
        (folder if what == "folder" else kept).chmod(0o775)
    caplog.clear()
    assert link.object_file("law", "") == b"machine code of law"
    assert compiler == ["law", "law"]
    assert "takes no compiled code from" in caplog.text
    if what == "file":  # written anew, it is our own again
        link.object_file("law", "")
        assert compiler == ["law", "law"]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system knows no owners")
def test_code_is_kept_whatever_the_umask(compiler, tmp_path, monkeypatch):
    """Where a user's files are writable to the group, the folder for compiled code is not."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    before = os.umask(0o002)
    try:
        for _ in range(2):
            link.object_file("law", "")
    finally:
        os.umask(before)
    assert compiler == ["law"]


def test_no_folder_to_write_to_is_no_error(compiler, tmp_path, monkeypatch):
    """It compiles each time."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    for _ in range(2):
        assert link.object_file("law", "") == b"machine code of law"
    assert compiler == ["law", "law"]


def test_users_cache_follows_the_package(compiler, tmp_path, monkeypatch):
    """Without NUMBA_CACHE_DIR: the package's __pycache__, then the user's folder, whose name may be missing."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert link.folders() == [PACKAGE / "__pycache__" / link.KEPT, tmp_path / "numba" / link.KEPT]
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert link.folders() == [PACKAGE / "__pycache__" / link.KEPT]


@pytest.mark.slow
def test_compiled_here_it_is_the_same(fresh):
    """What numba compiles for this processor moves the wheel as what ships does; again from the cache, at once."""
    shutil.rmtree(fresh / "rftsim" / link.SHIPPED.relative_to(PACKAGE))
    here = first_force(fresh)
    kept = sorted(path.name for path in (fresh / "rftsim" / "__pycache__" / link.KEPT).glob("*.o.xz"))
    assert len(kept) == len(PARTS)
    again = first_force(fresh)
    assert "numba" not in again["heavy"]
    assert again["seconds"] < 10.0 * bare_start()
    assert again["numbers"] == here["numbers"]
    np.testing.assert_allclose(here["numbers"], first_force(PACKAGE.parent)["numbers"], rtol=1e-9, atol=1e-12)
