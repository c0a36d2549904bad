"""The law in plain C, a peer: `python tests/peers/plain_law.py [compiler and flags]`, from the top folder.

Times both in turn on buried spheres, as `rftsim bench kernel` does, and compares their wrenches.
"""

import ctypes
import functools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from rftsim.bench import kernel, loops
from rftsim.law import tables
from rftsim.law.laws import get_law
from rftsim.law.layout import pack_sand, pack_surface, read_columns
from rftsim.sand.free_surface import FreeSurface

COMPILER = ["cc", "-O3", "-march=native", "-ffast-math"]
SIZES = (64, 1024, 20480)


def compiled(folder, command):
    library = Path(folder) / "plain_law.so"
    source = Path(__file__).with_suffix(".c")
    subprocess.run([*command, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(library).wrench


def main(command):
    sand = pack_sand(kernel.SAND, get_law(kernel.LAW), FreeSurface(), (0.0, 1.0, 0.0))
    table = np.concatenate([np.array(column, dtype=float)[:20] for column in tables.columns(get_law(kernel.LAW).table)])
    with tempfile.TemporaryDirectory() as folder:
        plain = compiled(folder, command)
        for size in SIZES:
            surface = kernel._ball(size)
            body = pack_surface(surface)
            position, turn, velocity, omega = kernel._motion(surface)
            columns = np.concatenate(read_columns(body))
            ours, theirs = np.zeros(6), np.zeros(6)

            def in_c(count, n=size, columns=columns, height=-position[2], v=velocity, w=omega, out=theirs):
                numbers = (ctypes.c_double(x) for x in (kernel.SAND.xi_n, kernel.SAND.mu_surf, height))
                arrays = (ctypes.c_void_p(x.ctypes.data) for x in (v, w, out))
                first = (ctypes.c_void_p(x.ctypes.data) for x in (columns, table))
                plain(ctypes.c_long(n), *first, *numbers, *arrays, ctypes.c_long(count))

            here = functools.partial(loops.evaluate, sand, body, position, turn, velocity, omega, ours)
            mine, c = kernel._least([here, in_c], lambda _: None)
            error = np.abs(ours - theirs).max() / np.abs(theirs).max()
            print(
                f"{size} triangles: {1e9 * mine / size:.2f} ns each, plain C {1e9 * c / size:.2f} ns: "
                f"{c / mine:.2f} times as long; wrenches differ by {error:.1e}"
            )


if __name__ == "__main__":
    main(sys.argv[1:] or COMPILER)
