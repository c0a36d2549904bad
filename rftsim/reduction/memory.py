"""Reductions remembered: for bodies alike within a load, and in the user's cache folder for the next ones.

A file holds the cluster of each triangle and the errors found, nothing that could be run. Its name is a hash of all
that these depend on: triangles, sand, tolerance, reach, and the code that searches. What cannot be read, is of another
user or does not fit the surface is made anew; where nothing can be written, nothing is.
"""

import concurrent.futures
import contextlib
import functools
import hashlib
import os
import stat
import sys
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from rftsim.errors import RftsimError
from rftsim.files import replacing
from rftsim.law.layout import BLOCK
from rftsim.machine.sources import PACKAGE, source_of
from rftsim.reduction.facets import Labels
from rftsim.reduction.reduce import SEEDS, Economy, Partition, partition, put_together
from rftsim.reduction.samples import Reach, free_reach
from rftsim.reduction.twins import counterparts
from rftsim.surface.triangles import Array, Surface

MOST: Final = 1000
"""Files that are kept; of more, the half that was written first is deleted."""
HEAD: Final = 4096
"""Bytes of a file beside the clusters, at most."""
UNREADABLE: Final = (OSError, ValueError, KeyError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error)


class Memory:
    """Reductions by all that they depend on, for the time of a load, and in a folder.

    Args:
        folder: Where they lie on disk; None for nowhere.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.known: dict[str, Partition] = {}
        self.wanted: dict[str, Callable[[], Partition]] = {}
        """The searches that are still to be made."""
        self.images: dict[str, tuple[str, Labels]] = {}
        """Of the reductions that are those of another's mirror image: whose, and which triangle each is there."""
        self.free: list[tuple[Surface, bytes, str]] = []
        """Surfaces of free bodies in blocks, sand and tolerance, and the name of their reduction."""

    def reduced(
        self, surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach] = free_reach
    ) -> tuple[Surface, Economy]:
        """The surface in the fewest facets found, from memory where it is known; arguments as of `reduce.reduced`."""
        return self.all_reduced([(surface, reach)], bed, tolerance)[0]

    def all_reduced(
        self, bodies: Sequence[tuple[Surface, Callable[[int], Reach]]], bed: Array, tolerance: float
    ) -> list[tuple[Surface, Economy]]:
        """The same of several bodies under one sand, whose searches run side by side; pairs of surface and reach."""
        names = [self._look_up(surface, bed, tolerance, reach) for surface, reach in bodies]
        self._search()
        return [put_together(surface, self.known[name]) for (surface, _), name in zip(bodies, names, strict=True)]

    def _look_up(self, surface: Surface, bed: Array, tolerance: float, reach: Callable[[int], Reach]) -> str:
        """The name of a reduction, which is known then, or an image of another, or wanted."""
        reaches = [reach(seed) for seed in SEEDS]
        name = _name(surface, bed, tolerance, reaches)
        if name in self.known or name in self.wanted or name in self.images:
            return name
        found = _read(self._path(name), surface.ntri) if self.folder else None
        if found is not None:
            self.known[name] = found
        elif not (_is_free(reaches) and surface.wheel is None):
            self.wanted[name] = functools.partial(partition, surface, bed, tolerance, reach)
        elif not self._is_image(name, surface.clustered(BLOCK), bed.tobytes() + repr(tolerance).encode()):
            self.wanted[name] = functools.partial(partition, surface, bed, tolerance, free_reach)
        return name

    def _is_image(self, name: str, blocks: Surface, conditions: bytes) -> bool:
        """Whether a free body is the mirror image of one before it, under the same conditions."""
        for other, under, whose in self.free:
            image = counterparts(blocks, other) if under == conditions else None
            if image is not None:
                self.images[name] = whose, image
                return True
        self.free.append((blocks, conditions, name))
        return False

    def _search(self) -> None:
        """Make the wanted searches, and keep what they find."""
        fresh = _side_by_side(self.wanted)
        self.known |= fresh
        for name, (whose, image) in self.images.items():
            fresh[name] = self.known[whose]._replace(labels=self.known[whose].labels[image])
        self.known |= fresh
        self.wanted, self.images = {}, {}
        if self.folder:
            for name, found in fresh.items():
                with contextlib.suppress(OSError, RftsimError):  # a folder that cannot be written keeps nothing
                    _write(self._path(name), found)

    def _path(self, name: str) -> Path:
        assert self.folder is not None
        return self.folder / f"{name}.npz"


def _side_by_side(searches: dict[str, Callable[[], Partition]]) -> dict[str, Partition]:
    """The results of searches by their names, as many at once as there are processors."""
    if not searches:
        return {}
    import threadpoolctl  # not where all is known

    one_each = threadpoolctl.threadpool_limits(1, "blas")  # whose threads would wait for one another's processors
    with one_each, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(searches, pool.map(lambda search: search(), searches.values()), strict=True))


def user_folder() -> Path | None:
    """The folder of the user's cache that reductions are kept in, or None where the user has no home."""
    chosen = os.environ.get("XDG_CACHE_HOME", "")
    usual = {"darwin": "~/Library/Caches", "win32": "~/AppData/Local"}.get(sys.platform, "~/.cache")
    users = chosen if os.path.isabs(chosen) else os.path.expanduser(usual)
    return Path(users) / "rftsim" / "reduced" if os.path.isabs(users) else None


def _is_free(reaches: list[Reach]) -> bool:
    """Whether the reaches at SEEDS are those of a body that is free."""
    pairs = zip(reaches, map(free_reach, SEEDS), strict=True)
    return all(np.array_equal(one, other) for pair in pairs for one, other in zip(*pair, strict=True))


@functools.cache
def _code() -> bytes:
    """A hash of the code that a reduction depends on."""
    own = [*sorted((PACKAGE / "reduction").glob("*.py")), *sorted((PACKAGE / "surface").glob("*.py"))]
    return hashlib.sha256(source_of("law") + b"".join(path.read_bytes() for path in own)).digest()


def _name(surface: Surface, bed: Array, tolerance: float, reaches: list[Reach]) -> str:
    """A hash of all that a reduction depends on, in hexadecimal digits."""
    found = hashlib.sha256(_code())
    found.update(repr((surface.edge_on, surface.wheel, tolerance, surface.ntri)).encode())
    outline = [] if surface.outline is None else [surface.outline]
    for numbers in (bed, *(array for reach in reaches for array in reach), surface.triangles, *outline):
        found.update(repr(numbers.shape).encode())
        found.update(np.ascontiguousarray(numbers + 0.0).data)  # so that -0 is 0
    return found.hexdigest()


def _read(path: Path, ntri: int) -> Partition | None:
    """The reduction of so many triangles that a file of this user holds, or None."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as file:
            if not _is_own(os.fstat(handle)) or os.fstat(handle).st_size > 4 * ntri + HEAD:
                return None
            with np.load(file, allow_pickle=False) as kept:
                labels, errors = kept["labels"], kept["errors"]
    except UNREADABLE:
        return None
    fits = labels.shape == (ntri,) and labels.dtype == np.uint32 and errors.shape == (2,) and errors.dtype == float
    if not fits or not (np.isfinite(errors) & (errors >= 0.0)).all():
        return None
    counted = np.bincount(labels, minlength=1) if labels.max(initial=0) < ntri else np.zeros(1)
    return Partition(labels.astype(np.intp), *errors.tolist()) if counted.all() else None


def _is_own(status: os.stat_result) -> bool:
    """Whether a file is a plain one that belongs to the user who runs this; where there are no users, all do."""
    own = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
    return own and stat.S_ISREG(status.st_mode)


def _write(path: Path, found: Partition) -> None:
    """Keep a reduction in a file, and delete old ones where they are many."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with replacing(path) as temporary:
        np.savez(temporary, labels=found.labels.astype(np.uint32), errors=np.array([found.error, found.held_back]))
    files = list(path.parent.glob("*.npz"))
    if len(files) > MOST:
        for old in sorted(files, key=lambda file: file.stat().st_mtime)[: MOST // 2]:
            old.unlink(missing_ok=True)
