"""The worked example of docs/adding_a_law.md: taken from the page, built, and held against the oracle."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import oracle
import pytest
from shapes import blob, rotation

import rftsim

PACKAGE = Path(rftsim.__file__).parent
PAGE = PACKAGE.parent / "docs" / "adding_a_law.md"
PLACES = (
    ("sand/medium.py", "    grain_diameter:"),
    ("law/laws.py", "LAWS: Final"),
    ("law/laws.py", '        Law("rft3d:c4"'),
)
"""Module and line before which each of the page's blocks goes, in order."""
SAND = {"xi_n": 2e5, "mu_surf": 0.4, "mu_int": 0.5, "rho_c": 1500.0, "cohesion": 300.0}
DEEPER = SAND["cohesion"] / (SAND["mu_int"] * SAND["rho_c"] * 9.81)
POSES = 5

MEASURE = """
import json, sys
import mujoco, numpy as np
import rftsim

asked = json.load(sys.stdin)
sand = rftsim.Sand(**asked["sand"])
surface = rftsim.Surface(np.array(asked["triangles"]))
stresses = [
    rftsim.surface_force(surface, sand, "rft3d:cohesive", position=x, rotation=r, velocity=v, angular_velocity=w)
    for x, r, v, w in asked["poses"]
]
rest = {}
for law in ("rft3d", "rft3d:cohesive"):
    model = rftsim.load(
        '<mujoco><worldbody><body name="foot" pos="0 0 .03"><freejoint/><geom type="box" size=".03 .03 .03" '
        'density="4000"/></body></worldbody></mujoco>', sand=sand, law=law)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=500)
    rest[law] = [-float(data.qpos[2]), float(np.abs(data.qvel).max())]
print(json.dumps({"stress": [f.stress.tolist() for f in stresses], "rest": rest, "from": rftsim.__file__}))
"""


def blocks():
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)


def with_example(folder):
    """Copy the package to a folder and add what the page adds; the lines added, by module."""
    shutil.copytree(PACKAGE, folder / "rftsim", ignore=shutil.ignore_patterns("__pycache__"))
    added = {}
    for block, (module, before) in zip(blocks(), PLACES, strict=True):
        path = folder / "rftsim" / module
        text = path.read_text()
        assert text.count(f"\n{before}") == 1, f"{module} has no single line that starts with {before!r}"
        blank = "\n\n" if not block.startswith(" ") else ""
        path.write_text(text.replace(f"\n{before}", f"\n{block}{blank}{before}"))
        added[module] = added.get(module, 0) + len(block.splitlines())
    return added


def test_the_page_touches_two_modules(tmp_path):
    """One line of a parameter and its docstring in one, a law in the other; Python without machine code takes both."""
    added = with_example(tmp_path)
    assert set(added) == {"sand/medium.py", "law/laws.py"}
    assert sum(added.values()) <= 20
    listed = (
        "import sys, types; package = types.ModuleType('rftsim'); package.__path__ = [sys.argv[1]]; "
        "sys.modules['rftsim'] = package\n"
        "from rftsim.law import laws, layout\n"
        "law = laws.LAWS['rft3d:cohesive']\n"
        "assert 'cohesion' in layout.BED.names and 'cohesion' in law.reads, layout.BED\n"
        "assert laws.RESPONSES.index(law.response) == 2\n"
    )
    subprocess.run([sys.executable, "-c", listed, str(tmp_path / "rftsim")], check=True)


@pytest.mark.slow
def test_the_example_is_what_it_says(tmp_path):
    """Each triangle's stress is the oracle's at its depth d, times (d + c/(mu rho g)) / d; a foot rests, less deep."""
    with_example(tmp_path)
    rng = np.random.default_rng(5)
    surface = blob(rng)
    poses = [(rng.normal(size=3) * 0.02, rotation(rng), rng.normal(size=3), rng.normal(size=3)) for _ in range(POSES)]
    asked = {
        "sand": SAND,
        "triangles": surface.triangles.tolist(),
        "poses": [[np.asarray(x).tolist() for x in pose] for pose in poses],
    }
    path = os.pathsep.join([str(tmp_path), str(PACKAGE.parent / "models")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    (tmp_path / "cache").mkdir()
    run = [sys.executable, "-P", "-c", MEASURE]
    done = subprocess.run(
        run, input=json.dumps(asked), env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["from"].startswith(str(tmp_path))
    for stress, (x, r, v, w) in zip(found["stress"], poses, strict=True):
        placed = surface.moved(r, x)
        body = oracle.Body(placed.centres, placed.normals, placed.areas, np.asarray(x), v, w)
        depth = body.depths()
        plain = oracle.rft3d(body, SAND["xi_n"], SAND["mu_surf"]).traction
        sunk = depth > 0.0
        assert 0 < sunk.sum() < len(sunk)
        expected = np.where(sunk, (depth + DEEPER) / np.where(sunk, depth, 1.0), 0.0)[:, None] * plain
        np.testing.assert_allclose(stress, expected, atol=1e-9 * np.abs(expected).max())
    assert found["rest"]["rft3d:cohesive"][0] < found["rest"]["rft3d"][0]
    assert max(speed for _, speed in found["rest"].values()) < 1e-4
