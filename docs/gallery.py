"""Make the pictures of the gallery, and the moving one: robots on sand, driven by actions that see nothing.

python docs/gallery.py             # all, some minutes: `make pictures`
python docs/gallery.py NAME ...    # some: wheel runner drill rover hexapod quadruped sand
python docs/gallery.py --to out    # into another folder
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import trimesh
from PIL import Image
from rftsim_envs import SandEnv

from rftsim.view.render import Pictures

FOLDER: Final = Path(__file__).parent / "pictures"
SIZE: Final = (800, 450)
"""Width and height of a still [pixels]."""
FILM: Final = (640, 360)
"""Width and height of the moving picture [pixels]."""
FPS: Final = 12
"""Moving pictures per second."""
QUALITY: Final = {".jpg": 82, ".webp": 48}
"""Quality that files are compressed with, by their ending."""


class Driven(NamedTuple):
    """An environment, and the action that it gets all the time."""

    task: str
    """Name of the task."""
    action: tuple[float, ...]
    """The action, one number for all motors or one each."""
    seconds: float
    """Simulated time of the still [s]."""
    settings: dict[str, object]
    """Settings of the task."""
    seed: int = 0
    """Seed of the episode."""


DUNES: Final = {"terrain": "dunes", "slope_deg": 0, "ruts": True}
DRIVEN: Final = {
    "hexapod": Driven("CLegHexapod", (-0.3,), 1.9, {"sand": "medium-sand", "strength": (1.0, 1.0), "slope_deg": 0}),
    "rover": Driven("Rover", (0.6, 0.6), 9.0, {**DUNES, "amplitude": 0.07, "wavelength": 3.0}),
    "quadruped": Driven("Quadruped", (0.0,), 1.0, {"sand": "medium-sand", "slope_deg": 0, "ruts": True}),
}
COMMANDS: Final = {
    "wheel": "rftsim run grouser-wheel --law rft3d --set rpm=30 --ruts --duration 3 --tractions --picture wheel.png",
    "runner": "rftsim run four-flap-runner --set rpm=100 --duration 2 --tractions --picture runner.png",
    "drill": "rftsim run intruder --set motion=drill mesh=drill.stl height=0.01 speed=0.04 rate=-12 --duration 2.2 "
    "--sand dem-glass-beads --tractions --buried --picture drill.png",
}
"""Commands that draw a still, run in a folder that has drill.stl."""


def moments(one: Driven, fps: float) -> Iterator[SandEnv]:
    """The environment, a number of times per simulated second [1/s], while it is driven."""
    env = SandEnv(one.task, **one.settings)
    env.reset(seed=one.seed)
    action = np.resize(np.array(one.action), env.action_space.shape)
    shown = 0
    for step in range(round(one.seconds / env.config.period)):
        if step * env.config.period * fps >= shown:
            shown += 1
            yield env
        env.step(action)
    yield env
    env.close()


def still(one: Driven) -> Image.Image:
    """The last moment of an environment that is driven."""
    *_, env = moments(one, 0.0)
    with Pictures(env.model, *SIZE) as pictures:
        return Image.fromarray(pictures.take(env.data, "follow"))


def drawn(command: str) -> Image.Image:
    """The picture that a command draws."""
    with tempfile.TemporaryDirectory() as folder:
        spiral().export(Path(folder) / "drill.stl")
        words = command.split()
        subprocess.run([Path(sys.executable).parent / words[0], *words[1:]], cwd=folder, check=True)
        return Image.open(Path(folder) / words[-1]).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)


def spiral() -> trimesh.Trimesh:
    """A drill, 0.16 m long, its tip at the origin: a square bar that was twisted, and tapers [m]."""
    bar = trimesh.creation.box((0.04, 0.04, 0.16)).subdivide_to_size(0.008)
    height = bar.vertices[:, 2] + 0.08
    turn, width = 40.0 * height, np.clip(height / 0.05, 0.15, 1.0)
    x, y = bar.vertices[:, 0] * width, bar.vertices[:, 1] * width
    vertices = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), height])
    return trimesh.Trimesh(vertices, bar.faces)


def film() -> list[Image.Image]:
    """The hexapod, and the rover on dunes, one after the other."""
    frames = []
    for name, seconds in (("hexapod", 3.0), ("rover", 6.0)):
        one = DRIVEN[name]._replace(seconds=seconds)
        speed = 2.0 if name == "rover" else 1.0
        pictures = None
        for env in moments(one, FPS / speed):
            pictures = pictures or Pictures(env.model, *FILM)
            frames.append(Image.fromarray(pictures.take(env.data, "follow")))
        if pictures is not None:
            pictures.close()
    return frames


def main() -> None:
    """Make the pictures that are named, or all."""
    makers: dict[str, Callable[[], Image.Image]] = {name: lambda one=one: still(one) for name, one in DRIVEN.items()}
    makers |= {name: lambda line=line: drawn(line) for name, line in COMMANDS.items()}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--to", type=Path, default=FOLDER, help="the folder that they are written to")
    asked = parser.parse_args()
    names = (*makers, "sand")
    for name in set(asked.names) - set(names):
        parser.error(f"no picture {name!r}; pictures are {', '.join(names)}")
    asked.to.mkdir(parents=True, exist_ok=True)
    for name in asked.names or names:
        path = asked.to / f"{name}{'.webp' if name == 'sand' else '.jpg'}"
        if name == "sand":
            first, *rest = film()
            moving = {"save_all": True, "append_images": rest, "duration": 1000 // FPS, "loop": 0}
            first.save(path, quality=QUALITY[".webp"], method=6, **moving)
        else:
            makers[name]().save(path, quality=QUALITY[".jpg"], optimize=True)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
