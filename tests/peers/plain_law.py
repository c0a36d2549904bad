"""The law in plain C, a peer: `python tests/peers/plain_law.py [compiler and flags]`, from the top folder.

Two variants of it, one that evaluates every triangle and one that first chooses those in the sand that lead, as ours
does, are timed in turn with ours on buried spheres, as `rftsim bench kernel` does, and their wrenches compared. Ours
is made for the levels of `rftsim.machine.targets`, as `-march=x86-64-v4` or `-march=x86-64-v3` makes the C.
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
from rftsim.law.evaluate import handle
from rftsim.law.laws import get_law
from rftsim.law.layout import COLUMN, pack_bed, pack_surface, read_columns
from rftsim.law.leading import SHARP, Edge, reach2
from rftsim.sand.free_surface import FreeSurface

COMPILER = ["cc", "-O3", "-march=native", "-ffast-math"]
SIZES = (64, 1024, 20480)
VARIANTS = {"of_all": "plain C without selection", "of_chosen": "with the same selection"}
AGREED = 1e-12


def compiled(folder, command):
    library = Path(folder) / "plain_law.so"
    source = Path(__file__).with_suffix(".c")
    subprocess.run([*command, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(library)


def case(surface, position, velocity, omega):
    """The numbers of the C source's `Case`."""
    reach = reach2(Edge(surface.edge_on, SHARP))
    table = (np.array(column, dtype=float)[:20] for column in tables.columns(get_law(kernel.LAW).table))
    sand = (kernel.SAND.xi_n, kernel.SAND.mu_surf, -position[2], reach)
    return np.concatenate([sand, velocity, omega, *table])


def in_c(function, columns, numbers, out, count):
    """The wrench by a function of the C library, evaluated so many times, into out (6,)."""
    arrays = (ctypes.c_void_p(array.ctypes.data) for array in (columns, numbers, out))
    function(ctypes.c_long(columns.size // len(COLUMN)), *arrays, ctypes.c_long(count))


def compare(plain, size):
    """A line of what a triangle costs on a sphere of so many."""
    surface = kernel._ball(size)
    body = pack_surface(surface)
    position, turn, velocity, omega = kernel._motion(surface)
    columns, numbers = np.concatenate(read_columns(body)), case(surface, position, velocity, omega)
    bed = pack_bed(kernel.SAND, get_law(kernel.LAW), FreeSurface(), (0.0, 1.0, 0.0))
    sand, wrenches = handle(bed), np.zeros((1 + len(VARIANTS), 6))
    works = [functools.partial(loops.evaluate, sand, body, position, turn, velocity, omega, wrenches[0])]
    for name, out in zip(VARIANTS, wrenches[1:], strict=True):
        works.append(functools.partial(in_c, getattr(plain, name), columns, numbers, out))
    ours, *theirs = kernel._least(works, lambda _: None)
    error = np.abs(wrenches - wrenches[0]).max() / np.abs(wrenches[0]).max()
    assert error < AGREED, f"the wrenches differ by {error:.1e}"
    told = (
        f"{name} {1e9 * seconds / size:.2f} ns, {seconds / ours:.2f} times as long"
        for name, seconds in zip(VARIANTS.values(), theirs, strict=True)
    )
    return f"{size} triangles: {1e9 * ours / size:.2f} ns each; {'; '.join(told)}; wrenches differ by {error:.1e}"


def main(command):
    with tempfile.TemporaryDirectory() as folder:
        plain = compiled(folder, command)
        for size in SIZES:
            print(compare(plain, size))


if __name__ == "__main__":
    main(sys.argv[1:] or COMPILER)
