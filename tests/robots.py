"""Robots that nobody here made, each loaded on sand without an option, settled and moved: a table, and the shares.

    python tests/robots.py                          # all that are found
    python tests/robots.py scene.xml robot.urdf     # those

Looked for under MENAGERIE_ROOT (by default ../shared/robots), and within gymnasium, dm_control, robosuite and mjlab
where they are installed. Each model has a process of its own.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

TIMEOUT = 300.0
"""Longest time that a model may take [s]."""
SETTLING = 3.0
"""How long it is left alone [s]."""
MOVING = 1.0
"""How long it is moved by controls drawn at random [s]."""
REST = 5e-3
"""Speed of the slowest that does not rest [m/s or rad/s]."""
INSIDE = {
    "gymnasium": ("envs/mujoco/assets/*.xml",),
    "dm_control": ("suite/*.xml", "locomotion/walkers/assets/*.xml", "locomotion/walkers/assets/dog_v2/dog.xml"),
    "robosuite": ("models/assets/robots/*/robot.xml",),
    "mjlab": ("asset_zoo/robots/*/xmls/*.xml",),
}


def find_models() -> Iterator[Path]:
    """Files of models; of a folder with scenes, the scenes."""
    root = Path(os.environ.get("MENAGERIE_ROOT", Path(__file__).parents[2] / "shared" / "robots"))
    for folder in sorted(root.glob("*/")):
        yield from sorted(folder.glob("scene*.xml")) or sorted(folder.glob("*.xml"))
    for package, patterns in INSIDE.items():
        spec = importlib.util.find_spec(package)
        for place in (spec.submodule_search_locations or []) if spec else []:
            for pattern in patterns:
                yield from sorted(Path(place).glob(pattern))


def try_model(path: Path, **options: Any) -> dict[str, Any]:
    """Load one model bare and on sand, with options of `rftsim.load`, let it settle, and move it."""
    row: dict[str, Any] = {"name": "/".join(path.parts[-2:]), "path": str(path)}
    try:
        bare = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        return row | {"skipped": f"MuJoCo: {str(error).splitlines()[0][:60]}"}
    if not bare.nv or not (bare.body_weldid[bare.geom_bodyid] != 0).any():
        return row | {"skipped": "nothing moves"}
    import rftsim
    from rftsim.model.ground import ground

    started = time.perf_counter()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            model = rftsim.load(path, **options)
        except rftsim.RftsimError as error:
            return row | {"error": str(error)[:200]}
    row["load_s"] = time.perf_counter() - started
    row["choices"] = [str(one.message) for one in told if one.category is rftsim.RftsimNote]
    row["warnings"] = [str(one.message) for one in told if one.category is rftsim.RftsimWarning]
    bed = rftsim.instances(model)[0]
    row["bodies"], row["elements"] = len(bed.bodies), int(sum(s.size // 7 for s in bed.bodies.values()))
    row["height"] = float(ground(model, mujoco.MjData(model)).height_at(0.0, 0.0))
    return row | _run(bare, model)


def _run(bare: mujoco.MjModel, model: mujoco.MjModel) -> dict[str, Any]:
    """Settle and move a model on sand, and its bare twin as often."""
    from rftsim import instances, work, wrenches
    from rftsim.model.ground import ground
    from rftsim.model.standing import sinkage, standing
    from rftsim.run.robot import against_gravity

    row: dict[str, Any] = {}
    data, other = _start(model), _start(bare)
    found = standing(model, data)
    data.qpos[:] = found.qpos
    own = np.concatenate([np.zeros(0, dtype=int), *(tree.bodies for tree in found.trees)])
    weight = float((model.body_mass * (1.0 - model.body_gravcomp))[own].sum() * np.linalg.norm(model.opt.gravity))
    n = max(round(SETTLING / model.opt.timestep), 1)
    mujoco.mj_step(model, data, nstep=n - n // 10)
    row["rest_us"] = _timed(model, data, n // 10, None)
    row["speed"] = float(np.abs(data.qvel).max())
    (bed,) = instances(model)
    row["carried"] = against_gravity(model, wrenches(model, data).force.sum(axis=0)) / weight if weight else None
    row["sinkage"] = max(sinkage(ground(model, data), s, data.xpos[b], data.xmat[b]) for b, s in bed.bodies.items())
    mujoco.mj_step(bare, other, nstep=n - n // 10)
    row["bare_rest_us"] = _timed(bare, other, n // 10, None)
    moves = max(round(MOVING / model.opt.timestep), 1)
    row["moving_us"] = _timed(model, data, moves, np.random.default_rng(0))
    row["bare_moving_us"] = _timed(bare, other, moves, np.random.default_rng(0))
    row["unsolved"] = work(model, data).unsolved
    row["bad"] = [int(data.warning[w].number) for w in (5, 6, 7)] if len(data.warning) > 7 else []
    row["bare_bad"] = [int(other.warning[w].number) for w in (5, 6, 7)] if len(other.warning) > 7 else []
    return row


def _start(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def _timed(model: mujoco.MjModel, data: mujoco.MjData, n: int, rng: Any) -> float:
    """Processor time of a step [us], under controls drawn anew every tenth, or as they are."""
    low, high = np.where(model.actuator_ctrllimited[:, None].astype(bool), model.actuator_ctrlrange, [-1.0, 1.0]).T
    held = data.ctrl.copy()
    spent = 0.0
    for first in range(0, max(n, 1), 10):
        if rng is not None:
            data.ctrl[:] = np.clip(held + 0.2 * (high - low) * rng.uniform(-1.0, 1.0, model.nu), low, high)
        started = time.process_time()
        mujoco.mj_step(model, data, nstep=min(10, max(n, 1) - first))
        spent += time.process_time() - started
    return 1e6 * spent / max(n, 1)


def measure(paths: list[Path], console: Console) -> list[dict[str, Any]]:
    """Try each model in a process of its own."""
    rows = []
    for path in paths:
        command = [sys.executable, __file__, "--one", str(path)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            rows.append({"name": "/".join(path.parts[-2:]), "error": f"took more than {TIMEOUT:g} s"})
        else:
            lines = done.stdout.splitlines()
            ended = {"name": "/".join(path.parts[-2:]), "error": f"ended with {done.returncode}: {done.stderr[-300:]}"}
            rows.append(json.loads(lines[-1]) if done.returncode == 0 and lines else ended)
        console.print(_brief(rows[-1]), highlight=False, soft_wrap=True)
    return rows


def _brief(row: dict[str, Any]) -> str:
    if "skipped" in row or "error" in row:
        return f"{row['name']}: {row.get('skipped') or row['error']}"
    told = "".join(f"\n    {text}" for text in row["warnings"])
    return f"{row['name']}: carried {row['carried']}, {row['elements']} elements, {row['load_s']:.1f} s{told}"


def stands(row: dict[str, Any]) -> bool:
    """Whether a model came to rest in the sand with a weight that nothing else carries at all."""
    return bool(row.get("carried")) and row["speed"] < REST


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The shares and medians over all models."""
    tried = [row for row in rows if "skipped" not in row]
    loaded = [row for row in tried if "error" not in row]
    still = [row for row in loaded if stands(row)]
    ratios = {
        state: [row[f"{state}_us"] / row[f"bare_{state}_us"] for row in loaded if row[f"bare_{state}_us"] > 0.0]
        for state in ("rest", "moving")
    }
    return {
        "tried": len(tried),
        "loaded": len(loaded),
        "stand": len(still),
        "carried": sum(abs(row["carried"] - 1.0) <= 0.01 for row in still),
        "lost_on_sand_alone": sum(any(row["bad"]) and not any(row["bare_bad"]) for row in loaded),
        "median_rest": float(np.median(ratios["rest"])) if ratios["rest"] else None,
        "median_moving": float(np.median(ratios["moving"])) if ratios["moving"] else None,
        "slowest_load_s": max((row["load_s"] for row in loaded), default=0.0),
    }


def table(rows: list[dict[str, Any]]) -> Table:
    """A row for each model."""
    made = Table("model", title="Robots that nobody here made, on poppy seeds")
    for heading in ("load [s]", "sand at z [m]", "bodies", "elements", "carried", "speed", "sinkage [mm]"):
        made.add_column(heading, justify="right")
    for heading in ("bare, rest [us]", "sand", "bare, moving [us]", "sand", "doubts"):
        made.add_column(heading, justify="right")
    for row in rows:
        if "skipped" in row or "error" in row:
            made.add_row(row["name"], row.get("skipped") or "[red]" + row["error"][:40])
            continue
        carried = "" if row["carried"] is None else f"{row['carried']:.4f}"
        numbers = f"{row['load_s']:.1f}", f"{row['height']:.3g}", str(row["bodies"]), str(row["elements"]), carried
        times = (f"{row[key]:.0f}" for key in ("bare_rest_us", "rest_us", "bare_moving_us", "moving_us"))
        made.add_row(
            row["name"],
            *numbers,
            f"{row['speed']:.1g}",
            f"{1e3 * row['sinkage']:.0f}",
            *times,
            str(len(row["warnings"])),
        )
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--one", type=Path, help="try one model and print its row as JSON")
    parser.add_argument("--json", type=Path, help="write all rows")
    given = parser.parse_args()
    if given.one:
        print(json.dumps(try_model(given.one)))
        return
    console = Console(width=200)
    rows = measure(given.models or list(find_models()), console)
    console.print(table(rows))
    console.print(summary(rows))
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
