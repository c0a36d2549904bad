"""Runs the examples of README and of the pages: each block of Python, and each command that can run on any machine.

python tests/readme.py            # all
python tests/readme.py FILE ...   # those of some files
"""

import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rftsim_models.quadruped import build_quadruped

import rftsim

ROOT = Path(__file__).parents[1]
ELSEWHERE = {"adding_a_law.md"}
"""Pages whose blocks a test of their own runs."""
UNRUN = re.compile(
    r"rftsim view|rftsim-mpm|out/train|--data DIR|plates\.csv|my_sand\.toml|drill\.stl|/tmp/|my_task\.py"
)
"""Commands that need a display, measured data or hours, and those of the continuum, which tests/mpm calls."""
SHORTENED = {
    "train": "--steps 2048",
    "evaluate": "--episodes 1 --on sand",
    "play": "--seconds 0.2",
    "run": "--duration 0.2",
    "validate": "plates",
}
"""What makes a command short."""


def main() -> None:
    """Run the examples of the files that are named, or of all."""
    files = [Path(name) for name in sys.argv[1:]] or [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    texts = {path: path.read_text() for path in files if path.name not in ELSEWHERE and path.parent.name != "tables"}
    blocks = list(dict.fromkeys(block for text in texts.values() for block in _blocks(text, "python")))
    if not blocks:
        sys.exit("no example in Python")
    for block in blocks:
        exec(compile(block, "example", "exec"), {"__name__": "readme"})
    lines = list(dict.fromkeys(line for text in texts.values() for line in _commands(text) if not UNRUN.search(line)))
    if not lines:
        sys.exit("no command that can run as it stands")
    with tempfile.TemporaryDirectory() as folder:
        _bring(Path(folder))
        for line in lines:
            began = time.perf_counter()
            program, *rest = shlex.split(line)
            more = SHORTENED.get(rest[0], "").split() if program == "rftsim" else []
            command = [Path(sys.executable).absolute().parent / program, *rest, *more]
            subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)
            print(f"{line}: {time.perf_counter() - began:.1f} s", flush=True)
    print(f"{len(texts)} files: {len(blocks)} examples and {len(lines)} commands ran")


def _blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def _commands(text: str) -> list[str]:
    """The lines that begin with one of our commands, in blocks for a shell and in those that are only indented."""
    lines = [line for block in _blocks(text, "sh") for line in block.splitlines()]
    lines += re.findall(r"^    (rftsim(?:-mpm)? .*)$", text, flags=re.MULTILINE)
    return [line.split("#")[0].strip() for line in lines if line.startswith(("rftsim ", "rftsim-mpm "))]


def _bring(folder: Path) -> None:
    """Put into a folder what the examples take for somebody's own: a robot, a mesh, and readings of plates."""
    (folder / "robot.xml").write_text(build_quadruped().to_xml())
    ball = rftsim.shapes.sphere(0.05)
    vertices = ball.triangles.reshape(-1, 3)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {k} {k + 1} {k + 2}" for k in range(1, len(vertices), 3)]
    (folder / "mesh.obj").write_text("\n".join(lines))
    rng = np.random.default_rng(0)
    depth = np.repeat(np.linspace(0.01, 0.04, 10), 2)
    noise = 1.0 + 0.02 * rng.standard_normal(depth.size)
    speed = np.tile([0.01, 0.5], 10)
    _write(folder / "plate.csv", depth=depth, force=0.87574 * 0.9e6 * 0.0028 * depth * noise)
    _write(folder / "drag.csv", depth=depth, speed=speed, force=(600 * depth + 900 * 0.016 * speed**2) * noise)
    _write(folder / "slide.csv", normal=1e3 * depth, tangential=350.0 * depth * noise)


def _write(path: Path, **columns: np.ndarray) -> None:
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(f"{x:.6g}" for x in row) for row in rows)]) + "\n")


if __name__ == "__main__":
    main()
