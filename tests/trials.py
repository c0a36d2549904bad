"""Commands and files that were spoilt at random: each ends with 0, 1, 2 or 130, in one line, with nothing half written.

python tests/trials.py [--commands 300] [--files 300] [--seed 0]    # prints the figures, and exits with 1 at a fault

A trial runs in a process and a folder of its own; it may take 20 s and 1 GB.
"""

import argparse
import importlib
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

LONGEST, LARGEST = 20.0, 1e9
"""Most time [s] and memory [byte] of a trial."""
ENDS = (0, 1, 2, 130)
PRELOADED = (
    "rftsim.cli",
    "rftsim_mpm.cli",
    "rftsim.fit.report",
    "rftsim.validation.studies",
    "rftsim_envs.training.ppo",
    "rftsim_envs.training.play",
    "matplotlib.figure",
    "scipy.stats",
)
NUMBERS = ("nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "1e400")
NUMBERS += ("0x10", "1_0", "1,5", "2147483648", "99999999999999999999")
WORDS = ("", " ", "é\u202ex", "[red]", "%s%n", "true", "None", "a=b", "..", "/", "/dev/null", "-", "9" * 5000)
WHOLE = (b"", b"[" * 5000, b"\0" * 100, b"null", b"[]", b"{}", b"{")
MARKS = (b"\xef\xbb\xbf", b"\xff\xfe", b"PK\3\4")
MODEL = """<mujoco><option timestep="0.002" gravity="0 0 -9.81"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="b" pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.05" density="2000"/></body></worldbody></mujoco>"""
VALIDATE = "validate plates --memory memory"
COMMANDS = (
    "force ball.stl --sand sand.toml --position 0 0 -0.1 --velocity 0.1 0 -1 --scale 1 --law rft3d",
    "force ball.obj --sand poppy-seeds --velocity 0 0 -1 --angular-velocity 0 1 0 --plane 0 1 0 --law drft2d --json",
    "run model.xml --duration 0.02 --timestep 0.002 --terrain 0 --reduction 0.05 --tolerance 0.01 --iterations 8",
    "run grouser-wheel --set rpm=60 --duration 0.02 --plot wheel.png",
    "run intruder --set mesh=ball.stl scale=1 motion=drag --duration 0.01 --record drag.rrd",
    "inspect model.xml --speed 0.3 --reduction 0.1 --bodies b --geoms all",
    "drop model.xml --limit 0.2 --timestep 0.002 -o settled.xml",
    "fit plate plate.csv --area 0.01 --known rho_c=1500,mu_int=0.5 -o plate.toml",
    "fit drag drag.csv --rho-c 900 --area 0.01 -o drag.toml --plot .",
    "fit friction slide.csv --known xi_n=1e6 --json",
    "fit map map.csv --mu-surf 0.4 --prior 10 --rho-c 1500 --degree 3 -o map.toml",
    VALIDATE,
    "validate measured --data . --memory memory",
    "play GrouserWheel --seconds 0.1 --seed 3 --episodes 1 --set strength=0.5,2",
    "play GrouserWheel --seconds 0.1 --actions zero --picture strip.png --json",
    "train GrouserWheel --out run --steps 64 --envs 2 --seed 1 --hyper n_steps=32 batch_size=64 --set duration=0.2",
    "mpm push --shape ball.stl --theta 30 --depth 0.05 --speed 2 --dx 0.02 --travel 0.01 --quick",
    "mpm plate --dim 2 --length 0.1 --depth 0.05 --cells 4 --speed 2 --quick --json",
    "mpm campaign verify campaign",
    "mpm campaign status campaign --plot forces.png",
    "mpm campaign resume campaign --processes 0",
    "bench stability --cases x --memory memory",
)
FILES = {
    "ball.stl": COMMANDS[0],
    "ball.obj": COMMANDS[1],
    "ball.ply": "force ball.ply --velocity 0 0 -1",
    "ball.3mf": "force ball.3mf --velocity 0 0 -1",
    "shape.stl": "mpm push --shape shape.stl --depth 0.05 --speed 2 --dx 0.02 --travel 0.01 --quick",
    "sand.toml": COMMANDS[0],
    "law.toml": "force ball.stl --velocity 0 0 -1 --law rft3d:law.toml",
    "model.xml": COMMANDS[2],
    "plate.csv": COMMANDS[7],
    "drag.csv": COMMANDS[8],
    "slide.csv": COMMANDS[9],
    "map.csv": COMMANDS[10],
    "memory/plates.json": VALIDATE,
    "campaign/manifest.json": "mpm campaign verify campaign",
    "grid.toml": "mpm campaign status campaign --plot forces.png",
    "old/config.json": "play old --seconds 0.1",
}
"""Commands that read each file."""


class Ended(NamedTuple):
    """How a trial ended."""

    words: list[str]
    code: int
    lines: list[str]
    seconds: float
    memory: float
    faults: list[str]


def make_files(folder: Path) -> None:
    """Write the files that the commands read, small and right."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.05)
    for name in ("ball.stl", "ball.obj", "ball.ply", "ball.3mf", "shape.stl"):
        ball.export(folder / name)
    (folder / "sand.toml").write_text('[sand]\nrho_c = 1500.0\nmu_int = 0.5\nmu_surf = 0.3\nxi_n = 1e6\nsource = "x"\n')
    (folder / "model.xml").write_text(MODEL)
    depth = np.linspace(0.01, 0.1, 8)
    rng = np.random.default_rng(0)
    _csv(folder / "plate.csv", "depth,force", depth, 9e3 * depth * (1.0 + 0.02 * rng.normal(size=8)))
    speed = np.tile([0.1, 0.5], 4)
    _csv(folder / "drag.csv", "Depth [m];speed;force", depth, speed, 1e3 * depth + 9.0 * speed**2 + rng.normal(size=8))
    _csv(folder / "slide.csv", "normal,tangential", depth, 0.4 * depth + 1e-3 * rng.normal(size=8))
    from rftsim.fit.generic import reference_grid
    from rftsim.fit.report import predict
    from rftsim.law.law_file import law_text
    from rftsim.law.tables import TABLE_C3

    plates = reference_grid().take(slice(None, None, 40))
    alpha = predict(TABLE_C3, 1e6, 0.4, plates)
    _csv(folder / "map.csv", "beta,gamma,psi,alpha_x,alpha_y,alpha_z", *plates.angles.T, *alpha.T)
    (folder / "law.toml").write_text(law_text(TABLE_C3, {}))
    for name in ("memory", "old"):
        (folder / name).mkdir()
    (folder / "memory" / "plates.json").write_text(json.dumps({"key": "0" * 64, "known": {"drag": [1.0]}}))
    (folder / "grid.toml").write_text("[defaults]\nmu_int = 0.4\n[[plates]]\nbeta = [0.0, 30.0]\nlength = 0.1\n")
    from rftsim_envs.training.folder import Folder, make_plan
    from rftsim_mpm.campaign import begin, read_jobs

    begin(folder / "campaign", read_jobs(folder / "grid.toml"))
    Folder(folder / "old").write_config(make_plan("GrouserWheel"), done=False)


def _csv(path: Path, head: str, *columns: np.ndarray) -> None:
    separator = ";" if ";" in head else ","
    rows = [separator.join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows, ""]))


def spoil_words(rng: random.Random, words: list[str]) -> list[str]:
    """A command line with one to three words changed, lost, doubled or put elsewhere.

    The study of `validate` stays, as all studies together take minutes by right.
    """
    words, first = list(words), 2 if words[0] == "validate" else 1
    for _ in range(rng.randint(1, 3)):
        k = rng.randrange(first, len(words)) if len(words) > first else 0
        kind = rng.randrange(8)
        if kind == 0 and k:
            del words[k]
        elif kind == 1:
            words.insert(k, words[k])
        elif kind == 2:
            words.insert(k, rng.choice(["--foo", "--json", "--help", "--plot", "-o", *WORDS]))
        elif kind == 3 and "=" in words[k]:
            words[k] = words[k].split("=")[0] + "=" + rng.choice([*NUMBERS, *WORDS])
        elif kind == 4:
            words[k] = words[k][: rng.randrange(len(words[k]) + 1)]
        else:
            numeric = [i for i, word in enumerate(words) if re.fullmatch(r"-?[\d.]+(e-?\d+)?", word)]
            k = rng.choice(numeric) if numeric and kind > 5 else k
            words[k] = rng.choice(NUMBERS if kind > 5 else WORDS)
    return words


def spoil_bytes(rng: random.Random, content: bytes) -> bytes:
    """A file with bytes changed, cut, doubled, or one of its numbers put for another."""
    kind = rng.randrange(9)
    a, b = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    numbers = list(re.finditer(rb"(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?", content))
    if kind <= 2 and numbers:
        found = rng.choice(numbers)
        return content[: found.start()] + rng.choice(NUMBERS).encode() + content[found.end() :]
    changed = bytearray(content)
    for _ in range(rng.choice([1, 3, 30])):
        changed[rng.randrange(len(content))] = rng.randrange(256)
    return (
        bytes(changed),
        content[:a],
        content[:a] + content[b:],
        content[:b] + content[a:b] * rng.choice([1, 50]) + content[b:],
        rng.choice(
            [b"", b"[" * 5000, b"\xef\xbb\xbf" + content, b"\0" * 100, b"null", b"[]", b"{}", b"\xff\xfe" + content]
        ),
        content[:a] + rng.choice(WORDS).encode() + content[a:],
    )[kind % 6]


def attempt(words: list[str], folder: Path) -> Ended:
    """Run a command in a folder, in a process of its own, and say what was wrong with its end."""
    before = {path for path in folder.rglob("*") if path.is_file()}
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        began = time.monotonic()
        child = os.fork()
        if child == 0:
            _child(words, folder, out.fileno(), err.fileno())
        code, memory = _wait(child, began)
        seconds = time.monotonic() - began
        err.seek(0)
        lines = [line for line in err.read().decode(errors="replace").splitlines() if line.strip()]
    left = {path for path in folder.rglob("*") if path.is_file()} - before
    faults = []
    if code not in ENDS:
        faults.append(f"ended with {code}")
    if (code == 2 and len(lines) != 1) or (code in (1, 130) and len(lines) > 1) or any("Traceback" in x for x in lines):
        faults.append(f"{len(lines)} lines on standard error")
    if any(path.name.startswith(".") and path.name != ".lock" for path in left) or (code == 2 and left):
        faults.append(f"left {', '.join(str(path.relative_to(folder)) for path in sorted(left))}")
    if seconds > LONGEST:
        faults.append(f"took {seconds:.0f} s")
    if memory > LARGEST:
        faults.append(f"took {memory / 1e9:.2f} GB")
    return Ended(words, code, lines, seconds, memory, faults)


def _child(words: list[str], folder: Path, out: int, err: int) -> None:
    os.setsid()
    os.chdir(folder)
    os.dup2(out, 1)
    os.dup2(err, 2)
    sys.stdout, sys.stderr = (os.fdopen(fd, "w", closefd=False) for fd in (1, 2))
    code = 1
    try:
        module = "rftsim_mpm.cli" if words[:1] == ["mpm"] else "rftsim.cli"
        importlib.import_module(module).main(words[1:] if words[:1] == ["mpm"] else words)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _wait(child: int, began: float) -> tuple[int, float]:
    """The exit code of a process, which is ended after 1.5 of its time, and its memory [byte]."""
    while True:
        pid, status, used = os.wait4(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status), 1024.0 * used.ru_maxrss
        if time.monotonic() - began > 1.5 * LONGEST:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.01)


def study(commands: int, files: int, seed: int) -> Iterator[Ended]:
    """Try command lines and files that were spoilt, evenly from each that there is."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as place:
        for k in range(commands + files):
            folder = Path(place) / f"{k}"
            folder.mkdir()
            make_files(folder)
            if k < commands:
                words = spoil_words(rng, COMMANDS[k % len(COMMANDS)].split())
                yield attempt(words, folder)
                continue
            name = list(FILES)[k % len(FILES)]
            content = spoil_bytes(rng, (folder / name).read_bytes())
            (folder / name).write_bytes(content)
            ended = attempt(FILES[name].split(), folder)
            yield ended._replace(words=[*ended.words, f"# {name} = {content[:150]!r}"])


def main() -> int:
    """Run the study, and print what went wrong and the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name, default in (("--commands", 300), ("--files", 300), ("--seed", 0)):
        parser.add_argument(name, type=int, default=default)
    given = parser.parse_args()
    for module in PRELOADED:
        importlib.import_module(module)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = []
    for one in study(given.commands, given.files, given.seed):
        found.append(one)
        if one.faults:
            print(f"{'; '.join(one.faults)}: {' '.join(word[:200] for word in one.words)}")
            print("".join(f"    {line[:200]}\n" for line in one.lines[-4:]), end="", flush=True)
    faulty = [one for one in found if one.faults]
    codes = ", ".join(f"{count} with {code}" for code, count in sorted(Counter(one.code for one in found).items()))
    print(f"{len(found)} trials, {len(faulty)} faulty: {codes}")
    print(
        f"longest {max(one.seconds for one in found):.1f} s, largest {max(one.memory for one in found) / 1e6:.0f} MB, "
        f"of which {own / 1e3:.0f} MB before the command"
    )
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
