"""A virtual display, on which windows are opened and pictures of them taken."""

import contextlib
import os
import select
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


class Display(NamedTuple):
    """A virtual display: its name, and the file that it keeps its pixels in, in the format of xwd."""

    name: str
    pixels: Path

    def command(self, *arguments: object) -> list[str]:
        """A command of rftsim, as a process of its own."""
        return [sys.executable, "-c", "from rftsim.cli import main; main()", *map(str, arguments)]

    def environment(self) -> dict[str, str]:
        """Variables under which a process draws on it, in software."""
        kept = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "WAYLAND_DISPLAY")}
        return kept | {"DISPLAY": self.name, "LIBGL_ALWAYS_SOFTWARE": "1"}

    def shoot(self) -> Any:
        """What is on it now: red, green and blue, (height, width, 3)."""
        raw = self.pixels.read_bytes()
        head, *words = struct.unpack(">25I", raw[:100])
        width, height, row, colours = words[3], words[4], words[11], words[18]
        found = np.frombuffer(raw, np.uint8, row * height, head + 12 * colours)
        return found.reshape(height, row // 4, 4)[:, :width, 2::-1]


@contextlib.contextmanager
def virtual_display(folder: Path) -> Iterator[Display]:
    """A display of 640 x 480, which ends with the block; its pixels are in the folder."""
    reading, writing = os.pipe()
    screen = ("-screen", "0", "640x480x24", "-displayfd", str(writing), "-fbdir", str(folder))
    server = subprocess.Popen(["Xvfb", *screen], pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        assert select.select([reading], [], [], 30.0)[0], "Xvfb starts"
        yield Display(f":{os.read(reading, 16).decode().strip()}", folder / "Xvfb_screen0")
    finally:
        os.close(reading)
        server.terminate()
        server.wait()
